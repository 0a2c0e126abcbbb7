"""Suns for the light of region A: by any method, as many as were asked for or as it takes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from math import hypot

import numpy as np

from ..gloss import Gloss
from ..indoors import Indoors
from ..patches import MOST_PATCHES, Patches, patches_of
from ..prediction import Prediction
from ..region import RegionLight
from ..settings import ConversionSettings
from ..strata import Strata
from ..visible import VisiblePart
from .edge import edge_suns, suns_of_cells
from .edge_cells import cells_of
from .edge_light import EdgeLight
from .edge_split import split_of
from .gloss_cuts import cut_for_gloss, owners, shown_light
from .level import Level, levelled
from .light_count import fewest, first_guess
from .placement import NO_SUN, ON_GLOSS, ON_GROUND, ON_WALLS, ChosenSuns
from .sampled import sampled_suns

PER_LIGHT, FEWEST_PATCHES = 128, 2048
"""As many lights as were asked for are made of so many patches. 2 to 64 of them for nine maps are
by the geometric mean as wrong as of MOST_PATCHES to a hundredth, or up to 4 % less, and up to four
times as soon made."""

SEARCHED_PER_LIGHT, FEWEST_SEARCHED = 16, 512
"""The same where their number is looked for. 2 to 24 lights are as wrong of 512 patches as of
MOST_PATCHES, but for chance: 1.00 times by the geometric mean of 27 regions of nine maps. With
twice as many for each light a search finds as many lights, with four times as many .7 % fewer, and
takes a fifteenth and a fifth longer."""

TOLD_BY = 4096
"""Patches by which errors are predicted: as far from what many more tell as MOST_PATCHES are, as
both are good to a tenth only."""

MOST_INDOORS = 64
"""By itself: where little of a light grazes a window, all that comes in of it is an edge."""

MOST_IN_GLOSS = 64
"""By itself: more are not worth what they cost to show a floor's reflections a little truer."""

ROUNDS = 6
"""So often are cells cut further, if what tilts their discs for level ground is shown by gloss."""

TILTS_COST = 0.65, 2.6
"""See `level.levelled`: the median of 191 sets of suns under eight maps, and what nine in ten of
them do not exceed. That is tried where shadows of tilted discs are more wrong than was thought."""


def choose_suns(
    light: RegionLight,
    strata: Strata,
    settings: ConversionSettings,
    unshadowed: RegionLight | None = None,
    visible: VisiblePart | None = None,
) -> ChosenSuns:
    """Suns that hold all of the light, and what shadows are predicted to be wrong by.

    unshadowed: the rest of the map, where the target shows it without shadows. visible: tells the
    places that the light reaches, where it does so through openings only, and what shows it in
    rough gloss.
    """
    indoors, gloss = (visible.indoors, visible.gloss) if visible else (None, None)
    light = light.lit
    rest = patches_of(unshadowed, unshadowed.luminous_flux) if unshadowed else None
    eevee = settings.in_eevee
    if not len(light.pixels):
        error = Prediction.of(None, strata.light, rest, eevee).error(()) if rest else 0.0
        return ChosenSuns((), error, (NO_SUN,) if settings.share is None else (), 0.0)
    patches = _patches(light, strata, TOLD_BY)

    def predict() -> Prediction:
        if indoors is not None:
            return Prediction.indoors(patches, strata.light, indoors)
        return Prediction.of(patches, strata.light, rest, eevee)

    told_for = strata, rest, eevee, indoors and indoors.key
    prediction = light.latest("prediction", told_for, predict)
    allowed = settings.allowed_error(max(prediction.part, prediction.part_inside))
    if allowed is not None and settings.tolerance is None:
        allowed = hypot(allowed, 100 * prediction.of_residual)
    within = None if allowed is None else allowed / 100
    if settings.method != "edge":
        chosen = _by_samples(light, strata, settings, prediction, within)
    elif within is None:
        chosen = _as_many_as_help(light, strata, settings, prediction)
    else:
        chosen = _fewest_by_edge(light, strata, settings, prediction, within)
    if gloss is not None and settings.method == "edge" and settings.shape == "disc":
        chosen = _mirrored(chosen, light, patches, strata, settings, prediction, gloss, within)
    notes = (*chosen.notes, *_count_note(chosen, light, settings, prediction, allowed))
    return replace(chosen, notes=notes)


def _by_samples(
    light: RegionLight,
    strata: Strata,
    settings: ConversionSettings,
    prediction: Prediction,
    allowed: float | None,
) -> ChosenSuns:
    def sampled(count: int) -> ChosenSuns:
        return _judged(sampled_suns(light, strata, settings, count), prediction, strata)

    if allowed is None:
        return sampled(settings.most_lights)
    return fewest(sampled, allowed, settings.most_lights)


def _as_many_as_help(
    light: RegionLight, strata: Strata, settings: ConversionSettings, prediction: Prediction
) -> ChosenSuns:
    """As many as were asked for. Where cells say that fewer do, as on an even map, half as many may
    do better still: what cells get wrong is added up cell by cell, and what wide discs get wrong
    together can be more than that, or less."""
    count = settings.most_lights
    patches = _patches(light, strata, _for_lights(count, PER_LIGHT, FEWEST_PATCHES))
    best = _judged(edge_suns(patches, strata, settings, count), prediction, strata)
    while 1 < len(best.suns) < count:
        count = len(best.suns) // 2 + 1
        fewer = _judged(edge_suns(patches, strata, settings, count), prediction, strata)
        if fewer.predicted_error >= best.predicted_error:
            break
        best = fewer
    return best


