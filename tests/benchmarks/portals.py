"""Do portals pay in a room? Cost to equal noise of conversions with them and without.

    .venv-5.2/bin/python -m tests.benchmarks.portals MAP ... [-o FOLDER]

For each map the room with a window: the plain HDRI as Blender sets it up, the conversion that is
made for portals, with them, and the one for a path tracer that knows of none; "predicted" is the
mean square of what a sample finds without portals, that with them being 1.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import bpy
import numpy as np

from sunsplit.addon import fitted
from sunsplit.addon.scene import convert_scene
from sunsplit.core.conversion import Conversion
from sunsplit.core.portal_noise import (
    LightInside,
    mean_square_told,
    mean_square_untold,
    openings_pay,
)
from sunsplit.core.settings import ConversionSettings
from tests.benchmarks.equal_error import standard_error
from tests.benchmarks.scenes import room
from tests.blender import timed_render

PLAIN, WITHOUT, WITH = "plain", "without", "with"
WAYS = (PLAIN, WITHOUT, WITH)

FEW = 4
"""Samples of a picture that is mostly what comes before the first."""

TARGET = 0.05
"""The error that times are told to."""


@dataclass(frozen=True)
class Result:
    """variance: of a sample, in squares of the mean, seconds of it, and those before the first, of
    each way. lamps: without portals and with them. predicted: see above. chosen: what the program
    makes; bias: RMS by which its picture stays wrong, against its mean, unsure: the standard error
    of its square, predicted_bias: what the conversion says."""

    map: str
    lamps: tuple[int, int]
    variance: tuple[float, float, float]
    each: tuple[float, float, float]
    start: tuple[float, float, float]
    predicted: float
    chosen: str
    bias: float
    unsure: float
    predicted_bias: float

    def cost(self, way: str) -> float:
        k = WAYS.index(way)
        return self.variance[k] * self.each[k]

    def seconds_to(self, error: float, way: str) -> float:
        """All told: what no number of samples takes away leaves less for their noise."""
        k, rest = WAYS.index(way), error**2 - (0.0 if way == PLAIN else self.bias**2)
        return self.start[k] + self.cost(way) / rest if rest > 0 else np.inf


def measure(path: Path, options: argparse.Namespace) -> Result:
    """All ways for one map, interleaved."""
    seen: list[tuple[LightInside, LightInside, bool]] = []
    with tempfile.TemporaryDirectory() as name:
        folder, made_of = Path(name), []
        for way in WAYS:
            made = room(path.resolve(), options.size)
            if way != PLAIN:
                made_of.append(_convert(made, way == WITH, seen))
            _save(folder, way)
        shots: dict[str, list[tuple[np.ndarray, float, float]]] = {way: [] for way in WAYS}
        for seed in range(options.repeats):
            for way in WAYS:
                bpy.ops.wm.open_mainfile(filepath=str(folder / f"{way}.blend"))
                image, long = timed_render(bpy.context.scene, folder, options.samples, seed)
                _, short = timed_render(bpy.context.scene, folder, FEW, seed)
                shots[way].append((image, long, short))
        told, untold, has_table = seen[-1] if seen else (None, None, False)
        chosen = WITH if seen and openings_pay(told, untold, has_table) else WITHOUT
        bias, unsure = _bias(folder, chosen, options.reference)
    mean = np.mean([image for way in WAYS for image, *_ in shots[way]])
    return Result(
        path.stem,
        (len(made_of[0].suns), len(made_of[1].suns)),
        *zip(*(_noise_and_time(shots[way], mean, options.samples) for way in WAYS), strict=True),
        mean_square_untold(untold, has_table) / mean_square_told(told) if seen else np.nan,
        chosen,
        bias,
        unsure,
        made_of[chosen == WITH].predicted_error,
    )


def _bias(folder: Path, way: str, samples: int) -> tuple[float, float]:
    """Root mean square of what two pictures of a way have in common that two of the plain HDRI have
    not, against the mean; and the standard error of its square."""
    apart, means = [], []
    for seed in (1001, 1002):
        images = []
        for one in (PLAIN, way):
            bpy.ops.wm.open_mainfile(filepath=str(folder / f"{one}.blend"))
            images.append(timed_render(bpy.context.scene, folder, samples, seed)[0])
        apart.append(images[1] - images[0])
        means.append(images[0].mean())
    square = apart[0] * apart[1] / np.mean(means) ** 2
    return float(np.sqrt(max(square.mean(), 0))), standard_error(square)


def _convert(made: bpy.types.Scene, portals: bool, seen: list) -> Conversion:
    """Convert a scene with portals or without, whatever the program would choose."""

    def choose(*asked: object) -> bool:
        seen.append(asked)
        return portals

    with mock.patch.object(fitted, "openings_pay", choose):
        return convert_scene(made, ConversionSettings()).conversion


def _save(folder: Path, way: str) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{way}.blend"), copy=True)


def _noise_and_time(
    shots: Sequence[tuple[np.ndarray, float, float]], mean: float, samples: int
) -> tuple[float, float, float]:
    images, long, short = zip(*shots, strict=True)
    variance = np.var(images, axis=0, ddof=1).mean()
    each = max(float(np.median(long) - np.median(short)) / (samples - FEW), 1e-6)
    start = max(float(np.median(short)) - FEW * each, 0.0)
    return float(samples * variance / mean**2), each, start


def table(results: Sequence[Result]) -> str:
    lines = [
        "# Portals",
        "",
        f"Blender {bpy.app.version_string}, a room with a window. Variance of a sample in squares "
        "of the mean / milliseconds of a sample: the plain HDRI, a conversion without portals, one "
        "with them; noise without, its square with them being 1, as predicted and as measured; "
        "cost to equal noise without, that with them being 1; how many times sooner than the plain "
        "HDRI the chosen one is at an error of 5 %, all told; RMS by which it stays wrong, as "
        "predicted and as measured, give or take.",
        "",
        "| map | lamps without / with | plain | without | with | predicted | measured | cost "
        "| chosen | to 5 % | stays wrong |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in results:
        ways = " | ".join(
            f"{variance:.3g} / {1000 * each:.1f}"
            for variance, each in zip(r.variance, r.each, strict=True)
        )
        lines.append(
            f"| {r.map} | {r.lamps[0]} / {r.lamps[1]} | {ways} | {r.predicted:.2f} "
            f"| {r.variance[1] / r.variance[2]:.2f} | {r.cost(WITHOUT) / r.cost(WITH):.2f} "
            f"| {r.chosen} | {_gain(r):.2f} "
            f"| {r.predicted_bias:.1%} / {r.bias:.1%} ± {np.sqrt(r.unsure):.1%} |"
        )
    gains = [np.log(_gain(r)) for r in results if _gain(r) > 0]
    mean = np.exp(np.mean(gains)) if gains else 0.0
    reached = f"where it is reached, under {len(gains)} of {len(results)} maps"
    lines += ["", f"Geometric mean of times to 5 %, {reached}: {mean:.2f}"]
    return "\n".join(lines) + "\n"


def _gain(result: Result) -> float:
    return result.seconds_to(TARGET, PLAIN) / result.seconds_to(TARGET, result.chosen)


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--size", type=int, default=48)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--reference", type=int, default=1024, help="samples that tell the bias")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = []
    for path in options.maps:
        results.append(measure(path, options))
        (options.output / "portals.md").write_text(table(results), encoding="utf-8")
        print(path.stem, flush=True)
    return results


if __name__ == "__main__":
    main()
