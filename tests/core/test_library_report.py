from __future__ import annotations

import base64
import csv
import os
import re
from dataclasses import fields, replace
from urllib.parse import unquote_to_bytes, urlsplit

import pytest

from sunsplit.core.conversion import convert
from sunsplit.core.errors import CannotWrite
from sunsplit.core.files.maps import load
from sunsplit.core.library.records import Row
from sunsplit.core.library.report import write_report
from sunsplit.core.library.report_page import COLUMNS
from sunsplit.core.library.thumbnail import thumbnail
from tests.browser import browser, chromium

HOSTILE = (
    "<script>window.harmed=1</script>.exr",
    "</script><script>window.harmed=1</script>.exr",
    "--><img src=x onerror=window.harmed=1>.exr",
    "\"'><svg onload=window.harmed=1>.exr",
    "&lt;b&gt; &amp; &quot;.exr",
    "javascript:window.harmed=1",
    "${window.harmed=1} {{harmed}} `x` \\u003c.exr",
    "line\nbreak \u2028 \u202e turned.exr",
    "bytes \udcff\udc80.exr",
)


@pytest.fixture(scope="module")
def opened():
    if chromium() is None:
        pytest.skip("there is no Chromium: install Debian's package chromium")
    with browser() as found:
        yield found


@pytest.fixture
def show(opened, tmp_path):
    """Open a report of rows; in the end, nothing may have been fetched or complained of."""
    contexts, said, asked = [], [], []

    def opener(rows, title="Maps", **options):
        report, _ = write_report(tmp_path, rows, title)
        contexts.append(opened.new_context(**options))
        page = contexts[-1].new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("dialog", lambda dialog: said.append(dialog.message))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(report.as_uri())
        return page

    yield opener
    for context in contexts:
        context.close()
    assert said == []
    assert {url for url in asked if not url.startswith("data:image/jpeg;base64,")} == {
        (tmp_path / "report.html").as_uri()
    }


@pytest.fixture(scope="module")
def picture(sunrise):
    return base64.b64encode(thumbnail(convert(load(sunrise)))).decode()


@pytest.fixture
def rows(picture):
    """Each figure in an order of its own."""
    names = ["sky_10.exr", "sky_9.exr", "b/Meadow.hdr", "a/broken.exr", "studio.exr", "a/cut.exr"]
    found = [
        Row(
            source=name,
            status="done",
            width=1024 * (n % 3 + 1),
            height=512 * (n % 3 + 1),
            lights=(7, 12, 3, 0, 100, 0)[n],
            share=(0.5, 0.07, 0.93, 0, 0.251, 0)[n],
            predicted_error=(0.004, 0.5, 0.0012, 0, 0.03, 0)[n],
            ground_error=(0.02, 0.001, 0.3, 0, 0.0, 0)[n],
            account_error=(3e-7, 1e-16, 0.0, 0, 2e-3, 0)[n],
            seconds=(0.31, 12.0, 1.5, 0.02, 0.3, 0.01)[n],
            thumbnail=picture,
        )
        for n, name in enumerate(names)
    ]
    found[0] = replace(found[0], author="Ada Lovelace", licence="CC0", variants=("sky_10_4k.exr",))
    found[1] = replace(found[1], warnings=("The sun is clipped.", "Negative pixels."))
    found[4] = replace(found[4], warnings=("The map may be upside down.",))
    for n, sentence in ((3, "a/broken.exr ends too early."), (5, "a/cut.exr is 7 x 3, not 2:1.")):
        failed = Row(found[n].source, "failed", sentence, seconds=found[n].seconds)
        found[n] = replace(failed, width=7, height=3) if n == 5 else failed
    return found


def names(page):
    """Of the maps that are shown, from top to bottom."""
    return page.locator("tbody tr:not([hidden]) .map b").all_text_contents()


def header(page, name):
    return page.get_by_role("columnheader", name=name, exact=True)


def sort_by(page, name):
    header(page, name).get_by_role("button").click()


def test_rows_are_shown(show, rows):
    page = show(rows, "My <maps>")
    assert page.title() == page.locator("h1").inner_text() == "My <maps>"
    totals = page.locator(".totals").inner_text()
    assert totals == (
        "6 maps · 4 converted · 2 failed · 2 with warnings · 122 suns · 14.1 s of work"
    )
    assert names(page) == [os.path.basename(row.source) for row in rows]  # noqa: PTH119
    cells = page.locator("tbody tr").nth(0).get_by_role("cell").all_inner_texts()
    assert cells[2:] == [
        "converted", "7", "50.0%", "0.40%", "2.00%", "3e-7", "1024\xa0× 512", "0.3 s", ""
    ]  # fmt: skip
    about = page.locator("tbody tr").nth(0).locator("small").all_inner_texts()
    assert about == ["other sizes: sky_10_4k.exr", "by Ada Lovelace · CC0"]
    second = page.locator("tbody tr").nth(1).locator(".notes p").all_inner_texts()
    assert second == ["The sun is clipped.", "Negative pixels."]
    failed = page.locator("tbody tr").nth(3).get_by_role("cell").all_inner_texts()
    assert failed[2:] == ["failed", *"–––––", "", "0.0 s", "a/broken.exr ends too early."]
    assert page.locator("tbody tr").nth(3).locator("small").all_inner_texts() == ["in a"]


