"""Should Cycles choose among suns by its light tree, or draw lots? Cost to equal noise of both.

    .venv-5.2/bin/python -m tests.benchmarks.light_tree MAP ... [-o FOLDER] [--tolerances 1 0.5]

The tree chooses by strength and takes time for each lamp; lots take no time, and are noisy where
lamps are unlike. A cost of 1 is that of the tree; "chosen" is what the program sets.
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
from tests.benchmarks.scenes import BRIGHTEST, SCENES
from tests.blender import timed_render


@dataclass(frozen=True)
class Result:
    """noise, seconds: with the tree, and by lot. tree: what was chosen."""

    map: str
    scene: str
    lamps: int
    tree: bool
    noise: tuple[float, float]
    seconds: tuple[float, float]

    @property
    def cost_by_lot(self) -> float:
        """Time to equal noise against the tree's."""
        return (self.noise[1] / self.noise[0]) ** 2 * self.seconds[1] / self.seconds[0]


def measure(path: Path, scene: str, tolerance: float, options: argparse.Namespace) -> Result:
    """Both ways for one map, scene and number of lamps, interleaved."""
    made = SCENES[scene](path.resolve(), options.size)
    made.cycles.use_light_tree = True
    conversion = convert_scene(made, ConversionSettings(tolerance=tolerance)).conversion
    chosen = made.cycles.use_light_tree
    images: tuple[list[np.ndarray], list[np.ndarray]] = [], []
    seconds: tuple[list[float], list[float]] = [], []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.repeats):
            for way, tree in enumerate((True, False)):
                made.cycles.use_light_tree = tree
                image, took = timed_render(made, Path(name), options.samples, seed)
                images[way].append(image)
                seconds[way].append(took)
    brightest = BRIGHTEST.get(scene, np.inf) * float(np.median(images))
    images = tuple([np.minimum(image, brightest) for image in one] for one in images)
    noise = [float(np.sqrt(np.var(one, axis=0, ddof=1).mean()) / np.mean(one)) for one in images]
    median = [float(np.median(one)) for one in seconds]
    lamps = len(conversion.suns)
    return Result(path.stem, scene, lamps, chosen, (noise[0], noise[1]), (median[0], median[1]))


def table(results: Sequence[Result]) -> str:
    lines = [
        "# Light tree or lots",
        "",
        f"Blender {bpy.app.version_string}. Noise / seconds with Cycles' light tree and without, "
        "and the cost without to equal noise, the tree's being 1.",
        "",
        "| map | scene | lamps | light tree | by lot | cost by lot | chosen |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {r.map} | {r.scene} | {r.lamps} | {r.noise[0]:.4f} / {r.seconds[0]:.2f} "
        f"| {r.noise[1]:.4f} / {r.seconds[1]:.2f} | {r.cost_by_lot:.2f} "
        f"| {'light tree' if r.tree else 'lots'} |"
        for r in results
    ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=["outdoor", "glossy"])
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1.0, 0.5])
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=4)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = []
    for path in options.maps:
        for scene in options.scenes:
            for tolerance in options.tolerances:
                results.append(measure(path, scene, tolerance, options))
        (options.output / "light_tree.md").write_text(table(results), encoding="utf-8")
    return results


if __name__ == "__main__":
    main()
