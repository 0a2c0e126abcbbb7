"""Table of the benchmark `equal_error`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

if TYPE_CHECKING:
    from tests.benchmarks.equal_error import Curve


def write(curves: Sequence[Curve], folder: Path) -> None:
    """equal_error.md."""
    from tests.benchmarks.equal_error import PLAIN, SPLIT, TARGETS

    pairs = list(dict.fromkeys((c.map, c.scene) for c in curves))
    lines = [
        "# Time to equal error in Cycles",
        "",
        f"Blender {bpy.app.version_string}. Seconds of the plain HDRI as Blender sets it up, of the"
        " plain HDRI with the best world sampling by hand, and of the converted scene, to an RMS "
        "error of 5 % and of 2 %; how many times shorter the converted scene takes; what more "
        "samples would not take away of its error.",
        "",
        "| map | scene | lamps | plain 5 / 2 % | by hand 5 / 2 % | converted 5 / 2 % "
        "| against plain | against by hand | bias RMS | mean |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    gains = []
    for name, scene in pairs:
        of_pair = {c.way: c for c in curves if (c.map, c.scene) == (name, scene)}
        split = of_pair[SPLIT]
        plain = [of_pair[PLAIN].seconds_to(error) for error in TARGETS]
        hand = [
            min(c.seconds_to(error) for way, c in of_pair.items() if way != SPLIT)
            for error in TARGETS
        ]
        own = [split.seconds_to(error) for error in TARGETS]
        with np.errstate(invalid="ignore"):  # neither gets there
            gain = np.array([plain, hand]) / own
        gains.append(gain)
        best = [
            min((w for w in of_pair if w != SPLIT), key=lambda w, e=e: of_pair[w].seconds_to(e))
            for e in TARGETS
        ]
        lines.append(
            f"| {name} | {scene} | {split.lamps} | {_two(plain)} | {_two(hand)} "
            f"({', '.join(dict.fromkeys(best))}) | {_two(own)} | {_two(gain[0])} | {_two(gain[1])} "
            f"| {split.bias:.2%} | {split.mean:+.2%} |"
        )
    lines += ["", "Geometric means:", "", "| scene | against plain | against by hand |"]
    lines.append("| --- | --- | --- |")
    for scene in dict.fromkeys(pair[1] for pair in pairs):
        mine = [g for g, pair in zip(gains, pairs, strict=True) if pair[1] == scene]
        with np.errstate(divide="ignore", invalid="ignore"):  # an error that is never reached
            mean = np.exp(np.mean(np.log(mine), axis=0))
        lines.append(f"| {scene} | {_two(mean[0])} | {_two(mean[1])} |")
    (folder / "equal_error.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _two(values: Sequence[float]) -> str:
    return " / ".join(f"{value:.3g}" for value in values)