FIGURES = {
    "Suns": "lights",
    "Light in suns": "share",
    "Predicted error": "predicted_error",
    "Ground error": "ground_error",
    "Account": "account_error",
}


def expected(rows, name, rising):
    """Names of rows as sorted by a column; what has no such figure comes last."""
    keys = {
        "Status": lambda row: row.status == "failed",
        "Size": lambda row: row.width * row.height or None,
        "Time": lambda row: row.seconds,
        "Warnings": lambda row: (row.status == "failed") * 100 + len(row.warnings),
    }
    for column, field in FIGURES.items():
        keys[column] = lambda row, f=field: None if row.status == "failed" else getattr(row, f)
    key = keys[name]
    known = [row for row in rows if key(row) is not None]
    order = sorted(known, key=lambda row: key(row) if rising else -key(row))
    return [row.source.split("/")[-1] for row in order + [r for r in rows if key(r) is None]]


@pytest.mark.parametrize("name", [column[0] for column in COLUMNS])
def test_a_click_on_a_header_sorts(show, rows, name):
    page = show(rows)
    sort_by(page, "Time" if name != "Time" else "Suns")  # an order that is none of the others
    sort_by(page, name)
    first, second = ("ascending", "descending") if name == "Map" else ("descending", "ascending")
    by_name = ["broken.exr", "cut.exr", "Meadow.hdr", "sky_9.exr", "sky_10.exr", "studio.exr"]
    for direction in (first, second, first):
        assert header(page, name).get_attribute("aria-sort") == direction
        assert page.locator("[aria-sort]").count() == 1
        rising = direction == "ascending"
        if name == "Map":
            assert names(page) == by_name[:: 1 if rising else -1]
        else:
            assert names(page) == expected(rows, name, rising)
        sort_by(page, name)


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("SKY", ["sky_10.exr", "sky_9.exr"]),
        ("meadow", ["Meadow.hdr"]),
        ("a/", ["broken.exr", "cut.exr"]),
        ("lovelace", ["sky_10.exr"]),
        ("4k", ["sky_10.exr"]),
        ("upside", ["studio.exr"]),
        ("clipped  sky", ["sky_9.exr"]),
        ("not 2:1", ["cut.exr"]),
        ("failed", ["broken.exr", "cut.exr"]),
        ("nowhere", []),
    ],
)
def test_search(show, rows, words, found):
    page = show(rows)
    page.get_by_role("searchbox").press_sequentially(words)
    assert names(page) == found
    assert page.get_by_role("status").inner_text() == f"{len(found)} of 6 shown"
    assert page.get_by_text("No map matches.").is_visible() == (not found)
    page.get_by_role("searchbox").press("Escape")
    assert len(names(page)) == 6
    assert page.get_by_role("status").inner_text() == ""


def test_filters_and_search_and_sort_go_together(show, rows):
    page = show(rows)
    sort_by(page, "Time")
    page.get_by_role("button", name="With warnings (2)").click()
    assert names(page) == ["sky_9.exr", "studio.exr"]
    page.get_by_role("button", name="Failed (2)").click()
    assert names(page) == ["broken.exr", "cut.exr"]
    assert page.locator("[aria-pressed=true]").all_inner_texts() == ["Failed (2)"]
    page.get_by_role("searchbox").fill("early")
    assert names(page) == ["broken.exr"]
    sort_by(page, "Map")
    page.get_by_role("searchbox").fill("")
    assert names(page) == ["broken.exr", "cut.exr"]
    page.get_by_role("button", name="All (6)").click()
    assert len(names(page)) == 6


def test_by_keyboard_alone(show, rows):
    page = show(rows)
    page.keyboard.press("Tab")
    page.keyboard.type("exr")
    assert len(names(page)) == 5
    for _ in range(2):
        page.keyboard.press("Tab")
    page.keyboard.press("Space")
    assert names(page) == ["broken.exr", "cut.exr"]
    for _ in range(2):
        page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Map"
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    assert names(page) == ["cut.exr", "broken.exr"]
    assert header(page, "Map").get_attribute("aria-sort") == "descending"


