"""How long Cycles needs for a picture of a given error: the plain HDRI against the converted scene.

    .venv-5.2/bin/python -m tests.benchmarks.equal_error MAP ... [-o FOLDER] [--scenes ...] ...

For each map and scene: the plain HDRI as Blender sets it up, the plain HDRI with every world
sampling that one might set by hand, and the conversion by default, all interleaved in one run.
Errors are RMS over pixels and channels against a long reference of the plain HDRI, relative to its
mean, the reference's own noise taken off. Time is from the call of render to its end. Time to an
error is interpolated between numbers of samples: noise falls faster than their square root, as
samples know of each other. Peak memory is that of a process that opens the file and renders one
sample a pixel.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from sunsplit.addon.scene import convert_scene
from sunsplit.core.files.maps import load
from sunsplit.core.settings import ConversionSettings
from tests.benchmarks import equal_error_report
from tests.benchmarks.large_maps import Kind, make
from tests.benchmarks.scenes import BRIGHTEST, SCENES
from tests.blender import timed_render

PLAIN, SPLIT = "plain HDRI", "Sunsplit"
BY_HAND = ("NONE", "256", "512", "1024", "2048", "4096")
TARGETS = (0.05, 0.02)

TILES = 8
"""Along a picture's side, whose means are taken as independent of each other."""


@dataclass(frozen=True)
class Curve:
    """What one configuration of a map and scene needs.

    lamps: of the conversion. samples: a pixel, of some pictures, rising. noise: variance of these,
    in squares of the mean. seconds: that they took. bias: RMS that more samples would not take
    away, and unsure, the standard error of its square. mean: of the picture against the
    reference's. memory: MB at the peak.
    """

    map: str
    scene: str
    way: str
    lamps: int
    samples: tuple[int, ...]
    noise: tuple[float, ...]
    seconds: tuple[float, ...]
    bias: float
    unsure: float
    mean: float
    memory: float

    def seconds_to(self, error: float) -> float:
        """Seconds to an RMS error; infinite where bias alone exceeds it, as far as there certainly
        is one."""
        rest = error**2 - max(self.bias**2 - 2 * self.unsure, 0)
        return self._seconds_of(self._samples_to(rest)) if rest > 0 else np.inf

    def _samples_to(self, noise: float) -> float:
        """Samples to this variance: between two pictures its logarithm is straight over that of
        their samples, beyond the last one it falls as these rise."""
        falling = np.minimum.accumulate(self.noise)
        if noise < falling[-1]:
            return self.samples[-1] * falling[-1] / noise
        logs = np.interp(-np.log(noise), -np.log(falling), np.log(self.samples))
        return float(np.exp(logs))

    def _seconds_of(self, samples: float) -> float:
        """Between two pictures straight, beyond the last one as between the last two."""
        if samples <= self.samples[-1] or len(self.samples) == 1:
            return float(np.interp(samples, self.samples, self.seconds))
        each = (self.seconds[-1] - self.seconds[-2]) / (self.samples[-1] - self.samples[-2])
        return self.seconds[-1] + max(each, 0.0) * (samples - self.samples[-1])


