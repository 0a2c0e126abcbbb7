"""Whether a path tracer that is told of a closed scene's openings finds its light sooner.

From each surface it looks for light once: towards a sun, or, told of openings, sometimes through
one of those instead. Else it meets the sky only where its own next ray happens to get out. Told, it
looks less often for the suns. Which of both is less noisy depends on how much of the light inside
is the sky's, how rarely rays get out, and how much of the scene the suns reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .sampling import TIME_BY_TREE

Floats = NDArray[np.float64]

COST = 1.3
"""Of a sample that looks for suns and through openings, against one that only looks for as many
suns; this and the next by docs/benchmarks/portals.md."""

THROUGH = 2.0
"""Mean square, in squares of the mean, of the sky's light found through openings: places near them
get more of it."""


@dataclass(frozen=True, eq=False)
class LightInside:
    """Light at places in a closed scene, as luminance.

    sky: radiance in the directions of looks that got out, (n,), evenly over the half sphere above
    each place; cosines: to the surface, (n,); looks: how many there were in all. facing: irradiance
    that each sun would give each place if nothing stood between, (p, k); suns: what it gives.
    average: radiance of the residual over the whole sphere.
    """

    sky: Floats
    cosines: Floats
    looks: int
    facing: Floats
    suns: Floats
    average: float


def openings_pay(told: LightInside, untold: LightInside, has_table: bool) -> bool:
    """Whether a conversion for a path tracer that knows the openings, `told`, is less noisy for its
    time than one for a path tracer that does not. has_table: the latter looks for the sky in all
    directions anyway, by its importance map."""
    cost = (1.0 if has_table else COST) * _time(told) / _time(untold)
    return cost * mean_square_told(told) < mean_square_untold(untold, has_table)


def _time(light: LightInside) -> float:
    """Of a sample, against one without suns to choose among; of many the brightest are known."""
    return 1 + TIME_BY_TREE * light.suns.shape[1]


def mean_square_untold(light: LightInside, has_table: bool) -> float:
    """Of the irradiance that a sample finds at a place where rays find the sky by themselves."""
    met = np.pi * 2 * np.pi / light.looks * float(light.sky**2 @ light.cosines)
    return met + _of_suns(light, np.pi * light.average if has_table else 0.0)


def mean_square_told(light: LightInside) -> float:
    """The same where it is looked for through openings."""
    sky = 2 * np.pi / light.looks * float(light.sky @ light.cosines)
    strength = light.facing.sum(axis=1).mean() + np.pi * light.average
    part = np.pi * light.average / strength if strength else 1.0
    through = THROUGH * sky**2 / part if part else 0.0
    return through + _of_suns(light, np.pi * light.average)


def _of_suns(light: LightInside, other: float) -> float:
    """Mean square of what is found of suns, one of which is chosen by its strength at each place,
    or none where the sky is, of this strength."""
    strength = light.facing.sum(axis=1, keepdims=True) + other
    chance = np.divide(light.facing, strength, out=np.ones_like(light.facing), where=strength > 0)
    found = np.divide(light.suns**2, chance, out=np.zeros_like(chance), where=chance > 0)
    return float(found.sum(axis=1).mean()) if len(found) else 0.0