def test_pictures_are_shown_and_the_header_stays(show, picture):
    page = show([Row(f"{n}.exr", "done", thumbnail=picture) for n in range(400)])
    for image in (page.locator("tbody img").first, page.locator("tbody img").last):
        image.scroll_into_view_if_needed()
        assert image.evaluate("image => image.decode().then(() => image.naturalWidth)") == 192
        assert image.bounding_box()["width"] == 2 * image.bounding_box()["height"]
    assert page.evaluate("scrollY") > 30_000
    # A new order is seen from its beginning, and so is what a search finds.
    sort_by(page, "Map")
    assert first_below_header(page) == "0.exr"
    page.evaluate("scrollTo(0, 20_000)")
    assert page.evaluate("scrollY") == 20_000
    page.get_by_role("searchbox").fill("1")
    assert first_below_header(page) == "1.exr"


def first_below_header(page):
    """The name in the row that begins where the header ends."""
    return page.evaluate(
        """() => {
            const end = document.querySelector("thead").getBoundingClientRect().bottom;
            const row = [...document.querySelectorAll("tbody tr:not([hidden])")]
                .find(one => Math.abs(one.getBoundingClientRect().top - end) < 1);
            return row?.querySelector("b").textContent;
        }"""
    )


def test_hostile_names_do_no_harm(show, picture):
    rows = [
        Row(
            name,
            "done",
            variants=(name,),
            warnings=(name,),
            files=(name + ".lights.json", name + ".preview.png"),
            thumbnail=picture,
            author=name,
            licence=name,
        )
        for name in HOSTILE
    ]
    rows += [Row(name, "failed", name) for name in HOSTILE]
    page = show(rows, "</title></h1><script>window.harmed=1</script>")
    page.mouse.wheel(0, 10_000)
    sort_by(page, "Map")
    sort_by(page, "Size")  # nothing has one: back to the library's order
    shown = [name.encode("utf-8", "backslashreplace").decode().split("/")[-1] for name in HOSTILE]
    assert names(page) == [*shown, *shown]
    sentences = page.locator("p.sentence").all_text_contents()
    assert sentences == [n.encode("utf-8", "backslashreplace").decode() for n in HOSTILE]
    assert page.evaluate("window.harmed") is None
    assert page.locator("script, svg, h1 script").count() == 1
    addresses = page.locator("tbody a").evaluate_all("links => links.map(link => link.href)")
    assert all(address.startswith("file:///") for address in addresses)
    assert len(addresses) == 3 * len(HOSTILE)


def test_links_lead_to_the_files(show, tmp_path, picture):
    stems = ["plain", "a b/c#d?e=1&f%20", "ä/ø 100%", "a:b", "javascript:x"]
    if os.name == "posix":
        stems += ["bytes \udcff", "new\nline", "q\"uo'te\\"]
    rows = []
    for stem in stems:
        files = tuple(f"{stem}.{kind}" for kind in ("lights.json", "preview.png"))
        for file in files:
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).write_text(file.rpartition(".")[2])
        rows.append(Row(stem + ".exr", "done", files=files, thumbnail=picture))
    page = show(rows)
    addresses = page.locator("tbody a").evaluate_all("links => links.map(link => link.href)")
    targets = [os.fsdecode(unquote_to_bytes(urlsplit(a).path)) for a in addresses]
    wanted = [
        str(tmp_path / file) for row in rows for file in (row.files[1], row.files[0], row.files[1])
    ]
    assert targets == wanted
    assert all(map(os.path.exists, targets))


def test_a_link_opens_its_file(opened, tmp_path):
    (tmp_path / "a b#.lights.json").write_text('{"format": "sunsplit.lights"}')
    report, _ = write_report(tmp_path, [Row("a.exr", "done", files=("a b#.lights.json",))], "Maps")
    page = opened.new_page()
    page.goto(report.as_uri())
    page.get_by_role("link", name="lights").click()
    page.wait_for_url("**/*.json")
    assert "sunsplit.lights" in page.locator("body").inner_text()
    page.close()


@pytest.mark.parametrize("count", [0, 1])
def test_small_libraries(show, rows, count):
    page = show(rows[:count])
    assert names(page) == ["sky_10.exr"][:count]
    assert page.get_by_text("There are no maps in this library.").is_visible() == (count == 0)
    page.get_by_role("searchbox").fill("nowhere")
    sort_by(page, "Map")
    assert names(page) == []
    noun = "map" if count else "maps"
    assert (
        page.locator(".totals").inner_text().startswith(f"{count} {noun} · {count} converted · 0")
    )
    assert page.get_by_role("button", name="Failed (0)").is_disabled()


