"""Whether a path tracer that is told of a closed scene's openings finds its light sooner.

From each surface it looks for light once: towards a sun, or, told of openings, sometimes through
one of those instead. Else it meets the sky only where its own next ray happens to get out. Told, it
looks less often for the suns. Which of both is less noisy depends on how much of the light inside
is the sky's, how rarely rays get out, and how much of the scene the suns reach; and so does whether
it should choose by strength, with a light tree, or by lot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .openings import Opening
from .sampling import TIME_BY_LOT, TIME_BY_TREE

Floats = NDArray[np.float64]

COST, COST_BY_LOT = 1.3, 1.05
"""Of a sample that looks for suns and for the sky, against one that only looks for as many suns,
with a light tree and by lot; see docs/benchmarks/portals.md."""

PAYS = 1.2
"""So many times the cost must be predicted to be less: for portals Cycles makes a table of all
directions that it then has no use for, which takes two thirds of a second and 340 MB."""

THROUGH = 0.5
"""Of the mean square that `square_through` tells, what pictures of a room show with only its sky:
in geometric mean under nine maps, .3 to 1."""

GRID = 6
"""Points along each side of an opening, by which what comes through it is told."""


@dataclass(frozen=True, eq=False)
class LightInside:
    """Light at places in a closed scene, as luminance.

    sky: radiance in the directions of looks that got out, (n,), evenly over the half sphere above
    each place; cosines: to the surface, (n,); looks: how many there were in all. through: see
    `square_through`. facing: irradiance that each sun would give each place if nothing stood
    between, (p, k); suns: what it gives. average: radiance of the residual over the whole sphere.
    number: of all suns, of which the brightest k were asked for. by_tree: whether they are chosen
    by strength, else by lot.
    """

    sky: Floats
    cosines: Floats
    looks: int
    through: float
    facing: Floats
    suns: Floats
    average: float
    number: int
    by_tree: bool = True


def openings_pay(told: LightInside, untold: LightInside, has_table: bool) -> bool:
    """Whether a conversion for a path tracer that knows the openings, `told`, is so much less noisy
    for its time than one for a path tracer that does not. has_table: the latter looks for the sky
    in all directions anyway, by its importance map."""
    cost = _time(told, for_sky=True) / _time(untold, for_sky=has_table)
    return PAYS * cost * mean_square_told(told) < mean_square_untold(untold, has_table)


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
    if light.by_tree:
        strength = light.facing.sum(axis=1).mean() + np.pi * light.average
        part = np.pi * light.average / strength if strength else 1.0
    else:
        part = 1 / (light.number + 1)
    sky = THROUGH * light.through / part if part else 0.0
    return sky + _of_suns(light, np.pi * light.average)


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


def square_through(
    openings: Sequence[Opening],
    places: Floats,
    normals: Floats,
    radiance: Callable[[Floats], Floats],
) -> float:
    """Mean square of the irradiance that samples through openings find at places, (p, 3).

    Of the openings that a place is before one is chosen by lot, and of the directions to it any is
    as likely. normals: of the surfaces there, (p, 3). radiance: luminance in directions, (n, 3).
    Nothing is thought to stand between; and nearer to an opening than a sixth of its size, what
    comes from aside is not told well.
    """
    squares, before = np.zeros(len(places)), np.zeros(len(places))
    for opening in openings:
        points, area = opening.points(GRID)
        away = points - places[:, None]
        squared = (away**2).sum(axis=2)
        directions = away / np.sqrt(np.maximum(squared, 1e-300))[..., None]
        # Near a place a point's part of the opening is a disc, of a half sphere at most.
        facing = np.maximum(-(directions @ opening.inwards), 0)
        angle = area * facing / (squared + area / (2 * np.pi))
        cosines = np.maximum(np.einsum("pkc,pc->pk", directions, normals), 0)
        found = radiance(directions.reshape(-1, 3)).reshape(cosines.shape) * cosines
        squares += angle.sum(axis=1) * (found**2 * angle).sum(axis=1)
        before += opening.is_before(places)
    return float(np.mean(before * squares)) if len(places) else 0.0
