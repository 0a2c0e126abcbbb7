"""What Sunsplit costs a Blender's window: a redraw of the panel, a start, a conversion.

    .venv-5.2/bin/python -m tests.benchmarks.window [MAP.hdr ...] [-o FOLDER] [--widths 4096] ...

In the window of tests/gui, whose display is drawn by the processor: a redraw of all the window is
slow there, so the gaps are printed beside those of orbiting the view, where Sunsplit has no part,
and beside the longest time that Sunsplit itself has kept the window.
A gap is the longest time in which a timer of 20 ms did not run: for so long the window was dead.
The gap of the first conversion in a window has no bar: no Python runs in it, Blender draws.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from tests.benchmarks.large_maps import Kind, make
from tests.gui.debian import debian
from tests.gui.session import SUNRISE, session
from tests.gui.window import Window

REDRAW, REGISTER, GAP = 1, 50, 100
"""What is to be reached, in milliseconds."""

CALLS = "the longest of its calls to Sunsplit"


@dataclass(frozen=True)
class Result:
    """Milliseconds, once for each repeat. bar: what the median should stay below."""

    what: str
    times: Sequence[float]
    bar: float | None = None


def measure(window: Window, maps: Sequence[Path], redraws: int, repeats: int) -> list[Result]:
    """All figures, from a window with the scene open; it is left with the scene as new."""
    results = [Result("panel, a redraw", redrawn(window, redraws), REDRAW)]
    window.ask("longest_call()")
    (first,) = gaps(window, lambda: press_and_wait(window), 1)
    results.append(Result("gap, the window's first conversion", [first]))
    results.append(Result(CALLS, [window.ask("longest_call()")], GAP))
    results.append(Result("panel, a redraw after converting", redrawn(window, redraws), REDRAW))
    window.ask("open_scene('scene.blend')")
    starts = [window.ask("timed_start()") for _ in range(repeats)]
    results.append(Result("import and register", starts, REGISTER))
    results.append(Result("gap, nothing done", gaps(window, lambda: time.sleep(1), repeats)))
    results.append(Result("gap, orbiting the view", gaps(window, lambda: orbit(window), repeats)))
    for path in maps:
        shutil.copy2(path, window.folder / path.name)
        found = [conversion_gap(window, path.name) for _ in range(repeats)]
        spans, calls = zip(*found, strict=True)
        results.append(Result(f"gap, converting {path.name}", spans, GAP))
        results.append(Result(CALLS, calls, GAP))
    window.ask("open_scene('scene.blend')")
    return results


def redrawn(window: Window, redraws: int) -> list[float]:
    """What all panels of the tab take in each of so many redraws."""
    window.ask("redraw()")
    found: list[float] = []
    while len(found) < redraws:
        if drawn := window.ask("redraw()"):  # else the redraw is still to come
            found.append(sum(drawn.values()))
    return found


def widened(maps: Sequence[Path], widths: Sequence[int], folder: Path) -> list[Path]:
    """The maps, linear between their pixels, in each of the widths."""
    made = []
    for path in maps:
        for width in widths:
            made.append(folder / f"{path.stem}_{width}.exr")
            make(path, width, Kind("exr", "float", "zip"), made[-1], grain=0)
    return made


def press_and_wait(window: Window) -> None:
    window.press("sunsplit.convert")
    window.wait_for("is_converted()", 600)


def gaps(window: Window, work: Callable[[], object], repeats: int) -> list[float]:
    """The longest gap of each repeat."""
    found = []
    for _ in range(repeats):
        window.settle()
        started = time.monotonic()
        work()
        window.settle()
        found.append(1e3 * window.longest_gap(started, time.monotonic()))
    return found


def orbit(window: Window) -> None:
    left, top, width, height = window.ask("place('WINDOW')")
    window.move(left + width // 2, top + height // 2)
    window.drag(2, 200, 40)


def conversion_gap(window: Window, name: str) -> tuple[float, float]:
    """The longest gap from the click to the scene with its lamps, drawn, and the longest time that
    Sunsplit has kept the window for itself in it."""
    window.ask("open_scene('scene.blend')")
    window.ask(f"[light_by({name!r}), forget()]")
    x, y = window.find("sunsplit.convert")
    window.settle()
    window.ask("longest_call()")
    (gap,) = gaps(window, lambda: (window.click(x, y), window.wait_for("is_converted()", 600)), 1)
    return gap, window.ask("longest_call()")


def table(results: Sequence[Result], version: str) -> str:
    lines = [
        "# What Sunsplit costs a Blender's window",
        "",
        f"Blender {version} from Debian, in a display without a GPU. Milliseconds.",
        "",
        "| what | median | largest | to be below |",
        "| --- | --- | --- | --- |",
    ]
    for one in results:
        bar = "" if one.bar is None else f"{one.bar:g}"
        lines.append(f"| {one.what} | {median(one.times):.3g} | {max(one.times):.3g} | {bar} |")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("maps", nargs="*", type=Path, default=[SUNRISE], metavar="MAP.hdr")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"), metavar="FOLDER")
    parser.add_argument("--widths", nargs="*", type=int, default=[], help="also as wide as this")
    parser.add_argument("--redraws", type=int, default=100)
    parser.add_argument("--repeats", type=int, default=5)
    chosen = parser.parse_args(arguments)
    with session(debian()) as window, tempfile.TemporaryDirectory() as folder:
        maps = [*chosen.maps, *widened(chosen.maps, chosen.widths, Path(folder))]
        results = measure(window, maps, chosen.redraws, chosen.repeats)
        text = table(results, window.ask("bpy.app.version_string"))
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "window.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