def curves_of(path: Path, scene: str, options: argparse.Namespace) -> list[Curve]:
    """All ways of one map and scene."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ways = _prepared(path, scene, options, folder)
        halves = []
        _open(folder, PLAIN)
        for seed in (1001, 1002):
            halves.append(timed_render(bpy.context.scene, folder, options.reference, seed)[0])
        brightest = BRIGHTEST.get(scene, np.inf) * float(np.median(halves))
        halves = [np.minimum(half, brightest) for half in halves]
        shots: dict[str, list[tuple[int, np.ndarray, float]]] = {way: [] for way in ways}
        for repeat in range(options.repeats):
            for samples in options.samples:
                for way in ways:
                    _open(folder, way)
                    image, seconds = timed_render(bpy.context.scene, folder, samples, repeat)
                    shots[way].append((samples, np.minimum(image, brightest), seconds))
        memory = {way: _peak(folder / f"{way}.blend") for way in ways}
    return [
        _curve((path.stem, scene, way, ways[way]), shots[way], halves, memory[way]) for way in ways
    ]


_PEAK = r"""
import re, sys, bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
bpy.context.scene.cycles.samples = 1
bpy.ops.render.render()
print("peak", int(re.search(r"VmHWM:\s+(\d+)", open("/proc/self/status").read())[1]) / 1024)
"""


def _peak(file: Path) -> float:
    """MB that a process has at most in memory while it renders a file, by Linux."""
    done = subprocess.run(
        [sys.executable, "-c", _PEAK, str(file)], capture_output=True, text=True, check=True
    )
    return float(next(x for x in done.stdout.splitlines() if x.startswith("peak")).split()[1])


def enlarged(path: Path, width: int, folder: Path) -> Path:
    """The map, or one so wide, linear between its pixels, in the folder; of a map with pixels that
    are no light one that is repaired, as each way would take another picture from it."""
    known = load(path)
    if width <= known.own_width and not known.repairs.pixels:
        return path
    file = folder / f"{path.stem}.exr"
    make(path, max(width, known.own_width), Kind("exr", "float", "zip"), file, grain=0)
    return file


def _prepared(path: Path, scene: str, options: argparse.Namespace, folder: Path) -> dict[str, int]:
    """Each way as a file in the folder; its lamps."""
    made = SCENES[scene](enlarged(path.resolve(), options.width, folder), options.size)
    ways = {}
    for way in (PLAIN, *options.by_hand):
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
    memory: float,
) -> Curve:
    mean = float(np.mean(halves))
    samples = sorted({count for count, _, _ in shots})
    images = {n: [image for count, image, _ in shots if count == n] for n in samples}
    took = {n: [seconds for count, _, seconds in shots if count == n] for n in samples}
    longest = images[samples[-1]]
    # Products of differences that share neither render nor reference: noise averages out.
    products = [
        (longest[i] - halves[i % 2]) * (longest[j] - halves[j % 2])
        for i in range(len(longest))
        for j in range(i + 1, len(longest))
        if (j - i) % 2
    ]
    square = np.mean(products, axis=0)
    return Curve(
        *name,
        samples=tuple(samples),
        noise=tuple(float(np.var(images[n], axis=0, ddof=1).mean()) / mean**2 for n in samples),
        seconds=tuple(float(np.median(took[n])) for n in samples),
        bias=float(np.sqrt(max(square.mean(), 0))) / mean,
        unsure=standard_error(square) / mean**2,
        mean=float(np.mean(longest)) / mean - 1,
        memory=memory,
    )


def standard_error(pixels: np.ndarray) -> float:
    """Of the mean over pixels that are alike near each other, (height, width, 3)."""
    side = max(len(pixels) // TILES, 1)
    tiles = pixels[: side * TILES, : side * TILES].reshape(TILES, side, TILES, side, 3)
    means = tiles.mean(axis=(1, 3, 4))
    return float(means.std(ddof=1) / np.sqrt(means.size))


def main(arguments: Sequence[str] | None = None) -> list[Curve]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--by-hand", nargs="*", choices=BY_HAND, default=list(BY_HAND))
    parser.add_argument("--width", type=int, default=0, help="enlarge narrower maps to so many")
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, nargs="+", default=[4, 16, 64, 256])
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--reference", type=int, default=2048, help="samples of each of two")
    parser.add_argument("--name", default="equal_error", help="of table and plot")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    curves = []
    for path in options.maps:
        for scene in options.scenes:
            curves += curves_of(path, scene, options)
            equal_error_report.write(curves, options.output, options.name)
            print(path.stem, scene, flush=True)
    return curves


if __name__ == "__main__":
    main()
