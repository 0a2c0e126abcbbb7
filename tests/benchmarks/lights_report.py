"""Tables and plots of the benchmark `lights`, and its bars."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from tests.benchmarks.lights import WAYS, Run

BARS = {16: 1.5, 64: 0.33, 256: 0.10}
"""Largest error of discs by edge, percent."""

SECONDS = {64: 0.5, 256: 1.5}
"""Longest time for a map 1024 wide on one core."""

OURS = "edge, discs"


def write(runs: Sequence[Run], folder: Path) -> None:
    """lights.md and its two plots."""
    folder.mkdir(parents=True, exist_ok=True)
    seeds = sorted({run.seed for run in runs})
    first = [run for run in runs if run.seed == seeds[0]]
    text = "\n".join(_page(runs, first, seeds)) + "\n"
    (folder / "lights.md").write_text(text, encoding="utf-8")
    _plot_numbers(first, folder / "lights-number.png")
    _plot_seconds(first, folder / "lights-seconds.png")
    print(folder / "lights.md")


def mean(values: Iterable[float]) -> float:
    """Geometric."""
    return float(np.exp(np.mean(np.log(list(values)))))


def some(runs: Sequence[Run], way: str, lights: int) -> list[Run]:
    return [run for run in runs if (run.way, run.lights) == (way, lights)]


def _page(runs: Sequence[Run], first: Sequence[Run], seeds: Sequence[int]) -> list[str]:
    numbers = sorted({run.lights for run in runs})
    maps = sorted({run.map for run in runs})
    lines = [
        "# The error of N lights, and what it costs to place them",
        "",
        f"{len(maps)} maps, all of whose light becomes lights: {', '.join(maps)}.",
        "Errors of irradiance under occluders in percent of the mean irradiance in the open, "
        "geometric mean over the maps: luminance / worst channel (luminance of the worst map).",
        "",
        *_error_table(first, numbers),
        "",
        "![error against number](lights-number.png)",
        "",
        "The same surfaces without occluders, luminance:",
        "",
        *_open_table(first, numbers),
        "",
        "Seconds of one core, median over the maps, from a map in memory to suns:",
        "",
        *_seconds_table(first, numbers),
        "",
        "![error against seconds](lights-seconds.png)",
        "",
        f"## What discs by edge must reach, with each list of set-ups ({len(seeds)} seeds)",
        "",
        "| bar | must be | " + " | ".join(f"seed {seed}" for seed in seeds) + " |",
        "| --- | --- |" + " --- |" * len(seeds),
    ]
    columns = [_bars([run for run in runs if run.seed == seed], numbers) for seed in seeds]
    for rows in zip(*columns, strict=True):
        lines.append(f"| {rows[0][0]} | {rows[0][1]} | " + " | ".join(r[2] for r in rows) + " |")
    lines += ["", "## Map by map: discs by edge, and the best of all other ways", ""]
    return lines + _map_table(first, numbers)


def _error_table(runs: Sequence[Run], numbers: Sequence[int]) -> list[str]:
    def cell(found: list[Run]) -> str:
        lum, worst = mean(r.luminance for r in found), mean(r.worst_channel for r in found)
        return f"{100 * lum:.3g} / {100 * worst:.3g} ({100 * max(r.luminance for r in found):.3g})"

    return _table(runs, numbers, cell)


def _open_table(runs: Sequence[Run], numbers: Sequence[int]) -> list[str]:
    return _table(runs, numbers, lambda found: f"{100 * mean(r.in_the_open for r in found):.3g}")


def _seconds_table(runs: Sequence[Run], numbers: Sequence[int]) -> list[str]:
    return _table(runs, numbers, lambda found: f"{np.median([r.seconds for r in found]):.2f}")


def _table(runs: Sequence[Run], numbers: Sequence[int], cell) -> list[str]:
    lines = ["| way | " + " | ".join(f"N = {number}" for number in numbers) + " |"]
    lines.append("| --- |" + " --- |" * len(numbers))
    for way in WAYS:
        cells = [cell(some(runs, way.name, number)) for number in numbers]
        lines.append(f"| {way.name} | " + " | ".join(cells) + " |")
    return lines


def _bars(runs: Sequence[Run], numbers: Sequence[int]) -> list[tuple[str, str, str]]:
    """What, its limit, and what was measured."""
    rows = []
    error = {
        (way.name, n): mean(r.luminance for r in some(runs, way.name, n))
        for way in WAYS
        for n in numbers
    }
    for n in numbers:
        ours = some(runs, OURS, n)
        if n in BARS:
            rows.append((f"error, N = {n}", f"{BARS[n]} %", f"{100 * error[OURS, n]:.3g} %"))
        cut = error[OURS, n] / error["median-cut, points", n]
        rows.append((f"against median cut with points, N = {n}", "0.25", f"{cut:.3f}"))
        best = min(
            error[w.name, n] for w in WAYS if w.by_authors and not w.name.startswith("median")
        )
        rows.append(
            (
                f"against the best of the others as their authors have them, N = {n}",
                "0.5",
                f"{error[OURS, n] / best:.3f}",
            )
        )
        colour = mean(r.worst_channel / r.luminance for r in ours)
        rows.append((f"worst channel against luminance, N = {n}", "1.25", f"{colour:.3f}"))
        if n >= 16:
            worst, where = _worst_against_others(runs, n)
            rows.append((f"any other way better by, N = {n}", "1.15", f"{worst:.2f} ({where})"))
        if n in SECONDS:
            seconds = np.median([r.seconds for r in ours])
            rows.append((f"seconds, N = {n}", f"{SECONDS[n]}", f"{seconds:.2f}"))
    for name, chosen in (("discs by edge", [r for r in runs if r.way == OURS]), ("all", runs)):
        both = np.log([[r.luminance, r.predicted] for r in chosen])
        rows.append(
            (
                f"log-correlation of predicted and measured, {name}",
                "0.95",
                f"{np.corrcoef(both.T)[0, 1]:.4f}",
            )
        )
    return rows


def _worst_against_others(runs: Sequence[Run], number: int) -> tuple[float, str]:
    """How much better than discs by edge another way is at most, and on which map."""
    ratios = []
    for ours in some(runs, OURS, number):
        others = [r for r in runs if (r.map, r.lights) == (ours.map, number) and r.way != OURS]
        best = min(others, key=lambda r: r.luminance)
        ratios.append((ours.luminance / best.luminance, f"{best.way} on {ours.map}"))
    return max(ratios)


def _map_table(runs: Sequence[Run], numbers: Sequence[int]) -> list[str]:
    lines = ["| map | " + " | ".join(f"N = {number}" for number in numbers) + " |"]
    lines.append("| --- |" + " --- |" * len(numbers))
    for name in sorted({run.map for run in runs}):
        cells = []
        for number in numbers:
            there = [r for r in runs if (r.map, r.lights) == (name, number)]
            ours = next(r for r in there if r.way == OURS)
            best = min((r for r in there if r.way != OURS), key=lambda r: r.luminance)
            cells.append(f"{100 * ours.luminance:.3g}; {100 * best.luminance:.3g} ({best.way})")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def _styles() -> dict[str, dict]:
    colours = {
        "median-cut": "tab:blue",
        "variance": "tab:green",
        "kmeans": "tab:purple",
        "penrose": "tab:orange",
        "edge": "tab:red",
    }
    looks = {"points": ":", "discs": "-", "points at samples": "--"}
    styles = {}
    for way in WAYS:
        method, kind = way.name.split(", ")
        styles[way.name] = {
            "color": colours[method],
            "linestyle": looks[kind],
            "marker": "o" if kind == "discs" else ".",
            "label": way.name,
        }
    return styles


def _plot_numbers(runs: Sequence[Run], path: Path) -> None:
    numbers = sorted({run.lights for run in runs})
    figure, axes = plt.subplots(figsize=(9, 5))
    for name, style in _styles().items():
        error = [100 * mean(r.luminance for r in some(runs, name, n)) for n in numbers]
        axes.plot(numbers, error, **style)
    axes.set(xscale="log", yscale="log", xlabel="lights", xticks=numbers)
    axes.set_xticklabels(numbers)
    axes.minorticks_off()
    axes.set_ylabel("error under occluders, % of mean irradiance")
    _finish(figure, axes, path)


def _plot_seconds(runs: Sequence[Run], path: Path) -> None:
    numbers = sorted({run.lights for run in runs})
    figure, axes = plt.subplots(figsize=(9, 5))
    points = []
    for name, style in _styles().items():
        seconds = [float(np.median([r.seconds for r in some(runs, name, n)])) for n in numbers]
        error = [100 * mean(r.luminance for r in some(runs, name, n)) for n in numbers]
        axes.plot(seconds, error, **style)
        points += zip(seconds, error, strict=True)
    front, least = [], np.inf
    for seconds, error in sorted(points):
        if error < least:
            front.append((seconds, error))
            least = error
    axes.step(*zip(*front, strict=True), where="post", color="0.6", lw=5, alpha=0.5, zorder=0)
    axes.set(xscale="log", yscale="log", xlabel="seconds to place the lights (one core)")
    axes.set_ylabel("error under occluders, % of mean irradiance")
    axes.set_title("grey: nothing is both faster and truer", fontsize=9)
    _finish(figure, axes, path)


def _finish(figure: plt.Figure, axes: plt.Axes, path: Path) -> None:
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))  # beside all points
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
