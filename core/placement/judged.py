"""Suns with what is predicted of them, and tilted where level ground or walls ask for it."""

from __future__ import annotations

from dataclasses import replace

from ..prediction import Prediction
from ..strata import Strata
from .level import Level, levelled
from .placement import ON_GROUND, ON_WALLS, ChosenSuns

TILTS_COST = 0.65, 2.6
"""See `level.levelled`: the median of 191 sets of suns under eight maps, and what nine in ten of
them do not exceed. That is tried where shadows of tilted discs are more wrong than was thought."""


def tilted(
    chosen: ChosenSuns, prediction: Prediction, strata: Strata, allowed: float
) -> ChosenSuns:
    """The same suns, tilted if that helps."""
    part = prediction.part
    level = Level(
        prediction.ground,
        prediction.standing,
        on_ground=allowed * ON_GROUND * strata.part_on_ground / part,
        on_walls=allowed * ON_WALLS / (4 * part),
        shadows=allowed / part,
    )
    best = chosen
    for costs in TILTS_COST:
        if best.worst <= allowed or best.worst == chosen.predicted_error:
            break
        suns = levelled(chosen.suns, level, chosen.predicted_error / allowed, costs)
        moved = judged(replace(chosen, suns=suns), prediction, strata)
        best = min(best, moved, key=lambda one: one.worst)
        if moved.predicted_error < moved.worst:
            break
    return best


def judged(chosen: ChosenSuns, prediction: Prediction, strata: Strata) -> ChosenSuns:
    """The same suns with their predicted errors."""
    return replace(
        chosen,
        predicted_error=prediction.error(chosen.suns),
        ground_error=prediction.wrong_on_ground(chosen.suns) / strata.part_on_ground,
        standing_error=prediction.wrong_on_walls(chosen.suns),
    )
