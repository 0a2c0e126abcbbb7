"""Suns and residual in a pass of samples each: how noisy a sample of each is, and how many samples
each gets in the time of one pass with both.

Noise of two passes adds up: V_s / n_s + V_r / n_r for variances V of a sample and numbers n of
samples. With costs c of a sample, and c_s n_s + c_r n_r given, it is least where n is proportional
to sqrt(V / c) (Lagrange).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor, sqrt

import numpy as np
from numpy.typing import NDArray

from .conversion import Conversion
from .noise import OF_TABLE, OTHERWISE
from .sampling import EVEN, choose_sampling, contrast, variance_of_suns
from .suns import Sun
from .visible import VisiblePart

COST_OF_SUNS, COST_OF_SKY = 0.8, 0.5
"""Time of a sample of each pass, in that of a sample of suns and residual together: without suns
no ray looks for light. This and the next by docs/benchmarks/two_passes.md."""

EVENLY = 0.3
"""Variance that is left of a residual's, against that of suns': samples that are spread evenly
suit a calm sky better than the edges of shadows."""


@dataclass(frozen=True)
class PassPart:
    """One of two passes. variance: of a sample a pixel, in squares of the mean irradiance of both.
    cost: of that sample, in samples of one pass with suns and residual."""

    variance: float
    cost: float


def parts_of(conversion: Conversion, by_strength: bool) -> tuple[PassPart, PassPart]:
    """The pass of the suns, of which there is one at least, and that of the residual.

    by_strength: how one of the suns is chosen, see `sampling.needs_light_tree`.
    """
    cells, visible = conversion.settings.residual == "voronoi", conversion.visible
    return (
        part_of_suns(conversion.suns, conversion.strata.light, by_strength),
        part_of_residual(conversion.residual, conversion.visible_share, cells, visible),
    )


def part_of_suns(suns: Sequence[Sun], light: float, by_strength: bool) -> PassPart:
    """light: luminance of the scalar irradiance of all that is visible."""
    strength, lot = variance_of_suns(suns, light)
    return PassPart(strength if by_strength else lot, COST_OF_SUNS)


def part_of_residual(
    residual: NDArray[np.float32] | None,
    share: float,
    cells: bool = False,
    visible: VisiblePart | None = None,
) -> PassPart:
    """share, cells, visible: see `choose_sampling`."""
    if residual is None:
        return PassPart(EVENLY * OTHERWISE, COST_OF_SKY)
    moment, _ = contrast(residual, visible)
    variance, cost = max(moment - EVEN, 0.0) * (1 - share) ** 2, COST_OF_SKY
    if choose_sampling(residual, share, cells, visible).method != "NONE":
        # Rays look for light in the residual's table as they do for suns.
        variance, cost = min(variance, OF_TABLE), COST_OF_SUNS
    return PassPart(EVENLY * (variance + OTHERWISE), cost)


def samples_of_passes(samples: int, suns: PassPart, residual: PassPart) -> tuple[int, int]:
    """Samples of the suns' pass and of the residual's that together take the time of one pass with
    so many samples, or less, for the least noise; one of each at least."""
    ideal = samples * sqrt(suns.variance / suns.cost)
    ideal /= sqrt(suns.variance * suns.cost) + sqrt(residual.variance * residual.cost)
    most = max(floor((samples - residual.cost) / suns.cost), 1)

    def left(number: int) -> float:
        return max((samples - suns.cost * number) / residual.cost, 1.0)

    def noise(number: int) -> float:
        return suns.variance / number + residual.variance / left(number)

    near = {min(max(number, 1), most) for number in (floor(ideal), ceil(ideal))}
    chosen = min(near, key=noise)
    return chosen, floor(left(chosen))
