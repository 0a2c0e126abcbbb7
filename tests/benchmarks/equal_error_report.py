"""Table and plot of the benchmark `equal_error`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

if TYPE_CHECKING:
    from tests.benchmarks.equal_error import Curve


@dataclass(frozen=True)
class Row:
    """A map and scene: the plain HDRI, the best by hand for each target, and the conversion.

    seconds: to each target, (3, targets). gain: how many times shorter the conversion takes than
    the first two, (2, targets).
    """

    plain: Curve
    by_hand: tuple[Curve, ...]
    split: Curve
    seconds: np.ndarray
    gain: np.ndarray


def rows_of(curves: Sequence[Curve]) -> list[Row]:
    from tests.benchmarks.equal_error import PLAIN, SPLIT, TARGETS

    found = []
    for pair in dict.fromkeys((c.map, c.scene) for c in curves):
        ways = {c.way: c for c in curves if (c.map, c.scene) == pair}
        plain, split = ways[PLAIN], ways[SPLIT]
        others = [curve for way, curve in ways.items() if way != SPLIT]
        best = tuple(min(others, key=lambda c, e=e: c.seconds_to(e)) for e in TARGETS)
        seconds = np.array(
            [
                [plain.seconds_to(e) for e in TARGETS],
                [curve.seconds_to(e) for curve, e in zip(best, TARGETS, strict=True)],
                [split.seconds_to(e) for e in TARGETS],
            ]
        )
        with np.errstate(invalid="ignore"):  # neither gets there
            found.append(Row(plain, best, split, seconds, seconds[:2] / seconds[2]))
    return found


def write(curves: Sequence[Curve], folder: Path, name: str = "equal_error") -> None:
    """The table and its plot."""
    rows = rows_of(curves)
    lines = [
        "# Time to equal error in Cycles",
        "",
        f"Blender {bpy.app.version_string}. Seconds of the plain HDRI as Blender sets it up, of the"
        " plain HDRI with the best world sampling by hand, and of the converted scene, to an RMS "
        "error of 5 % and of 2 %; how many times shorter the converted scene takes; what more "
        "samples would not take away of its error, give or take; its mean; peak memory.",
        "",
        "| map | scene | lamps | plain 5 / 2 % | by hand 5 / 2 % | converted 5 / 2 % "
        "| against plain | against by hand | bias RMS | mean | MB plain / converted |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        *(_line(row) for row in rows),
        "",
        "Geometric means:",
        "",
        "| scene | maps | against plain | against by hand |",
        "| --- | --- | --- | --- |",
        *_means(rows),
        "",
        f"![seconds to 5 %]({name}.png)",
    ]
    (folder / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    _plot(rows, folder / f"{name}.png")


def _line(row: Row) -> str:
    best = ", ".join(dict.fromkeys(curve.way for curve in row.by_hand))
    split = row.split
    plain, by_hand, own = (_two(seconds) for seconds in row.seconds)
    return (
        f"| {split.map} | {split.scene} | {split.lamps} | {plain} | {by_hand} ({best}) | {own} "
        f"| {_two(row.gain[0])} | {_two(row.gain[1])} "
        f"| {split.bias:.2%} ± {np.sqrt(split.unsure):.2%} | {split.mean:+.2%} "
        f"| {row.plain.memory:.0f} / {split.memory:.0f} |"
    )


def _means(rows: Sequence[Row]) -> list[str]:
    lines = []
    for scene in dict.fromkeys(row.split.scene for row in rows):
        gains = [row.gain for row in rows if row.split.scene == scene]
        with np.errstate(divide="ignore", invalid="ignore"):  # an error that is never reached
            mean = np.exp(np.mean(np.log(gains), axis=0))
        lines.append(f"| {scene} | {len(gains)} | {_two(mean[0])} | {_two(mean[1])} |")
    return lines


def _plot(rows: Sequence[Row], path: Path) -> None:
    """Seconds to the first target, map by map."""
    figure, axes = plt.subplots(figsize=(8, 1.2 + 0.34 * len(rows)), layout="constrained")
    places = np.arange(len(rows))[::-1]
    names = ("plain HDRI, Blender's defaults", "plain HDRI, best by hand", "Sunsplit")
    for k, (name, colour) in enumerate(zip(names, ("#999999", "#5588bb", "#ee8833"), strict=True)):
        seconds = [row.seconds[k, 0] for row in rows]
        axes.plot(seconds, places, "o", color=colour, label=name)
    for row, place in zip(rows, places, strict=True):
        axes.plot(row.seconds[[0, 2], 0], [place] * 2, color="#cccccc", zorder=0)
    axes.set_ylim(-0.5, len(rows) - 0.5)
    axes.set_yticks(places, [f"{row.split.map}, {row.split.scene}" for row in rows])
    if any(np.isfinite(row.seconds[:, 0]).any() for row in rows):
        axes.set_xscale("log")  # where some error is ever reached
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 300 * low else (1,)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("seconds to an error of 5 %")
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _two(values: Sequence[float]) -> str:
    return " / ".join(f"{value:.3g}" for value in values)
