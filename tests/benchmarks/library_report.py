"""How long a report of many maps takes to open in Chromium, to sort and to search.

    .venv-5.2/bin/python -m tests.benchmarks.library_report [--rows 2000] [--opens 5] [-o FOLDER]
    .venv-5.2/bin/python -m tests.benchmarks.library_report --picture docs/library-report.png

The maps are the sunrise and those of Blender's studio lights (CC0), converted; a report of more
rows has the same pictures turned, so that no two are alike and none is decoded for another.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import distribution
from pathlib import Path
from statistics import median

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, CDPSession, Page

from sunsplit.core import LibraryOptions, convert_library
from sunsplit.core.files.maps import load
from sunsplit.core.library.records import Row
from sunsplit.core.library.report import HTML, write_report
from sunsplit.core.library.side_files import OF_FOLDER
from sunsplit.core.library.thumbnail import JPEG
from tests.browser import browser
from tests.files import write_exr

SUNRISE = Path(__file__).parents[2] / "sample_scenes" / "spruit_sunrise_1k.hdr"

OPEN, ACT = 2000, 200
"""What is to be reached, in milliseconds."""

ABOUT = {"author": "Greg Zaal, Poly Haven", "licence": "CC0"}
"""Of the sunrise and of all studio lights."""

OPENING = "open, until the first pictures are on the screen"
COLUMNS = ("Map", "Status", "Suns", "Predicted error", "Size", "Warnings")
WORDS = ("sunset", "folder_07 forest", "failed")

PAINTED = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
FIRST_PICTURE = f"document.querySelector('tbody img').decode().then(() => {PAINTED})"


@dataclass(frozen=True)
class Result:
    """Milliseconds, once for each time. bar: what the median should stay below. busy: of them,
    what the page's main thread worked, which does not depend on what else the machine does."""

    what: str
    times: Sequence[float]
    busy: Sequence[float]
    bar: float


def studio_lights() -> list[Path]:
    """The maps that Blender brings along."""
    return sorted(
        Path(str(distribution("bpy").locate_file("bpy"))).glob("*/datafiles/*/world/*.exr")
    )


def converted(maps: Sequence[Path], folder: Path, *, with_a_failure: bool) -> tuple[Row, ...]:
    """Maps as a library, converted; its rows. Its output, with its report, is the folder `out`.

    with_a_failure: the sunrise without its lowest rows is in it, which cannot be converted."""
    library = folder / "World maps"
    for path in maps:
        (library / path.parent.name).mkdir(parents=True, exist_ok=True)
        shutil.copy(path, library / path.parent.name)
    if with_a_failure:
        (library / "unfinished").mkdir()
        pixels = load(SUNRISE).radiance[:-24]
        write_exr(library / "unfinished" / "sunrise_cropped.exr", pixels)
    (library / OF_FOLDER).write_text(json.dumps(ABOUT), encoding="utf-8")
    return convert_library(library, folder / "out", LibraryOptions(preview=True)).rows


def many(rows: Sequence[Row], count: int) -> list[Row]:
    """So many rows of these, in folders of a hundred; each 50th has failed, each 9th a warning."""
    found = []
    for n in range(count):
        row = rows[n % len(rows)]
        source = f"folder_{n // 100:02}/{Path(row.source).stem}_{n:05}.exr"
        if n % 50 == 49:
            sentence = f"{source} is 4096 x 2049, not 2:1."
            found.append(Row(source, "failed", sentence, seconds=0.1))
            continue
        warnings = ("The sun is clipped: its brightest pixels are alike.",) if n % 9 == 0 else ()
        found.append(
            replace(
                row,
                source=source,
                warnings=warnings,
                predicted_error=row.predicted_error * (1 + n / count),
                thumbnail=turned(row.thumbnail, n),
            )
        )
    return found


def turned(picture: str, columns: int) -> str:
    """The same JPEG in base64, turned about the zenith."""
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))))
    out = io.BytesIO()
    Image.fromarray(np.roll(pixels, columns, axis=1)).save(out, "JPEG", **JPEG)
    return base64.b64encode(out.getvalue()).decode()


