"""How much of the map should become suns, and how should Cycles sample the rest?

    .venv-5.2/bin/python -m tests.benchmarks.region_a [MAP ...] [--width N] [--seeds N] [-o FOLDER]

For each map the plain HDRI, then splits at the border that the program chooses and at some times
that luminance, with several world samplings, all interleaved in one run. Noise is the RMS over
seeds relative to the picture's mean; a cost of 1 is the time to equal noise of the plain HDRI as
Blender sets it up: (noise / noise_plain)^2 x time / time_plain. Below 1 is better.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from sunsplit.addon.images import read_image
from sunsplit.addon.options import SceneOptions
from sunsplit.addon.scene import convert_scene
from sunsplit.addon.steps import run_at_once
from sunsplit.addon.world import find_light
from sunsplit.core.environment import luminance
from sunsplit.core.noise import borders
from sunsplit.core.sampling import contrast
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.sphere import row_solid_angles
from sunsplit.core.strata import stratify_at
from tests.blender import (
    add_mesh,
    ball_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    plate_mesh,
    render,
)

SAMPLE = Path(__file__).parents[2] / "sample_scenes" / "spruit_sunrise_1k.hdr"

TIMES = (8.0, 4.0, 2.0, 1.0, 0.5)
SAMPLINGS = ("NONE", "512")


@dataclass(frozen=True)
class Row:
    """One configuration. times: the program's border; None is the plain HDRI."""

    times: float | None
    sampling: str

    def __str__(self) -> str:
        what = "plain HDRI" if self.times is None else f"{self.times:g} x"
        return f"{what}, {self.sampling}"


@dataclass(frozen=True)
class Result:
    row: Row
    suns: int
    share: float
    moment: float
    peak: float
    noise: float
    seconds: float
    mean: float


ROWS = (
    Row(None, "AUTOMATIC"),
    Row(None, "NONE"),
    Row(None, "512"),
    *(Row(times, s) for times in TIMES for s in SAMPLINGS),
    Row(1.0, "as set"),
)


def measure(path: Path, folder: Path, width: int, samples: int, seeds: int) -> list[Result]:
    """All rows for one map; one seed of all rows after the other, so that drift hits all alike."""
    images: dict[Row, list[np.ndarray]] = {row: [] for row in ROWS}
    seconds: dict[Row, list[float]] = {row: [] for row in ROWS}
    facts = {}
    for seed in range(seeds):
        for row in ROWS:
            scene = columns_and_balls(path, width)
            facts[row] = set_up(scene, row)
            started = time.process_time()
            images[row].append(render(scene, folder, samples, seed))
            seconds[row].append(time.process_time() - started)
    return [
        Result(
            row,
            *facts[row],
            noise=float(np.sqrt(np.var(images[row], axis=0, ddof=1).mean()) / np.mean(images[row])),
            seconds=float(np.median(seconds[row])),
            mean=float(np.mean(images[row])),
        )
        for row in ROWS
    ]


def columns_and_balls(path: Path, width: int) -> bpy.types.Scene:
    """Columns, a ball and a glossy ball on a ground."""
    scene = fresh_scene()
    hdri_world(scene, path)
    add_mesh(scene, plate_mesh(6), diffuse("Ground", 0.6), Matrix())
    for number in range(6):
        place = Matrix.Translation((np.cos(number * 1.05) * 1.7, np.sin(number * 1.05) * 1.7, 0))
        add_mesh(scene, box_mesh(0.12, 0.12, 0.7), diffuse("Column", 0.7), place)
    add_mesh(scene, ball_mesh(0.5), diffuse("Ball", 0.7), Matrix.Translation((0.6, 0.4, 0.5)))
    glossy = material("Glossy", (0.7, 0.7, 0.7), Roughness=0.3)
    add_mesh(scene, ball_mesh(0.5), glossy, Matrix.Translation((-0.5, -0.4, 0.5)))
    camera = camera_towards(scene, np.array([-0.75, 0, -0.5]), 40, width)
    camera.location = (6, 0, 4.2)
    scene.cycles.max_bounces = 4
    return scene


def set_up(scene: bpy.types.Scene, row: Row) -> tuple[int, float, float, float]:
    """Convert as a row asks for: number and share of the suns, second moment and peak of the
    residual."""
    facts = 0, 0.0, 0.0, 0.0
    if row.times is not None:
        share = None if row.sampling == "as set" else share_above(scene, row.times)
        options = SceneOptions(skips=False)  # the map alone decides
        conversion = convert_scene(scene, ConversionSettings(share=share), options).conversion
        facts = (
            len(conversion.suns),
            conversion.account.share,
            *contrast(conversion.residual),
        )
    world = scene.world.cycles
    if row.sampling.isdecimal():
        world.sampling_method, world.sample_map_resolution = "MANUAL", int(row.sampling)
    elif row.sampling != "as set":
        world.sampling_method = row.sampling
    return facts


def share_above(scene: bpy.types.Scene, times: float) -> float:
    """Of all light, what lies above so many times the border that the program would choose."""
    found = run_at_once(read_image(find_light(scene.world).image))
    lum = luminance(found.radiance)
    best = borders(lum, row_solid_angles(found.width, found.height)).best_level
    return stratify_at(lum, times * best, 2).share


def table(path: Path, results: list[Result]) -> Iterator[str]:
    """Markdown."""
    plain = results[0]
    yield f"\n### {path.stem}\n"
    yield "| configuration | suns | their share | moment | peak | noise | cpu s | mean | cost |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    for r in results:
        cost = (r.noise / plain.noise) ** 2 * r.seconds / plain.seconds
        yield (
            f"| {r.row} | {r.suns} | {r.share:.3f} | {r.moment:.2f} | {r.peak:.0f} | {r.noise:.4f} "
            f"| {r.seconds:.2f} | {r.mean / plain.mean - 1:+.2%} | {cost:.2f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("maps", nargs="*", type=Path, default=[SAMPLE])
    parser.add_argument("--width", type=int, default=112)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    lines = [
        f"Blender {bpy.app.version_string}, {options.width} x {options.width} pixels, "
        f"{options.samples} samples, {options.seeds} seeds."
    ]
    for path in options.maps:
        path = path.resolve()
        results = measure(path, options.output, options.width, options.samples, options.seeds)
        lines += table(path, results)
        (options.output / "region_a.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
