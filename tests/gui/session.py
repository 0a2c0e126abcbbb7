"""A window with the extension installed and a scene to convert."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.gui.debian import Debian
from tests.gui.window import Window, open_window
from tools.build_extension import ROOT

SUNRISE = ROOT / "sample_scenes" / "spruit_sunrise_1k.hdr"


def build_zip(debian: Debian, folder: Path) -> Path:
    """The zip for that Blender, in an empty folder."""
    command = [sys.executable, str(ROOT / "tools" / "build_extension.py")]
    command += ["--blender", debian.blender, "--python", debian.python, "--platform", "host"]
    done = subprocess.run(
        [*command, "-o", str(folder)], check=False, capture_output=True, text=True, timeout=600
    )
    if done.returncode != 0:
        raise AssertionError(f"No zip for the window's Blender:\n{done.stdout}{done.stderr}")
    (made,) = folder.iterdir()
    return made


@contextmanager
def session(debian: Debian, sky: Path = SUNRISE) -> Iterator[Window]:
    """A window as a user has it before the first click: the zip installed, the tab open."""
    with tempfile.TemporaryDirectory(prefix="sunsplit-") as folder:
        package = build_zip(debian, Path(folder))
        with open_window(debian, sky) as window:
            window.install(package)
            window.ask("new_scene()")
            window.open_tab()
            yield window
