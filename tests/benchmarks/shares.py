"""Is the share that the program chooses the best? Errors for fixed shares and for its own.

    python -m tests.benchmarks.shares MAP... [-o DIR] [--setups 300] [--seed 1] [--lights 4 16 64]

The same surfaces behind the same occluders as in `lights` look at suns and residual as the target
shows them. For Cycles the residual has its shadows, but also noise: the error is that of SAMPLES
samples a pixel, each with a ray of the surface's own that meets the residual, and one towards a
point of a lamp or, where the conversion sets that up, of the residual by a table. For export the
residual shines from everywhere without shadows, and there is no noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sunsplit.core import ConversionSettings, EnvironmentMap, convert, load, sphere
from sunsplit.core.conversion import Conversion
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.patches import patches_of
from sunsplit.core.pixels import HeldPixels
from sunsplit.core.reduction import narrowed
from sunsplit.core.region import light_of_map
from sunsplit.core.sampling import choose_sampling
from tests.benchmarks.occluders import Occluders, draw_occluders, light_of, light_of_suns

SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
SAMPLES = 256
"""A final picture: few enough that noise counts, many enough that what stays wrong does."""

COARSE = 256
"""Width of a residual at which its noise is summed: it is calm, or found by its table."""

FINE = 65_536
"""Patches of a residual: it is calm, and so many are wrong by a hundredth of what is measured."""


@dataclass(frozen=True)
class Result:
    """share: None where the program has chosen. error: part of the mean irradiance."""

    map: str
    target: str
    lights: int
    share: float | None
    suns: int
    given: float
    error: float


def results_of(
    found: EnvironmentMap, setups: int, seed: int, numbers: Sequence[int]
) -> list[Result]:
    """All targets, shares and numbers of lights for one map."""
    occluders = draw_occluders(found, setups, seed)
    directions, flux = light_of(found)
    luminous = flux @ LUMINANCE_WEIGHTS
    truth = occluders.irradiance(directions, luminous[:, None])[:, 0]
    mean = luminous.sum() / 4
    results = []
    for count in numbers:
        fixed = {
            share: convert(found, ConversionSettings(share=share, lights=count)) for share in SHARES
        }
        for target, error_of in (("cycles", _in_cycles), ("export", _exported)):
            own = ConversionSettings(lights=count, target=target)
            for share, conversion in (*fixed.items(), (None, convert(found, own))):
                error = error_of(conversion, occluders, truth) / mean
                suns, given = len(conversion.suns), conversion.account.share
                results.append(Result(found.name, target, count, share, suns, given, error))
    return results


def _in_cycles(conversion: Conversion, occluders: Occluders, truth: np.ndarray) -> float:
    residual, share = conversion.residual, conversion.account.share
    table = choose_sampling(residual, share).method != "NONE"
    # The ray towards a light goes to one of the suns, or to the table of the residual.
    to_table = 1 - share if table else 0.0
    given, noise = _suns(conversion, occluders, 1 - to_table)
    if residual is not None:
        given = given + _irradiance(occluders, residual)
        noise = noise + _noise(occluders, residual, to_table)
    return float(np.sqrt(np.mean((given - truth) ** 2 + np.maximum(noise, 0) / SAMPLES)))


def _exported(conversion: Conversion, occluders: Occluders, truth: np.ndarray) -> float:
    given, _ = _suns(conversion, occluders, 1)
    if conversion.residual is not None:
        given = given + _irradiance(occluders.without_occluders(), conversion.residual)
    return float(np.sqrt(np.mean((given - truth) ** 2)))


def _suns(
    conversion: Conversion, occluders: Occluders, asked: float
) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance of all suns, and its variance if one of them is asked at a time, in proportion to
    what it would give a surface that faces it: Cycles does not look which way a surface faces.

    asked: part of the rays that go to suns.
    """
    if not conversion.suns:
        return np.zeros(len(occluders.normals)), np.zeros(len(occluders.normals))
    directions, flux = light_of_suns(conversion.suns)
    light = (flux @ LUMINANCE_WEIGHTS)[:, None]
    seen = occluders.irradiance(directions, light)[:, 0]
    squared = occluders.irradiance(directions, light, lambda cosine, _: cosine**2)[:, 0]
    return seen, light.sum() / asked * squared - seen**2


def _irradiance(occluders: Occluders, radiance: np.ndarray) -> np.ndarray:
    light = light_of_map(radiance)
    patches = patches_of(light, light.luminous_flux, FINE)
    return occluders.irradiance(patches.directions, patches.flux @ LUMINANCE_WEIGHTS[:, None])[:, 0]


def _noise(occluders: Occluders, radiance: np.ndarray, to_table: float) -> np.ndarray:
    """Variance of a ray of the surface's own, by the cosine, and, for a part of the samples, one by
    a table of the residual's light; both weighted by the balance heuristic."""
    width = min(COARSE, radiance.shape[1])
    bright = (narrowed(HeldPixels.of(radiance), width) @ LUMINANCE_WEIGHTS).reshape(-1, 1)
    directions = sphere.pixel_directions(np.arange(len(bright)), width, width // 2)
    flux = bright * np.repeat(sphere.row_solid_angles(width, width // 2), width)[:, None]
    by_table = to_table * bright / flux.sum()

    def square(cosine: np.ndarray, some: slice) -> np.ndarray:
        chance = np.maximum(cosine / np.pi + by_table[some], 1e-300)
        return bright[some] * cosine**2 / chance

    def own_part(cosine: np.ndarray, some: slice) -> np.ndarray:
        return cosine**2 / np.pi / np.maximum(cosine / np.pi + by_table[some], 1e-300)

    seen, own, squared = (
        occluders.irradiance(directions, flux, change)[:, 0] for change in (None, own_part, square)
    )
    return squared - own**2 - (seen - own) ** 2


def table(results: Sequence[Result]) -> str:
    """Own share against the best fixed one in hindsight."""
    lines = [
        "# The share that the program chooses, against the best in hindsight",
        "",
        f"Fixed shares: {', '.join(f'{share:g}' for share in SHARES)}. Errors in percent of the "
        f"mean irradiance; for Cycles with {SAMPLES} samples.",
        "",
    ]
    keys = sorted({(r.target, r.lights) for r in results})
    lines += ["| target | lights | geometric mean | worst map |", "| --- | --- | --- | --- |"]
    rows = []
    for target, count in keys:
        ratios = {}
        for name in sorted({r.map for r in results}):
            mine = [r for r in results if (r.map, r.target, r.lights) == (name, target, count)]
            own = next(r for r in mine if r.share is None)
            best = min((r for r in mine if r.share is not None), key=lambda r: r.error)
            ratios[name] = own.error / best.error
            rows.append(
                f"| {name} | {target} | {count} | {own.given:.3f} ({own.suns}) "
                f"| {100 * own.error:.3g} | {best.share:g} | {100 * best.error:.3g} "
                f"| {ratios[name]:.2f} |"
            )
        worst = max(ratios, key=ratios.get)
        mean = np.exp(np.mean(np.log(list(ratios.values()))))
        lines.append(f"| {target} | {count} | {mean:.3f} | {ratios[worst]:.2f} ({worst}) |")
    lines += [
        "",
        "| map | target | lights | own share (suns) | error | best share | its error | ratio |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *rows,
    ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--setups", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lights", type=int, nargs="+", default=[4, 16, 64])
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = []
    for path in options.maps:
        results += results_of(load(path), options.setups, options.seed, options.lights)
        print(path.stem, flush=True)
        (options.output / "shares.md").write_text(table(results), encoding="utf-8")
    return results


if __name__ == "__main__":
    main()
