"""Whether a path tracer that is told of a closed scene's openings finds its light sooner.

From each surface it looks for light once: towards a sun, or, told of openings, sometimes through
one of those instead. Else it meets the sky only where its own next ray happens to get out. Told, it
looks less often for the suns. Which of both is less noisy depends on how much of the light inside
is the sky's, how rarely rays get out, and how much of the scene the suns reach; and so does whether
it should choose by strength, with a light tree, or by lot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .sampling import TIME_BY_LOT, TIME_BY_TREE

Floats = NDArray[np.float64]

COST, COST_BY_LOT = 1.3, 1.05
"""Of a sample that looks for suns and for the sky, against one that only looks for as many suns,
with a light tree and by lot; these and the next by docs/benchmarks/portals.md."""

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
    number: int
    by_tree: bool = True


def openings_pay(told: LightInside, untold: LightInside, has_table: bool) -> bool:
    """Whether a conversion for a path tracer that knows the openings, `told`, is less noisy for its
    time than one for a path tracer that does not. has_table: the latter looks for the sky in all
    directions anyway, by its importance map."""
    cost = _time(told, for_sky=True) / _time(untold, for_sky=has_table)
    return cost * mean_square_told(told) < mean_square_untold(untold, has_table)


def told_at_its_best(told: LightInside) -> LightInside:
    """The same by strength or by lot, whichever is less noisy for its time: a light tree weighs
    suns and sky by what they are outside, and inside that may be nothing."""
    return min(_ways(told), key=lambda way: _time(way, for_sky=True) * mean_square_told(way))


def untold_at_its_best(untold: LightInside, has_table: bool) -> LightInside:
    """The same of a conversion for a path tracer that does not know the openings."""

    def cost(way: LightInside) -> float:
        return _time(way, for_sky=has_table) * mean_square_untold(way, has_table)

    return min(_ways(untold), key=cost)


def _ways(light: LightInside) -> list[LightInside]:
    return [replace(light, by_tree=by_tree) for by_tree in (True, False)]


def _time(light: LightInside, for_sky: bool) -> float:
    """Of a sample, against one that has no suns to choose among. for_sky: whether it looks for the
    sky too."""
    each = TIME_BY_TREE if light.by_tree else TIME_BY_LOT
    whole = COST if light.by_tree else COST_BY_LOT
    return (whole if for_sky else 1.0) * (1 + each * light.number)


def mean_square_untold(light: LightInside, has_table: bool) -> float:
    """Of the irradiance that a sample finds at a place where rays find the sky by themselves."""
    met = np.pi * 2 * np.pi / light.looks * float(light.sky**2 @ light.cosines)
    return met + _of_suns(light, np.pi * light.average if has_table else 0.0)


def mean_square_told(light: LightInside) -> float:
    """The same where it is looked for through openings."""
    sky = 2 * np.pi / light.looks * float(light.sky @ light.cosines)
    if light.by_tree:
        strength = light.facing.sum(axis=1).mean() + np.pi * light.average
        part = np.pi * light.average / strength if strength else 1.0
    else:
        part = 1 / (light.number + 1)
    through = THROUGH * sky**2 / part if part else 0.0
    return through + _of_suns(light, np.pi * light.average)


def _of_suns(light: LightInside, other: float) -> float:
    """Mean square of what is found of suns, one of which is chosen at each place, or none where the
    sky is, of this strength."""
    if light.by_tree:
        strength = light.facing.sum(axis=1, keepdims=True) + other
        chance = np.divide(
            light.facing, strength, out=np.ones_like(light.facing), where=strength > 0
        )
    else:
        chance = np.full_like(light.facing, 1 / max(light.number + (other > 0), 1))
    found = np.divide(light.suns**2, chance, out=np.zeros_like(chance), where=chance > 0)
    return float(found.sum(axis=1).mean()) if len(found) else 0.0
