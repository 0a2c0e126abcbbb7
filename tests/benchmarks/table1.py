"""The paper's Table 1 measured again: error and time of each method, in headless Cycles.

    .venv-5.2/bin/python -m tests.benchmarks.table1 [MAP] [-o FOLDER] [--size N] [--repeats N] ...

Writes table1.md, table1-error.png, table1-time.png (the paper's Figure 4) and table1-renders.png.
A text below "## What follows" in a table1.md that is there already is kept.

PBRT sends a shadow ray to each light, Cycles one shadow ray to one light that it picks for each
camera ray. So a row gets as many camera rays per pixel as the paper's row has shadow rays.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import bpy
import numpy as np
from tqdm import tqdm

from sunsplit.core.settings import ConversionSettings
from tests.benchmarks import table1_plots, table1_report
from tests.benchmarks.table1_scene import figurine_scene, key_azimuth, surfaces
from tests.blender import timed_render

SAMPLE = Path(__file__).parents[2] / "sample_scenes" / "spruit_sunrise_1k.hdr"

CELLS = 493
"""Samples of the Voronoi map in the paper's Figure 3c."""

REFERENCE_SEEDS = (1001, 1002)

T = TypeVar("T")


@dataclass(frozen=True)
class Row:
    """A method and its samples per pixel; settings: None for the plain HDRI.

    paper: RMS error and seconds in Table 1, None for a row that is not in it.
    """

    method: str
    samples: int
    settings: ConversionSettings | None
    paper: tuple[float, float] | None = None

    def __str__(self) -> str:
        return f"{self.method} {self.samples}"


@dataclass(frozen=True)
class Prepared:
    """A scene in a file, converted or not; sampling: of its world; seconds of its conversion."""

    path: Path
    sampling: str
    lamps: int = 0
    cells: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class Result:
    """What the repeats of a row gave: linear pixels (height, width, 3), and seconds."""

    row: Row
    prepared: Prepared
    images: list[np.ndarray] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Table:
    """All that was measured. halves: two references of half the samples each.

    surface: which pixels are compared, bool (height, width).
    """

    map_name: str
    options: argparse.Namespace
    halves: tuple[np.ndarray, np.ndarray]
    surface: np.ndarray
    results: list[Result]

    @property
    def reference(self) -> np.ndarray:
        return (self.halves[0] + self.halves[1]) / 2

    def mean(self, image: np.ndarray) -> float:
        """Over surface pixels and channels."""
        return float(image[self.surface].mean())

    def relative(self, square: np.ndarray) -> float:
        """Root of the mean of squared differences, relative to the reference's mean."""
        return float(np.sqrt(max(self.mean(square), 0.0)) / self.mean(self.reference))

    def errors(self, result: Result) -> list[float]:
        """RMS error of each repeat."""
        return [self.relative((image - self.reference) ** 2) for image in result.images]

    def error(self, result: Result) -> float:
        """Median of the repeats: one firefly must not decide it."""
        return float(np.median(self.errors(result)))

    def bias(self, result: Result) -> float:
        """The part of the RMS error that more samples would not take away; NaN for one repeat.

        Products of differences that share neither render nor reference: noise averages out.
        """
        n = len(result.images)
        if n < 2:
            return float("nan")
        one, other = (np.stack(result.images) - half for half in self.halves)
        pairs = one.sum(axis=0) * other.sum(axis=0) - (one * other).sum(axis=0)
        return self.relative(pairs / (n * (n - 1)))

    def noise(self, result: Result) -> float:
        """What is left of the error without bias and the reference's own noise."""
        rest = self.error(result) ** 2 - self.bias(result) ** 2 - self.reference_noise() ** 2
        return float(np.sqrt(np.maximum(rest, 0)))

    def reference_noise(self) -> float:
        return self.relative((self.halves[0] - self.halves[1]) ** 2 / 4)

    def brightness(self, result: Result) -> float:
        """Mean of all repeats against the reference's, 0 when equal."""
        return self.mean(np.mean(result.images, axis=0)) / self.mean(self.reference) - 1


