"""What the overlay costs the processor for each redraw, with many suns.

    .venv-5.2/bin/python -m tests.benchmarks.overlay [MAP.hdr] [--lights 32] [--redraws 200]

In the window of tests/gui. Time of the thread that draws, until all is handed to the graphics card;
there the display is drawn by the processor too, which is not counted.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.window import REDRAW, Result, table
from tests.gui.debian import debian
from tests.gui.session import SUNRISE, session
from tests.gui.window import Window

WAYS = {"perspective": "PERSP", "orthographic": "ORTHO"}


def measure(window: Window, lights: int, redraws: int) -> list[Result]:
    """All figures, from a window with a scene under a map; it shows the 3D view afterwards."""
    convert = f"bpy.ops.sunsplit.convert(lights={lights}, share_auto=False, share=1.0, skips=False)"
    window.ask(f"[*{convert}]", 300)
    window.ask("look_at_sun(0, 0.15)")
    suns = window.ask("len(bpy.context.scene.sunsplit.lamps)")
    results = []
    for way, name in WAYS.items():
        window.ask(f"setattr(view().spaces.active.region_3d, 'view_perspective', {name!r})")
        window.settle()
        results += _both(window, "VIEW_3D", f"3D view, {way}, {suns} suns", redraws)
    window.ask("show_map('sky.hdr')")
    window.settle()
    results += _both(window, "IMAGE_EDITOR", f"Image editor, {suns} suns", redraws)
    window.ask("show_view()")
    return results


def _both(window: Window, kind: str, what: str, redraws: int) -> list[Result]:
    """Of an editor, as if its view moved and as if it stayed."""
    found = []
    for moved, state in ((True, "moved"), (False, "as before")):
        times = window.ask(f"overlay_times({kind!r}, {moved}, {redraws})")
        found.append(Result(f"{what}, {state}", times, REDRAW))
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("map", nargs="?", type=Path, default=SUNRISE, metavar="MAP.hdr")
    parser.add_argument("--lights", type=int, default=32)
    parser.add_argument("--redraws", type=int, default=200)
    chosen = parser.parse_args(arguments)
    with session(debian(), chosen.map) as window:
        results = measure(window, chosen.lights, chosen.redraws)
        print(table(results, window.ask("bpy.app.version_string")))
        for one in results:
            print(f"{one.what}: least {min(one.times):.2f}")


if __name__ == "__main__":
    main()