def measure(opened: Browser, report: Path, opens: int) -> list[Result]:
    """All figures of a report. Each time it is opened in a fresh profile."""
    found: dict[str, list[tuple[float, float]]] = {}
    for _ in range(opens):
        context = opened.new_context(viewport={"width": 1400, "height": 900})
        page = context.new_page()
        inside = context.new_cdp_session(page)
        inside.send("Performance.enable", {"timeDomain": "threadTicks"})

        def add(what: str, act: Callable[[], float], inside: CDPSession = inside) -> None:
            before = busy(inside)
            time = act()
            found.setdefault(what, []).append((time, busy(inside) - before))

        add(OPENING, lambda page=page: opened_in(page, report))
        for name in COLUMNS:
            add(f"sort by {name}", lambda page=page, name=name: sorted_in(page, name))
        for words in (*WORDS, ""):
            what = f"search {words!r}" if words else "search, all again"
            add(what, lambda page=page, words=words: searched_in(page, words))
        context.close()
    return [
        Result(what, *zip(*times, strict=True), OPEN if what == OPENING else ACT)
        for what, times in found.items()
    ]


def busy(inside: CDPSession) -> float:
    """Milliseconds that the page's main thread has worked so far."""
    metrics = inside.send("Performance.getMetrics")["metrics"]
    return 1e3 * next(one["value"] for one in metrics if one["name"] == "TaskDuration")


def opened_in(page: Page, report: Path) -> float:
    """Milliseconds until the event `load` has come and the first pictures are on the screen."""
    start = time.perf_counter()
    page.goto(report.as_uri())
    page.evaluate(FIRST_PICTURE)
    return 1e3 * (time.perf_counter() - start)


def sorted_in(page: Page, name: str) -> float:
    """Milliseconds from a click on a header until the new order is on the screen."""
    button = page.get_by_role("columnheader", name=name, exact=True).get_by_role("button")
    return button.evaluate(
        "async button => { const start = performance.now(); button.click();"
        f"await {PAINTED}; return performance.now() - start; }}"
    )


def searched_in(page: Page, words: str) -> float:
    """Milliseconds from the last key until what matches is on the screen."""
    return page.locator("#search").evaluate(
        "async (field, words) => { const start = performance.now(); field.value = words;"
        "field.dispatchEvent(new Event('input', {bubbles: true}));"
        f"await {PAINTED}; return performance.now() - start; }}",
        words,
    )


def table(results: Sequence[Result], rows: int, megabytes: float, version: str) -> str:
    lines = [
        f"# A library's report of {rows:,} maps in a browser",
        "",
        f"Chromium {version} without a window or a GPU; the page has {megabytes:.1f} MB. "
        "Milliseconds, until what is asked for is on the screen.",
        "",
        "| what | median | largest | of it, main thread at work | to be below |",
        "| --- | --- | --- | --- | --- |",
    ]
    for one in results:
        figures = (median(one.times), max(one.times), median(one.busy), one.bar)
        lines.append(f"| {one.what} | {' | '.join(f'{figure:.0f}' for figure in figures)} |")
    return "\n".join(lines) + "\n"


def take_picture(opened: Browser, report: Path, path: Path, width: int, dark: bool) -> None:
    """A report as it looks in a window."""
    page = opened.new_page(
        viewport={"width": width, "height": 780}, color_scheme="dark" if dark else "light"
    )
    page.goto(report.as_uri())
    sorted_in(page, "Warnings")
    page.evaluate(FIRST_PICTURE)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    page.close()
    picture.save(path, optimize=True)


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("maps", nargs="*", type=Path, metavar="MAP.hdr")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"), metavar="FOLDER")
    parser.add_argument("--rows", type=int, default=2000)
    parser.add_argument("--opens", type=int, default=5)
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="of the maps' own report")
    parser.add_argument("--width", type=int, default=1400, help="of the picture")
    parser.add_argument("--dark", action="store_true", help="the picture")
    chosen = parser.parse_args(arguments)
    maps = chosen.maps or [SUNRISE, *studio_lights()]
    with tempfile.TemporaryDirectory() as name, browser() as opened:
        folder = Path(name)
        rows = converted(maps, folder, with_a_failure=chosen.picture is not None)
        if chosen.picture:
            report = folder / "out" / HTML
            take_picture(opened, report, chosen.picture, chosen.width, chosen.dark)
            return []
        rows = many(rows, chosen.rows)
        report, _ = write_report(folder / "many", rows, f"{chosen.rows:,} maps")
        results = measure(opened, report, chosen.opens)
        text = table(results, len(rows), report.stat().st_size / 1e6, opened.version)
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "library_report.md").write_text(text, encoding="utf-8")
    print(text)
    return results


if __name__ == "__main__":
    main()
