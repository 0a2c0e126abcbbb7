"""Do two passes pay? Noise and time of lamps and residual together, each alone, and as two passes.

    .venv-5.2/bin/python -m tests.benchmarks.two_passes MAP ... [-o FOLDER] [--scenes ...] ...

Maps must have a sun at least. Variances are of a sample a pixel, in squares of the picture's mean;
costs of a sample in those of one pass; both beside what `core/passes.py` takes them for. Seconds
are the processor's, which other work on the machine does not change much.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from sunsplit.addon.options import SceneOptions
from sunsplit.addon.scene import convert_scene
from sunsplit.addon.world import black_world
from sunsplit.core.passes import PassPart, parts_of
from sunsplit.core.settings import ConversionSettings
from tests.benchmarks.scenes import SCENES
from tests.blender import render


@dataclass(frozen=True)
class Way:
    """samples: of each view layer. variance: of the picture as rendered, in squares of the mean of
    what it shows. mean: of that. start, seconds: before the first sample, and for all of them."""

    samples: tuple[int, ...]
    variance: float
    mean: float
    start: float
    seconds: float


@dataclass(frozen=True)
class Result:
    """suns, sky: one part of the picture alone, with as many samples as the one pass."""

    map: str
    scene: str
    lamps: int
    predicted: tuple[PassPart, PassPart]
    one: Way
    suns: Way
    sky: Way
    two: Way

    def variance(self, part: Way) -> float:
        """Of a sample, in squares of the mean of the whole picture."""
        return part.samples[0] * part.variance * (part.mean / self.one.mean) ** 2

    @property
    def cost(self) -> float:
        """Time to equal noise of two passes, that of one being 1; what renders take before their
        first sample aside."""
        return self.two.variance * self.two.seconds / (self.one.variance * self.one.seconds)


def measure(path: Path, scene: str, options: argparse.Namespace) -> Result:
    made = SCENES[scene](path.resolve(), options.size)
    made.cycles.samples = options.samples
    conversion = convert_scene(made, ConversionSettings()).conversion
    predicted = parts_of(conversion, by_strength=made.cycles.use_light_tree)
    one = _way(made, options)
    world, made.world = made.world, black_world()
    suns = _way(made, options)
    made.world = world
    made.sunsplit.collection.hide_render = True
    sky = _way(made, options)
    made.sunsplit.collection.hide_render = False
    convert_scene(made, ConversionSettings(), SceneOptions(two_passes=True))
    two = _way(made, options)
    return Result(path.stem, scene, len(conversion.suns), predicted, one, suns, sky, two)


def _way(scene: bpy.types.Scene, options: argparse.Namespace) -> Way:
    """Renders of a scene as it is, and some with a quarter of the samples."""
    counts = [layer.samples or options.samples for layer in scene.view_layers]
    shots: dict[int, tuple[list[np.ndarray], list[float]]] = {4: ([], []), 1: ([], [])}
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.repeats):
            for part, (images, seconds) in shots.items():
                for layer, count in zip(scene.view_layers, counts, strict=True):
                    layer.samples = max(count // part, 1)
                before = time.process_time()
                images.append(render(scene, Path(name), options.samples, seed))
                seconds.append(time.process_time() - before)
    quarter, whole = (float(np.median(seconds)) for _, seconds in shots.values())
    images, mean = shots[1][0], float(np.mean(shots[1][0]))
    fewer = sum(count // 4 for count in counts)
    start = max(quarter - (whole - quarter) * fewer / (sum(counts) - fewer), 0.0)
    variance = float(np.var(images, axis=0, ddof=1).mean()) / mean**2
    return Way(tuple(counts), variance, mean, start, whole - start)


def table(results: Sequence[Result]) -> str:
    lines = [
        "# Two passes",
        "",
        f"Blender {bpy.app.version_string}. Variance of a sample of each part, predicted and "
        "measured; cost of a sample of each, taken for and measured, in those of one pass; samples "
        "of suns and sky; time to equal noise of two passes, that of one being 1; seconds before "
        "the first sample of one pass and of two.",
        "",
        "| map | scene | lamps | variance of suns | of sky | cost of suns | of sky | samples "
        "| time to equal noise | start |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in results:
        parts = list(zip(r.predicted, (r.suns, r.sky), strict=True))
        sky, suns = r.two.samples
        cells = [
            *(r.map, r.scene, r.lamps),
            *(f"{told.variance:.2f} / {r.variance(found):.2f}" for told, found in parts),
            *(f"{told.cost:.2f} / {found.seconds / r.one.seconds:.2f}" for told, found in parts),
            f"{r.one.samples[0]} / {suns} + {sky}",
            f"{r.cost:.2f}",
            f"{r.one.start:.2f} / {r.two.start:.2f}",
        ]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=["outdoor", "product"])
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=6)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = []
    for path in options.maps:
        for scene in options.scenes:
            results.append(measure(path, scene, options))
            (options.output / "two_passes.md").write_text(table(results), encoding="utf-8")
    return results


if __name__ == "__main__":
    main()
