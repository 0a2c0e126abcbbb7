"""How true one lamp can be at all: a search among all discs, without regard to how long it takes.

    python -m tests.benchmarks.one_light MAP... [-o DIR] [--setups 600] [--seed 1]
                                         [--directions 150]

A disc may point anywhere and be as wide as a hemisphere. Directions all around and to the map's
brightest pixels, each in several widths, are held against the surfaces and occluders of `lights`;
the best are then moved and widened by small steps until nothing gets better. The search looks at
the very surfaces by which it is judged: what no disc reaches there, no method can. A disc has all
of the map's light, as a conversion must keep it; what one of free strength would reach stands
beside it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from sunsplit.core import ConversionSettings, EnvironmentMap, load, sphere
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.patches import patches_of
from sunsplit.core.placement.edge import edge_suns
from sunsplit.core.placement.sampled import sampled_suns
from sunsplit.core.region import light_of_map
from sunsplit.core.strata import stratify
from tests.benchmarks.lights import WAYS
from tests.benchmarks.lights_report import OURS
from tests.benchmarks.occluders import Occluders, disc, draw_occluders, light_of, light_of_suns

Floats = np.ndarray

HALF_ANGLES = np.radians([0.5, 5, 15, 30, 45, 60, 75, 90])
"""Of the discs that are tried in each direction."""

BRIGHTEST = 3
"""Brightest pixels that are tried besides the even directions."""

BEST = 3
"""Of all that were tried, how many are moved on by small steps."""

ROUGH, FINE = 512, 16_384
"""Directions that stand for a disc: in the search, and when the best is judged."""

OF_MEDIAN_CUT, OF_OTHERS = 0.25, 0.5
"""What an error should be at most: of median cut with points, and of the best of the others as
their authors describe them."""


@dataclass(frozen=True)
class Result:
    """Errors of one light for one map, parts of the mean irradiance; bar: what it should be."""

    map: str
    ours: float
    bar: float
    best: float
    half_angle: float
    best_of_any_strength: float


@dataclass(frozen=True, eq=False)
class Judge:
    """Surfaces behind occluders, what they get of the map, (s,), and its mean in the open."""

    occluders: Occluders
    truth: Floats
    mean: float

    @classmethod
    def of(cls, found: EnvironmentMap, setups: int, seed: int) -> Judge:
        occluders = draw_occluders(found, setups, seed)
        directions, flux = light_of(found)
        luminous = flux @ LUMINANCE_WEIGHTS
        truth = occluders.irradiance(directions, luminous[:, None])[:, 0]
        return cls(occluders, truth, luminous.sum() / 4)

    def of_lights(self, directions: Floats, luminous: Floats) -> float:
        """Error of luminous lights, parts of the mean irradiance."""
        return self._error(self.occluders.irradiance(directions, luminous[:, None])[:, 0])

    def of_disc(self, where: Floats, points: int) -> tuple[float, float]:
        """Error of a disc with all of the light, and of one with the best strength.

        where: azimuth, elevation and half-angle, radians, (3,).
        """
        seen = self._disc(where, points)
        return self._error(seen), self._error(seen * (seen @ self.truth) / (seen @ seen))

    def _disc(self, where: Floats, points: int) -> Floats:
        azimuth, elevation, half_angle = where
        ring = np.cos(elevation)
        to_light = [ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(elevation)]
        half_angle = float(np.clip(half_angle, 0, np.pi / 2))
        directions = disc(np.array(to_light), half_angle, points)
        flux = np.full((points, 1), 4 * self.mean / points)
        return self.occluders.irradiance(directions, flux)[:, 0]

    def _error(self, seen: Floats) -> float:
        return float(np.sqrt(np.mean((seen - self.truth) ** 2)) / self.mean)


def result_of(found: EnvironmentMap, setups: int, seed: int, even: int) -> Result:
    """Our light, the bar, and the best disc there is."""
    judge = Judge.of(found, setups, seed)
    error = {way.name: judge.of_lights(*_light_of(found, way.settings)) for way in WAYS}
    others = [w.name for w in WAYS if w.by_authors and not w.name.startswith("median")]
    best_of_others = min(error[name] for name in others)
    bar = min(OF_MEDIAN_CUT * error["median-cut, points"], OF_OTHERS * best_of_others)
    best, free = best_discs(judge, _starts(found, even))
    return Result(
        found.name,
        error[OURS],
        bar,
        judge.of_disc(best, FINE)[0],
        float(best[2]),
        judge.of_disc(free, FINE)[1],
    )


def best_discs(judge: Judge, starts: Floats) -> tuple[Floats, Floats]:
    """Azimuth, elevation and half-angle, (3,), of the best disc with all of the light, and of the
    best if its strength may be chosen too. starts: where to begin, (n, 3)."""
    errors = np.array([judge.of_disc(where, ROUGH) for where in starts])
    found = []
    for kind in (0, 1):
        ends = []
        for where in starts[np.argsort(errors[:, kind])[:BEST]]:
            simplex = np.vstack([where, where + np.diag([0.1, 0.1, 0.1])])
            ends.append(
                minimize(
                    lambda at, kind=kind: judge.of_disc(at, ROUGH)[kind],
                    where,
                    method="Nelder-Mead",
                    options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-5},
                )
            )
        found.append(min(ends, key=lambda end: end.fun).x)
    return found[0], found[1]


def _starts(found: EnvironmentMap, even: int) -> Floats:
    """Azimuth, elevation and half-angle of the discs that are tried first, (n, 3)."""
    index = np.arange(even) + 0.5
    elevation = np.arcsin(1 - 2 * index / even)
    azimuth = index * (np.pi * (3 - np.sqrt(5)))
    bright = np.argsort(found.luminance.ravel())[-BRIGHTEST:]
    to_bright = sphere.pixel_directions(bright, found.width, found.height)
    azimuth = np.concatenate([azimuth, np.arctan2(to_bright[:, 1], to_bright[:, 0])])
    elevation = np.concatenate([elevation, np.arcsin(to_bright[:, 2])])
    return np.array(
        [(a, e, half) for a, e in zip(azimuth, elevation, strict=True) for half in HALF_ANGLES]
    )


def _light_of(found: EnvironmentMap, settings: ConversionSettings) -> tuple[Floats, Floats]:
    """Directions and luminous scalar irradiances of one light by a method."""
    light = light_of_map(found.radiance).lit
    strata = stratify(found, 1, 2)
    settings = replace(settings, lights=1)
    if settings.method == "edge":
        patches = patches_of(light, strata.luminance.ravel()[light.pixels])
        suns = edge_suns(patches, strata, settings, 1).suns
    else:
        suns = sampled_suns(light, strata, settings, 1).suns
    directions, flux = light_of_suns(suns)
    return directions, flux @ LUMINANCE_WEIGHTS


def table(results: Sequence[Result], options: argparse.Namespace) -> str:
    """Errors in percent, and their geometric means."""
    tried = (options.directions + BRIGHTEST) * len(HALF_ANGLES)
    lines = [
        "# How true one light can be",
        "",
        "Errors of irradiance under occluders in percent of the mean irradiance, luminance, "
        f"{options.setups} set-ups, seed {options.seed}: the program's one disc, what it should be "
        f"(the less of {OF_MEDIAN_CUT:g} times median cut with a point and {OF_OTHERS:g} times the "
        f"best of variance, k-means and Penrose), and the best disc of {tried} that were tried, "
        f"after the best {BEST} of them were moved and widened until nothing got better.",
        "",
        "| map | ours | bar | best disc (its diameter) | best disc of any strength |",
        "| --- | --- | --- | --- | --- |",
    ]
    for one in results:
        wide = f"{2 * np.degrees(np.clip(one.half_angle, 0, np.pi / 2)):.0f} degrees"
        errors = one.ours, one.bar, one.best, one.best_of_any_strength
        ours, bar, best, free = (f"{100 * error:.3g}" for error in errors)
        lines.append(f"| {one.map} | {ours} | {bar} | {best} ({wide}) | {free} |")
    means = [
        100 * np.exp(np.mean(np.log([getattr(one, name) for one in results])))
        for name in ("ours", "bar", "best", "best_of_any_strength")
    ]
    lines.append("| geometric mean | " + " | ".join(f"{mean:.3g}" for mean in means) + " |")
    reached = sum(min(one.best, one.ours) <= one.bar for one in results)
    lines += ["", f"A disc reaches the bar on {reached} of {len(results)} maps."]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--setups", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--directions", type=int, default=150)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = []
    for path in options.maps:
        results.append(result_of(load(path), options.setups, options.seed, options.directions))
        print(results[-1], flush=True)
        (options.output / "one_light.md").write_text(table(results, options), encoding="utf-8")
    return results


if __name__ == "__main__":
    main()
