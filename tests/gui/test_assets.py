"""Skies of an asset library, dragged from the Asset Browser into the 3D view with the mouse; and
the worker that made them, in a Blender that is no Python module."""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from sunsplit.core import convert, load, save
from tests.gui.window import WITH_US, Window

WORKER = "blender/extensions/user_default/sunsplit/addon/asset_library/worker.py"

WORLD, SUNS = "Sunrise", "Sunrise Suns"

SHOWN = 20
"""Seconds for the Asset Browser to find what is in the library."""

TILE = 45, 50
"""From the upper left corner of what the Asset Browser shows to the first preview."""


@pytest.fixture(scope="module")
def library(opened: Window, sunrise: Path) -> Path:
    """A library that the window's own Blender has made, run as Sunsplit runs it."""
    folder = opened.folder / "library"
    folder.mkdir()
    hdri = Path(shutil.copy(sunrise, folder / "sunrise.hdr"))
    save(convert(load(hdri)), folder)
    here = opened.debian.inside(folder)
    job = {
        "map": f"{here}/sunrise.hdr",
        "lights": f"{here}/sunrise.lights.json",
        "blend": f"{here}/sunrise.blend",
        "root": here,
        "name": WORLD,
    }
    made, not_made = asked(opened, [job, job | {"map": f"{here}/none.hdr"}])
    assert made["sentence"] == ""
    assert not_made["sentence"].startswith(f"{here}/none.hdr cannot be read")
    opened.ask("add_library('library')")
    return folder


def asked(opened: Window, jobs: list[dict]) -> list[dict]:
    """What the worker of the installed extension answers, in a Blender of its own.

    Blender itself may have said something on the same channel before the worker starts.
    """
    home = opened.debian.inside(opened.folder)
    words = ("blender", "--background", "--factory-startup", "--python", f"{home}/{WORKER}")
    with subprocess.Popen(
        [*WITH_US, *opened.debian.command(*words)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=opened.debian.environment(home),
    ) as process:
        answers = []
        process.stdin.write("{}\n")  # the greeting
        for job in jobs:
            process.stdin.write(json.dumps(job) + "\n")
            process.stdin.flush()
            answers.append(json.loads(next(line for line in process.stdout if line[0] == "{")))
        process.stdin.close()
        assert process.wait(60) == 0
    return answers


@pytest.fixture
def browser(window: Window, library: Path) -> Iterator[Window]:
    window.ask("open_assets()")
    window.settle()
    yield window
    window.ask("open_assets(False)")


def drag(window: Window, method: str, name: str) -> dict:
    """Drag an asset into the middle of the view; what the scene has then."""
    window.ask(f"show_assets({method!r})")
    start = find(window, name)
    time.sleep(DOUBLE_CLICK)
    left, top, width, height = window.ask("place('WINDOW')")
    window.carry(start, (left + width // 2, top + height // 2))
    window.wait_for("is_converted()", 10)
    return window.ask("sky_state()")


def find(window: Window, name: str) -> tuple[int, int]:
    """Where the Asset Browser shows an asset: it is clicked down its left column until it is it."""
    left, top, _, height = window.ask("place_of_assets()")
    end = time.monotonic() + SHOWN
    while time.monotonic() < end:
        for y in range(top + TILE[1], top + height, 60):
            window.click(left + TILE[0], y)
            window.settle()
            if window.ask("asset_at_mouse()") == name:
                return left + TILE[0], y
    raise AssertionError(f"The Asset Browser shows no {name}.")


DOUBLE_CLICK = 0.5
"""Seconds after which a second press is a new one."""

LAMPS = 5
"""Of the sunrise by default."""

METHODS = {"by default": "FOLLOW_PREFS", "append": "APPEND", "link": "LINK"}


@pytest.mark.parametrize("name", [WORLD, SUNS])
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS.keys())
def test_one_of_the_two_brings_both(browser: Window, method: str, name: str, quiet: None):
    found = drag(browser, method, name)
    assert found["world"] == WORLD
    assert found["original"] == "World"
    assert len(found["lamps"]) == LAMPS
    assert sorted(found["lamps"]) == sorted(found["known"])
    assert not found["instances"]
    assert found["editable"] == (method != "LINK")


def test_the_panel_restores_what_was_there(browser: Window, quiet: None):
    before = browser.ask("sky_state()")
    drag(browser, "FOLLOW_PREFS", WORLD)
    browser.open_tab()
    browser.press("sunsplit.restore")
    browser.wait_for("not is_converted()")
    assert browser.ask("sky_state()") == before


def test_undo_takes_it_back_and_redo_brings_it(browser: Window, quiet: None):
    before = browser.ask("sky_state()")
    after = drag(browser, "FOLLOW_PREFS", WORLD)
    for _ in range(2):  # the suns, then the world
        browser.key("ctrl+z")
        browser.settle()
    assert browser.ask("sky_state()") == before
    for _ in range(2):
        browser.key("ctrl+shift+z")
        browser.settle()
    assert browser.ask("sky_state()") == after


def test_both_dragged_are_still_one_sky(browser: Window, quiet: None):
    drag(browser, "FOLLOW_PREFS", WORLD)
    found = drag(browser, "FOLLOW_PREFS", SUNS)
    browser.settle()
    found = browser.ask("sky_state()")
    assert len(found["lamps"]) == len(found["known"]) == LAMPS
    assert not found["instances"]
    assert found["original"] == "World"
