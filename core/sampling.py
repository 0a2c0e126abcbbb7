"""How a path tracer should sample a residual map: what Cycles calls world importance sampling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .environment import luminance
from .sphere import row_solid_angles

CALM_ENOUGH = 0.5
"""Variance of a sample, in squares of the mean irradiance of suns and residual, up to which
sampling the residual by surfaces alone costs no more than a table; this and the next bounds by
docs/benchmarks/region_a.md."""

EVEN = 1.2
"""Mean square of the irradiance of calm maps, in squares of the mean: 1 for a constant map, 2.67
for a single light. What surfaces add of noise is the second moment less this (see `noise`)."""

CALM_PEAK = 1000.0
"""Brightest pixel in means of the residual up to which a small table misses nothing that counts."""

SMALL_TABLE = 512
"""Width of the sampling table for a residual that is calm, but not calm enough to do without."""

WIDEST_TABLE = 8192
"""The widest that Cycles makes."""


@dataclass(frozen=True)
class WorldSampling:
    """Cycles' method, and the width of its table where the method is MANUAL."""

    method: Literal["NONE", "MANUAL", "AUTOMATIC"]
    resolution: int = SMALL_TABLE


def choose_sampling(
    residual: NDArray[np.float32] | None, share: float, cells: bool = False
) -> WorldSampling:
    """None or a small table where the residual is calm, Cycles' own large one where it is not.

    share: of all light that suns give: what little the residual holds adds little noise.
    cells: of a Voronoi map, the table is as wide as the map: a smaller one blends what edges part,
    Cycles' own takes three times as long for the same picture (docs/benchmarks/table1.md).
    """
    if residual is None:
        return WorldSampling("NONE")
    moment, peak = contrast(residual)
    if (moment - EVEN) * (1 - share) ** 2 <= CALM_ENOUGH:
        return WorldSampling("NONE")
    if cells:
        return WorldSampling("MANUAL", min(residual.shape[1], WIDEST_TABLE))
    return WorldSampling("AUTOMATIC" if peak > CALM_PEAK else "MANUAL")


def contrast(radiance: NDArray[np.float32]) -> tuple[float, float]:
    """(mean(L^2) / mean(L)^2, max(L) / mean(L)) of a map's luminance over the sphere."""
    lum = luminance(radiance)
    solid = row_solid_angles(lum.shape[1], lum.shape[0]) / (4 * np.pi)
    mean = float(lum.sum(axis=1) @ solid)
    if mean == 0:
        return 1.0, 1.0
    return float((lum**2).sum(axis=1) @ solid) / mean**2, float(lum.max()) / mean
