"""Suns for the light of region A: by any method, as many as were asked for or as it takes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from math import hypot

import numpy as np

from ..indoors import Indoors
from ..patches import MOST_PATCHES, Patches, patches_of
from ..prediction import Prediction
from ..region import RegionLight
from ..settings import ConversionSettings
from ..strata import Strata
from ..visible import VisiblePart
from .edge import edge_suns
from .edge_split import split_of
from .gloss_cuts import true_in_gloss
from .judged import judged, tilted
from .light_count import fewest, first_guess
from .placement import NO_SUN, ON_GLOSS, ChosenSuns
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
    # A map that was turned is seen otherwise in gloss, and casts the same shadows.
    chosen = light.latest(
        "chosen",
        (told_for, settings),
        lambda: _for_shadows(light, strata, settings, prediction, within),
    )
    if gloss is not None and settings.cuts_for_gloss:
        chosen = true_in_gloss(chosen, light, patches, strata, settings, prediction, gloss, within)
    notes = _count_note(chosen, light, settings, prediction, allowed)
    notes = (*chosen.notes, *notes, *_gloss_note(chosen, settings))
    return replace(chosen, notes=notes)


def _for_shadows(
    light: RegionLight,
    strata: Strata,
    settings: ConversionSettings,
    prediction: Prediction,
    allowed: float | None,
) -> ChosenSuns:
    """By any method, as many as were asked for, or about as few as are allowed to be wrong."""

    def sampled(count: int) -> ChosenSuns:
        return judged(sampled_suns(light, strata, settings, count), prediction, strata)

    most = settings.most_lights
    if settings.method != "edge":
        return sampled(most) if allowed is None else fewest(sampled, allowed, most)
    if allowed is None:
        return _as_many_as_help(light, strata, settings, prediction)
    return _fewest_by_edge(light, strata, settings, prediction, allowed)


def _as_many_as_help(
    light: RegionLight, strata: Strata, settings: ConversionSettings, prediction: Prediction
) -> ChosenSuns:
    """As many as were asked for. Where cells say that fewer do, as on an even map, half as many may
    do better still: what cells get wrong is added up cell by cell, and what wide discs get wrong
    together can be more than that, or less."""
    count = settings.most_lights
    patches = _patches(light, strata, _for_lights(count, PER_LIGHT, FEWEST_PATCHES))
    best = judged(edge_suns(patches, strata, settings, count), prediction, strata)
    while 1 < len(best.suns) < count:
        count = len(best.suns) // 2 + 1
        fewer = judged(edge_suns(patches, strata, settings, count), prediction, strata)
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
        return tilted(judged(chosen, prediction, strata), prediction, strata, allowed)

    quickly, with_care = (partial(of_cells, rough=rough) for rough in (True, False))
    found = fewest(quickly, allowed, most, expected, with_care)
    return min(found, with_care(len(found.suns)), key=lambda one: one.worst)


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


def _gloss_note(chosen: ChosenSuns, settings: ConversionSettings) -> list[str]:
    """Where more lights would show something truer, and may be had."""
    if chosen.gloss_error is None or (settings.lights and settings.tolerance is None):
        return []
    percent, allowed = 100 * chosen.gloss_error, ON_GLOSS * settings.tolerated
    if percent <= allowed:
        return []
    more = "" if settings.lights else ": set the number of lights for more"
    return [
        f"{len(chosen.suns)} lights are predicted to be shown wrong by {percent:.2g} % in rough "
        f"gloss, which is more than the {allowed:.3g} % allowed{more}."
    ]


_NO_TRUER = "more would cast no truer shadows"