def rows(cells: int = CELLS) -> tuple[Row, ...]:
    """Table 1, then the default conversion."""
    paper = ConversionSettings(method="penrose", shape="point", position="sample", fill="black")
    fhis = replace(paper, share=0, residual="voronoi", residual_samples=cells)
    composite = replace(fhis, share=0.5, lights=64)
    # Table 1 has two pairs of such rows and does not say what differs. Section 3 has two ways to
    # treat region B: the Voronoi map M_BV above, and the plain map M_B here.
    with_map = replace(composite, residual="map")
    lights = replace(paper, share=1, residual="none")
    return (
        Row("IS", 64, None, (0.112324, 90.0)),
        Row("IS", 128, None, (0.070817, 173.1)),
        Row("IS", 256, None, (0.049604, 339.5)),
        Row("FHIS", 64, fhis, (0.104842, 73.2)),
        Row("FHIS", 128, fhis, (0.062812, 141.3)),
        Row("FHIS", 256, fhis, (0.043516, 275.3)),
        Row("FHIS + D.L.(OS)", 128, composite, (0.041018, 157.6)),
        Row("FHIS + D.L.(OS)", 192, composite, (0.032888, 224.0)),
        Row("FHIS + D.L.(OS)", 320, composite, (0.028287, 357.8)),
        Row("FHIS + D.L.(OS), M_B", 128, with_map, (0.040586, 156.6)),
        Row("FHIS + D.L.(OS), M_B", 192, with_map, (0.032419, 225.0)),
        Row("D.L.(OS)", 128, replace(lights, lights=128), (0.088624, 173.6)),
        Row("D.L.(OS)", 256, replace(lights, lights=256), (0.036659, 337.6)),
        Row("D.L.(MC)", 256, replace(lights, lights=256, method="median-cut"), (0.0498, 334.2)),
        Row("Sunsplit's default", 64, ConversionSettings()),
        Row("Sunsplit's default", 128, ConversionSettings()),
    )


def measure(path: Path, options: argparse.Namespace, folder: Path) -> Table:
    """All rows, one repeat of all after the other, so that drift of the machine hits all alike."""
    wanted, prepared = rows(options.cells), {}
    azimuth = key_azimuth(path)
    for settings in progress(dict.fromkeys(row.settings for row in wanted), "Converting"):
        scene = figurine_scene(path, options.size, azimuth)
        prepared[settings] = prepare(scene, settings, folder / f"{len(prepared)}.blend")
    results = [Result(row, prepared[row.settings]) for row in wanted]
    scene = opened(prepared[None])
    # The first renders of a process are slow: none of these is timed.
    surface = surfaces(scene, folder)
    half = max(options.reference // 2, 1)
    halves = [
        timed_render(scene, folder, half, seed)[0]
        for seed in progress(REFERENCE_SEEDS, "Reference")
    ]
    todo = [(seed, result) for seed in range(options.repeats) for result in results]
    for seed, result in progress(todo, "Rows"):
        samples = max(result.row.samples // options.scale, 1)
        image, seconds = timed_render(opened(result.prepared), folder, samples, seed)
        result.images.append(image)
        result.seconds.append(seconds)
    return Table(path.stem, options, tuple(halves), surface, results)


def progress(things: Iterable[T], name: str) -> Iterable[T]:
    return tqdm(things, name, unit="", dynamic_ncols=True)


def prepare(scene: bpy.types.Scene, settings: ConversionSettings | None, path: Path) -> Prepared:
    """Convert a scene through the add-on, unless settings are None, and save it."""
    from sunsplit.addon.options import SceneOptions
    from sunsplit.addon.scene import convert_scene

    facts = {}
    if settings is not None:
        started = time.perf_counter()
        conversion = convert_scene(scene, settings, SceneOptions(skips=False)).conversion
        facts = {
            "seconds": time.perf_counter() - started,
            "lamps": len(conversion.suns),
            "cells": len(conversion.samples.sites) if conversion.samples else 0,
        }
    world = scene.world.cycles
    table = world.sample_map_resolution if world.sampling_method == "MANUAL" else ""
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return Prepared(path, f"{world.sampling_method} {table}".strip(), **facts)


def opened(prepared: Prepared) -> bpy.types.Scene:
    bpy.ops.wm.open_mainfile(filepath=str(prepared.path))
    return bpy.context.scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("map", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--size", type=int, default=160, help="pixels (default: %(default)s)")
    parser.add_argument("--reference", type=int, default=4096, help="samples (default: 4096)")
    parser.add_argument("--repeats", type=int, default=3, help="of each row (default: 3)")
    parser.add_argument("--scale", type=int, default=1, help="divide the rows' samples by this")
    parser.add_argument("--cells", type=int, default=CELLS, help="of Voronoi maps (default: 493)")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="sunsplit-") as folder:
        table = measure(options.map.resolve(), options, Path(folder))
    report = table1_report.write(table)
    table1_plots.draw(table)
    print(report)


if __name__ == "__main__":
    main()
