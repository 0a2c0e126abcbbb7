from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

from tests.gui.debian import BuildFailed, Debian, Unavailable, debian
from tests.gui.session import session
from tests.gui.window import Window
from tools.build_extension import PYTHONS

ONCE = "5.2"
"""The window's Blender is the same in every environment: its tests run in this one."""

COMPLAINT = re.compile(r"warning|error|exception|traceback", re.IGNORECASE)

HARMLESS = re.compile(r"list of mounted file-systems|EGL_BAD_MATCH")
"""What Blender prints without /proc, and with a display that has no GPU."""


@pytest.fixture(scope="session")
def sid() -> Debian:
    if not bpy.app.version_string.startswith(ONCE):
        pytest.skip(f"the window's Blender is not this one: tested in the environment of {ONCE}")
    try:
        found = debian()
    except Unavailable as reason:
        pytest.skip(str(reason))
    except BuildFailed as reason:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(reason))
    if found.blender not in PYTHONS:
        pytest.skip(f"Debian's Blender is {found.blender} by now: Sunsplit does not support it yet")
    return found


@pytest.fixture(scope="session")
def opened(sid: Debian, sunrise: Path) -> Iterator[Window]:
    with session(sid, sunrise) as window:
        yield window
        window.quit()
        assert not complaints(window.console())


@pytest.fixture(scope="session")
def screenshots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where each test leaves a picture of how it ended; SUNSPLIT_SCREENSHOTS chooses the folder."""
    chosen = os.environ.get("SUNSPLIT_SCREENSHOTS")
    folder = Path(chosen) if chosen else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture
def window(opened: Window, screenshots: Path, request: pytest.FixtureRequest) -> Iterator[Window]:
    """The scene as new, the tab open."""
    opened.ask("open_scene('scene.blend')")
    opened.open_tab()
    yield opened
    opened.picture().save(screenshots / f"{request.node.name}.png")


def complaints(console: str) -> list[str]:
    """What Blender has complained about."""
    lines = console.splitlines()
    return [line for line in lines if COMPLAINT.search(line) and not HARMLESS.search(line)]


@pytest.fixture
def quiet(opened: Window) -> Iterator[None]:
    """The console has no complaint, neither from before this test nor from itself."""
    yield
    assert not complaints(opened.console())