def test_without_javascript_all_rows_and_a_way_to_the_table(show, rows):
    page = show(rows, java_script_enabled=False)
    assert page.locator("noscript a").get_attribute("href") == "report.csv"
    assert page.locator("noscript p").is_visible()
    assert "JavaScript" in page.locator("noscript p").inner_text()
    assert page.locator("tbody tr .map b").count() == 6
    assert not page.locator(".bar").is_visible()


@pytest.mark.parametrize("width", [800, 991, 1301, 1400, 2560])
def test_nothing_is_cut_off(show, rows, width):
    wide = replace(rows[0], source="x" * 250 + ".exr", width=32768, height=16384, lights=65536)
    page = show([wide, *rows], viewport={"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    too_wide = page.locator("td, th").evaluate_all(
        "cells => cells.filter(c => c.scrollWidth > c.clientWidth + 1).map(c => c.textContent)"
    )
    assert too_wide == []


def test_dark_light_and_paper(show, rows):
    page = show(rows, color_scheme="dark")
    brightness = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0]"
    assert page.evaluate(brightness) < 40
    page.emulate_media(color_scheme="light")
    assert page.evaluate(brightness) > 240
    page.emulate_media(color_scheme="dark", media="print")
    assert page.evaluate(brightness) == 255
    assert not page.locator(".bar").is_visible()
    assert page.locator("tbody tr").last.is_visible()
    page.set_viewport_size({"width": 718, "height": 1000})  # A4 with margins of 10 mm
    assert page.evaluate("document.documentElement.scrollWidth") == 718


def read_csv(path):
    data = path.read_bytes()
    assert data.startswith(b"\xef\xbb\xbf")
    with path.open(encoding="utf-8-sig", newline="") as file:
        return data, list(csv.DictReader(file))


def test_the_table_holds_every_field(tmp_path, rows):
    _, path = write_report(tmp_path, rows, "Maps")
    data, read = read_csv(path)
    assert list(read[0]) == [field.name for field in fields(Row) if field.name != "thumbnail"]
    assert len(read) == len(rows)
    assert data.count(b"\r\n") == data.count(b"\n") == 1 + len(rows)
    for row, line in zip(rows, read, strict=True):
        assert line["source"] == row.source
        assert line["status"] == row.status
        assert line["sentence"] == row.sentence
        assert line["warnings"] == "; ".join(row.warnings)
        assert float(line["seconds"]) == row.seconds
        done = row.status == "done"
        for field in FIGURES.values():
            assert line[field] == (str(getattr(row, field)) if done else "")
        assert line["width"] == (str(row.width) if row.width else "")


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r"])
def test_nothing_in_the_table_is_a_formula(tmp_path, start):
    hostile = start + 'cmd|"/C calc"!A0'
    row = Row(hostile, "done", hostile, (hostile,), warnings=(hostile,), files=(hostile,))
    row = replace(row, author=hostile, licence=hostile, share=-0.5)
    _, path = write_report(tmp_path, [row], "Maps")
    _, (line,) = read_csv(path)
    for name in ("source", "sentence", "variants", "warnings", "files", "author", "licence"):
        assert line[name] == "'" + hostile
    assert line["share"] == "-0.5"


def test_names_of_any_bytes_can_be_written(tmp_path):
    rows = [Row(name, "done", variants=(name, name)) for name in HOSTILE]
    _, path = write_report(tmp_path, rows, "\udcff")
    _, read = read_csv(path)
    names = [line["source"] for line in read]
    assert names.pop() == "bytes \\udcff\\udc80.exr"
    assert names == ["'" + name if name.startswith("-") else name for name in HOSTILE[:-1]]


def test_the_same_rows_give_the_same_bytes(tmp_path, rows):
    first = [path.read_bytes() for path in write_report(tmp_path / "one", rows, "Maps")]
    assert [path.read_bytes() for path in write_report(tmp_path / "two", rows, "Maps")] == first
    assert [path.read_bytes() for path in write_report(tmp_path / "one", rows, "Maps")] == first


def test_a_page_of_its_own(tmp_path, rows):
    html, _ = write_report(tmp_path, [*rows, Row("x", "done", thumbnail='" onload="')], "Maps")
    text = html.read_text(encoding="utf-8")
    assert '" onload="' not in text
    assert not re.search(r"(?:https?:)?//[a-z]|@import|url\(", re.sub(r'base64,[^"]*', "", text))


def test_a_folder_that_cannot_be_written_to(tmp_path, rows):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(CannotWrite, match="it is a file"):
        write_report(tmp_path / "file", rows, "Maps")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
