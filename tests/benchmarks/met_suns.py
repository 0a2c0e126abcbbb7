"""Which suns should the rays that go on from surfaces meet? Cost to equal noise of several answers.

    .venv-5.2/bin/python -m tests.benchmarks.met_suns MAP ... [-o FOLDER] [--materials ...]

A path tracer looks for suns, and its rays may meet them by chance besides (Cycles' "multiple
importance" of a lamp). Mirrors need that, rough surfaces pay for it. Each material is put on all of
a scene; suns up to some widths are not met. A cost of 1 is that of all suns met.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from sunsplit.addon.scene import convert_scene
from sunsplit.core.settings import ConversionSettings
from tests.benchmarks.scenes import outdoor
from tests.blender import diffuse, material, timed_render

WIDTHS = (0.0, 3.0, 30.0, 180.0)
"""Degrees up to which suns are not met."""

MATERIALS: Mapping[str, Mapping[str, float] | None] = {
    "diffuse": None,
    "plastic 0.5": {"Roughness": 0.5},
    "plastic 0.4": {"Roughness": 0.4},
    "plastic 0.25": {"Roughness": 0.25},
    "metal 0.5": {"Roughness": 0.5, "Metallic": 1.0},
    "metal 0.25": {"Roughness": 0.25, "Metallic": 1.0},
}


@dataclass(frozen=True)
class Result:
    """widths: of the lamps, degrees. chosen: the program's. variance, of one sample, and seconds:
    of each of WIDTHS."""

    map: str
    material: str
    widths: tuple[float, ...]
    chosen: float
    variance: tuple[float, ...]
    seconds: tuple[float, ...]

    @property
    def costs(self) -> list[float]:
        """Time to equal noise, all suns met being 1."""
        costs = np.array(self.variance) * self.seconds
        return list(costs / costs[0])


def measure(path: Path, name: str, options: argparse.Namespace) -> Result:
    """All ways for one map and material, interleaved."""
    scene = outdoor(path.resolve(), options.size)
    inputs = MATERIALS[name]
    surface = diffuse("All", 0.6) if inputs is None else material("All", (0.6, 0.6, 0.6), **inputs)
    for thing in scene.objects:
        if thing.type == "MESH":
            thing.data.materials[0] = surface
    made = convert_scene(scene, ConversionSettings())
    lamps = [entry.lamp.data for entry in scene.sunsplit.lamps]
    degrees = [float(np.degrees(sun.angular_diameter)) for sun in made.conversion.suns]
    unmet = [w for lamp, w in zip(lamps, degrees, strict=True) if not _is_met(lamp)]
    images: list[list[np.ndarray]] = [[] for _ in WIDTHS]
    seconds: list[list[float]] = [[] for _ in WIDTHS]
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.repeats):
            for way, width in enumerate(WIDTHS):
                for lamp, degree in zip(lamps, degrees, strict=True):
                    lamp.cycles.use_multiple_importance_sampling = degree > width
                image, took = timed_render(scene, Path(folder), options.samples, seed)
                images[way].append(image)
                seconds[way].append(took)
    mean = float(np.mean(images))
    return Result(
        path.stem,
        name,
        tuple(degrees),
        max(unmet, default=0.0),
        tuple(options.samples * float(np.var(i, axis=0, ddof=1).mean()) / mean**2 for i in images),
        tuple(float(np.median(some)) for some in seconds),
    )


def _is_met(lamp: bpy.types.Light) -> bool:
    return lamp.cycles.use_multiple_importance_sampling


def table(results: Sequence[Result]) -> str:
    ways = [f"up to {width:.0f}°" for width in WIDTHS[1:]]
    lines = [
        "# Suns that rays do not meet",
        "",
        f"Blender {bpy.app.version_string}. Time to equal noise where rays do not meet suns up to "
        "some widths, met ones being 1 (of that: variance). Last: the widest that the program lets "
        "no ray meet, and the widest lamp.",
        "",
        f"| map | material | lamps | {' | '.join(ways)} | chosen of |",
        f"| --- | --- | --- |{' --- |' * len(ways)} --- |",
    ]
    for one in results:
        cells = [
            f"{cost:.2f} ({variance / one.variance[0]:.2f})"
            for cost, variance in zip(one.costs[1:], one.variance[1:], strict=True)
        ]
        lines.append(
            f"| {one.map} | {one.material} | {len(one.widths)} | {' | '.join(cells)} "
            f"| {one.chosen:.1f}° of {max(one.widths, default=0):.1f}° |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--materials", nargs="+", choices=MATERIALS, default=list(MATERIALS))
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--repeats", type=int, default=4)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = []
    for path in options.maps:
        results += [measure(path, name, options) for name in options.materials]
        (options.output / "met_suns.md").write_text(table(results), encoding="utf-8")
    return results


if __name__ == "__main__":
    main()
