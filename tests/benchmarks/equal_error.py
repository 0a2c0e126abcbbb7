"""How long Cycles needs for a picture of a given error: the plain HDRI against the converted scene.

    .venv-5.2/bin/python -m tests.benchmarks.equal_error MAP ... [-o FOLDER] [--scenes ...] ...

For each map and scene: the plain HDRI as Blender sets it up, the plain HDRI with every world
sampling that one might set by hand, and the conversion by default, all interleaved in one run.
Errors are RMS over pixels and channels against a long reference of the plain HDRI, relative to its
mean, the reference's own noise taken off. Time is from the call of render to its end. Time to an
error is read off a fit of noise^2 = a / samples and seconds = b + c * samples.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from sunsplit.addon.scene import convert_scene
from sunsplit.core.settings import ConversionSettings
from tests.benchmarks import equal_error_report
from tests.benchmarks.scenes import SCENES
from tests.blender import timed_render

PLAIN, SPLIT = "plain HDRI", "Sunsplit"
BY_HAND = ("NONE", "256", "512", "1024", "2048", "4096")
TARGETS = (0.05, 0.02)


@dataclass(frozen=True)
class Curve:
    """What one configuration of a map and scene needs.

    lamps: of the conversion. noise: variance of one sample a pixel, in squares of the mean.
    bias: RMS that more samples would not take away. mean: of the picture against the reference's.
    start, each: seconds before the first sample and for each sample a pixel.
    """

    map: str
    scene: str
    way: str
    lamps: int
    noise: float
    bias: float
    mean: float
    start: float
    each: float

    def seconds_to(self, error: float) -> float:
        """Seconds to an RMS error, one sample at least; infinite where bias alone exceeds it."""
        rest = error**2 - self.bias**2
        if rest <= 0:
            return np.inf
        return self.start + self.each * max(self.noise / rest, 1.0)


def curves_of(path: Path, scene: str, options: argparse.Namespace) -> list[Curve]:
    """All ways of one map and scene."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ways = _prepared(path, scene, options, folder)
        halves = []
        _open(folder, PLAIN)
        for seed in (1001, 1002):
            halves.append(timed_render(bpy.context.scene, folder, options.reference, seed)[0])
        shots: dict[str, list[tuple[int, np.ndarray, float]]] = {way: [] for way in ways}
        for repeat in range(options.repeats):
            for samples in options.samples:
                for way in ways:
                    _open(folder, way)
                    found = timed_render(bpy.context.scene, folder, samples, repeat)
                    shots[way].append((samples, *found))
    return [_curve((path.stem, scene, way, ways[way]), shots[way], halves) for way in ways]


def _prepared(path: Path, scene: str, options: argparse.Namespace, folder: Path) -> dict[str, int]:
    """Each way as a file in the folder; its lamps."""
    made = SCENES[scene](path.resolve(), options.size)
    ways = {}
    for way in (PLAIN, *BY_HAND):
        if way != PLAIN:
            world = made.world.cycles
            world.sampling_method = "MANUAL" if way.isdecimal() else way
            if way.isdecimal():
                world.sample_map_resolution = int(way)
        _save(folder, way)
        ways[way] = 0
    made.world.cycles.sampling_method = "AUTOMATIC"
    suns = convert_scene(made, ConversionSettings()).conversion.suns
    _save(folder, SPLIT)
    return ways | {SPLIT: len(suns)}


def _save(folder: Path, way: str) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{way}.blend"), copy=True)


def _open(folder: Path, way: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(folder / f"{way}.blend"))


def _curve(
    name: tuple[str, str, str, int],
    shots: list[tuple[int, np.ndarray, float]],
    halves: list[np.ndarray],
) -> Curve:
    mean = float(np.mean(halves))
    noises = []
    for samples in sorted({one[0] for one in shots}):
        images = [image for count, image, _ in shots if count == samples]
        noises.append(samples * np.var(images, axis=0, ddof=1).mean() / mean**2)
    most = max(one[0] for one in shots)
    longest = [image for count, image, _ in shots if count == most]
    # Products of differences that share neither render nor reference: noise averages out.
    products = [
        ((longest[i] - halves[i % 2]) * (longest[j] - halves[j % 2])).mean()
        for i in range(len(longest))
        for j in range(i + 1, len(longest))
        if (j - i) % 2
    ]
    each, start = np.polyfit(
        *zip(*[(count, _median(shots, count)) for count in {one[0] for one in shots}], strict=True),
        1,
    )
    return Curve(
        *name,
        noise=float(np.median(noises)),
        bias=float(np.sqrt(max(np.mean(products), 0))) / mean,
        mean=float(np.mean(longest)) / mean - 1,
        start=max(float(start), 0.0),
        each=float(each),
    )


def _median(shots: list[tuple[int, np.ndarray, float]], samples: int) -> float:
    return float(np.median([seconds for count, _, seconds in shots if count == samples]))


def main(arguments: Sequence[str] | None = None) -> list[Curve]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, nargs="+", default=[4, 16, 64])
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--reference", type=int, default=2048, help="samples of each of two")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    curves = []
    for path in options.maps:
        for scene in options.scenes:
            curves += curves_of(path, scene, options)
            equal_error_report.write(curves, options.output)
            print(path.stem, scene, flush=True)
    return curves


if __name__ == "__main__":
    main()
