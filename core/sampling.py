"""How a path tracer should look for light: for the residual, what Cycles calls world importance
sampling; for suns, whether by its light tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS, luminance
from .noise import OTHERWISE, harmonics, mean_square_irradiance, square_from_one_place
from .sums import weighted_sum
from .suns import Sun
from .visible import VisiblePart

CALM_ENOUGH = 0.5
"""Variance of a sample, in squares of the mean irradiance of suns and residual, up to which
sampling the residual by surfaces alone costs no more than a table; this and the next bounds by
docs/benchmarks/region_a.md."""

EVEN = 1.2
"""Mean square of the irradiance of calm maps, in squares of the mean: 1 for a constant map, 2.67
for a single light. What surfaces add of noise is the second moment less this (see `noise`)."""

CALM_PEAK = 1000.0
"""Brightest pixel in means of the residual up to which a small table misses nothing that counts."""

AT_ONCE = 32
"""Rows of a map that are looked at together: few enough for a processor's own memory."""

SMALL_TABLE = 512
"""Width of the sampling table for a residual that is calm, but not calm enough to do without."""

WIDEST_TABLE = 8192
"""The widest that Cycles makes."""


MOST_IN_TREE = 32
"""So many lights at infinity, the world among them, Cycles' light tree can draw from where none of
them is wholly above a surface; beyond, it leaves out light (see `addon.light_tree`)."""

TIME_BY_TREE, TIME_BY_LOT = 0.065, 0.01
"""More time for each sun, as a part of a picture's, where a path tracer chooses among suns by their
strength, with a light tree, and where it draws lots; by docs/benchmarks/light_tree.md."""


@dataclass(frozen=True)
class WorldSampling:
    """Cycles' method, and the width of its table where the method is MANUAL."""

    method: Literal["NONE", "MANUAL", "AUTOMATIC"]
    resolution: int = SMALL_TABLE


BY_PORTALS = WorldSampling("NONE")
"""Where a scene's openings have portals: each is looked for through these only."""


def choose_sampling(
    residual: NDArray[np.float32] | None,
    share: float,
    cells: bool = False,
    visible: VisiblePart | None = None,
) -> WorldSampling:
    """None or a small table where the residual is calm, Cycles' own large one where it is not.

    share: of all visible light that suns give: what little the residual holds adds little noise.
    cells: of a Voronoi map, the table is as wide as the map: a smaller one blends what edges part,
    Cycles' own takes three times as long for the same picture (docs/benchmarks/table1.md).
    visible: the part of the map that counts, where that is not all of it.
    """
    if residual is None:
        return WorldSampling("NONE")
    moment, peak = contrast(residual, visible)
    if (moment - EVEN) * (1 - share) ** 2 <= CALM_ENOUGH:
        return WorldSampling("NONE")
    if cells:
        return WorldSampling("MANUAL", min(residual.shape[1], WIDEST_TABLE))
    if peak > CALM_PEAK:
        return WorldSampling("AUTOMATIC")
    return WorldSampling("MANUAL", min(residual.shape[1], SMALL_TABLE))


def needs_light_tree(suns: Sequence[Sun], light: float, beside: float = 0.0) -> bool:
    """Whether suns should be chosen by their strength, which takes time for each, or by lot, which
    is noisier where they are not alike.

    light: luminance of the whole map's scalar irradiance. beside: variance of a sample that comes
    from the residual, however suns are chosen.
    """
    count = len(suns)
    if count <= 1:
        return False
    by_strength, by_lot = (beside + variance for variance in variance_of_suns(suns, light))
    return by_strength * (1 + TIME_BY_TREE * count) < by_lot * (1 + TIME_BY_LOT * count)


def variance_of_suns(suns: Sequence[Sun], light: float) -> tuple[float, float]:
    """Of a sample that chooses one of these suns by its strength, and by lot (see `noise`).

    light: luminance of the whole map's scalar irradiance.
    """
    flux = np.array([sun.scalar_irradiance for sun in suns]) @ LUMINANCE_WEIGHTS / light
    each = flux[:, None] * harmonics(np.array([sun.to_light for sun in suns]))
    together = each.sum(axis=0)
    seen = mean_square_irradiance(together)
    by_strength = square_from_one_place(together) - seen
    by_lot = len(suns) * square_from_one_place(each).sum() - seen
    return 16 * float(by_strength) + OTHERWISE, 16 * float(by_lot) + OTHERWISE


def contrast(
    radiance: NDArray[np.float32], visible: VisiblePart | None = None
) -> tuple[float, float]:
    """(mean(L^2) / mean(L)^2, max(L) / mean(L)) of a map's luminance over the sphere, or over the
    visible part of it."""
    height, width = radiance.shape[:2]
    solid = sphere.row_solid_angles(width, height)
    area, seen = 4 * np.pi, visible and visible.pixels(width, height)
    if seen is not None:
        area = float(weighted_sum(solid, seen.sum(axis=1)))
    light, square, peak = np.empty(height), np.empty(height), 0.0
    for top in range(0, height, AT_ONCE):
        some = slice(top, top + AT_ONCE)
        lum = luminance(radiance[some])
        if seen is not None:
            lum *= seen[some]
        light[some], peak = lum.sum(axis=1), max(peak, float(lum.max()))
        square[some] = np.multiply(lum, lum, out=lum).sum(axis=1)
    mean = float(weighted_sum(solid, light)) / area
    if mean == 0:
        return 1.0, 1.0
    return float(weighted_sum(solid, square)) / area / mean**2, peak / mean
