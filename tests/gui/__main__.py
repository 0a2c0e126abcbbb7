"""A window to try things in, by hand or from a script.

    .venv-5.2/bin/python -m tests.gui                    a prompt, with `window` at hand
    .venv-5.2/bin/python -m tests.gui SCRIPT             runs a script that has `window`
    .venv-5.2/bin/python -m tests.gui --panel docs/panel.png   README's picture of the panel
    .venv-5.2/bin/python -m tests.gui --window docs/window.png README's picture of the whole window

The extension is built from the clone as it is. `--map FILE.hdr` lights the scene by another map.
At the prompt, or in a script:

    window.press("sunsplit.convert")
    window.wait_for("is_converted()")
    window.ask("[lamp.name for lamp in bpy.data.lights]")     # what inside.py knows
    window.picture().save("seen.png")
"""

from __future__ import annotations

import argparse
import code
import runpy
import time
from pathlib import Path

from PIL import Image

from tests.gui.debian import debian
from tests.gui.session import SUNRISE, session
from tests.gui.window import Window

RENDERED = 60
"""Seconds for the view to be rendered."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("script", nargs="?", type=Path)
    parser.add_argument("--panel", type=Path, metavar="PNG", help="a picture after a conversion")
    parser.add_argument("--window", type=Path, metavar="PNG", help="all of it, seen by Cycles")
    parser.add_argument("--map", type=Path, default=SUNRISE, metavar="HDR")
    chosen = parser.parse_args()
    with session(debian(), chosen.map) as window:
        if chosen.panel:
            save_panel(window, chosen.panel)
        elif chosen.window:
            save_window(window, chosen.window)
        elif chosen.script:
            runpy.run_path(str(chosen.script), {"window": window}, "__main__")
        else:
            banner = f"Blender on display {window.display}; its files: {window.folder}"
            code.interact(banner, local={"window": window})


def save_panel(window: Window, path: Path) -> None:
    """The panel after a conversion, for README."""
    window.press("sunsplit.convert")
    window.wait_for("is_converted()", 300)
    window.unfold("SUNSPLIT_PT_settings")
    window.panel_picture().save(path)


def save_window(window: Window, path: Path) -> None:
    """The window after a conversion, with the suns before the eye, for README."""
    window.press("sunsplit.convert")
    window.wait_for("is_converted()", 300)
    window.ask("face_the_brightest()")
    time.sleep(RENDERED)
    # 128 colours: a quarter of the size, and noise hides the steps.
    window.picture().convert("P", palette=Image.Palette.ADAPTIVE, colors=128).save(path)


if __name__ == "__main__":
    main()