def _fewest_by_edge(
    light: RegionLight,
    strata: Strata,
    settings: ConversionSettings,
    prediction: Prediction,
    allowed: float,
) -> ChosenSuns:
    """About as few as are within a part of the mean irradiance.

    Their number is about that of the first cells that are, and not of the best: these are within it
    with one light in thirty less, and take half as long again to find.
    """
    eevee = settings.in_eevee
    few = split_of(_patches(light, strata, FEWEST_SEARCHED), settings.shape, eevee)

    @cache
    def expected(count: int) -> float:
        return prediction.expected(few.error_of_cuts(count))

    most = settings.most_lights
    if settings.lights is None and isinstance(prediction.surfaces, Indoors):
        most = min(most, MOST_INDOORS)
    likely = first_guess(allowed, most, expected)

    @cache
    def of_cells(count: int, rough: bool) -> ChosenSuns:
        # Mostly the same for all numbers, so that they share their cuts.
        enough = _for_lights(max(count, likely), SEARCHED_PER_LIGHT, FEWEST_SEARCHED)
        patches = _patches(light, strata, enough)
        chosen = edge_suns(patches, strata, settings, count, level=True, rough=rough)
        return _levelled(_judged(chosen, prediction, strata), prediction, strata, allowed)

    quickly, with_care = (partial(of_cells, rough=rough) for rough in (True, False))
    found = fewest(quickly, allowed, most, expected, with_care)
    return min(found, with_care(len(found.suns)), key=lambda one: one.worst)


def _mirrored(
    chosen: ChosenSuns,
    light: RegionLight,
    patches: Patches,
    strata: Strata,
    settings: ConversionSettings,
    prediction: Prediction,
    gloss: Gloss,
    of_shadows: float | None,
) -> ChosenSuns:
    """The same suns, or more where rough gloss shows them to be discs, with what is wrong of that.
    of_shadows: what is allowed of them; suns are tilted for that, which gloss shows too."""
    shown = light.latest("gloss", (strata, gloss.key), lambda: shown_light(gloss, patches))
    wanted = shown.sum(axis=1)

    def told(suns: ChosenSuns) -> ChosenSuns:
        wrong = gloss.shown_of(suns.suns) - wanted
        return replace(suns, gloss_error=gloss.error(wrong, strata.light))

    best = told(chosen)
    aim, most = settings.tolerated / 100, settings.most_lights
    allowed = ON_GLOSS * aim
    if settings.lights is None:
        most = max(min(most, MOST_IN_GLOSS), len(chosen.suns))
    if best.gloss_error <= allowed or len(chosen.suns) >= most:
        return best
    parts, owner = EdgeLight.of(patches, settings.shape), owners(chosen.taken, light, patches)
    for _ in range(ROUNDS):
        owner = cut_for_gloss(parts, patches, owner, gloss, shown, strata.light, aim, most)
        cut = suns_of_cells(cells_of(parts, owner), patches, strata, settings)
        cut = _judged(replace(cut, notes=chosen.notes), prediction, strata)
        cut = told(_levelled(cut, prediction, strata, of_shadows) if of_shadows else cut)
        best = min(best, cut, key=lambda one: one.gloss_error)
        if cut.gloss_error <= allowed or len(cut.suns) >= most:
            break
        aim *= allowed / cut.gloss_error
    return best


def _levelled(
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
        tilted = _judged(replace(chosen, suns=suns), prediction, strata)
        best = min(best, tilted, key=lambda one: one.worst)
        if tilted.predicted_error < tilted.worst:
            break
    return best


def _judged(chosen: ChosenSuns, prediction: Prediction, strata: Strata) -> ChosenSuns:
    """The same suns with their predicted errors."""
    return replace(
        chosen,
        predicted_error=prediction.error(chosen.suns),
        ground_error=prediction.wrong_on_ground(chosen.suns) / strata.part_on_ground,
        standing_error=prediction.wrong_on_walls(chosen.suns),
    )


def _for_lights(count: int, per_light: int, least: int) -> int:
    """Patches that so many lights are made of; a power of two."""
    return int(np.clip(per_light << (count - 1).bit_length(), least, MOST_PATCHES))


def _patches(light: RegionLight, strata: Strata, most: int) -> Patches:
    if len(light.pixels) <= most:
        most = MOST_PATCHES  # all of them are pixels
    return light.once(
        ("patches", strata, most),
        lambda: patches_of(light, strata.luminance.ravel()[light.pixels], most, strata),
    )


def _count_note(
    chosen: ChosenSuns,
    light: RegionLight,
    settings: ConversionSettings,
    prediction: Prediction,
    allowed: float | None,
) -> list[str]:
    """Why there are not as many lights as were asked for, or not as few errors."""
    made, asked = len(chosen.suns), settings.lights
    percent = 100 * chosen.worst
    if allowed is not None and percent > allowed:
        more = "" if asked else ": set the number of lights for more"
        if 100 * prediction.of_residual > allowed:
            more = ": the rest of the map is shown without shadows, and no lights mend that"
        return [
            f"{made} lights are predicted to be wrong by {percent:.2g} %, which is more than the "
            f"{allowed:.3g} % allowed{more}."
        ]
    if asked is None or made == asked:
        return []
    if allowed is not None:
        return [f"{made} of {asked} lights: as few are within the {allowed:g} % allowed."]
    if settings.method == "edge":
        few = len(light.pixels) <= asked
        why = f"region A has only {len(light.pixels)} pixels that shine" if few else _NO_TRUER
        return [f"{made} of {asked} lights: {why}."]
    return []


_NO_TRUER = "more would cast no truer shadows"
