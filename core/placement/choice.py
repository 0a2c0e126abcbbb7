"""Suns for the light of region A: by any method, as many as were asked for or as it takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..patches import MOST_PATCHES, Patches, patches_of
from ..prediction import Prediction
from ..region import RegionLight
from ..settings import ConversionSettings
from ..strata import Strata
from .edge import edge_suns
from .edge_split import split_of
from .light_count import fewest, first_guess
from .placement import NO_SUN, ChosenSuns
from .sampled import sampled_suns

BALANCED = 1.6
"""What is predicted of lights, about, against what is wrong of their cells when these are cut."""

PER_LIGHT, FEWEST_PATCHES = 128, 2048
"""Where the number of lights is looked for, they are made of so many patches."""


def choose_suns(
    light: RegionLight,
    strata: Strata,
    settings: ConversionSettings,
    unshadowed: RegionLight | None = None,
) -> ChosenSuns:
    """Suns that hold all of the light, and what shadows are predicted to be wrong by.

    unshadowed: the rest of the map, where the target shows it without shadows.
    """
    light = light.lit
    rest = patches_of(unshadowed, unshadowed.luminous_flux) if unshadowed else None
    if not len(light.pixels):
        error = Prediction.of(None, strata.light, rest).error(()) if rest else 0.0
        return ChosenSuns((), error, (NO_SUN,) if settings.share is None else (), 0.0)
    patches = _patches(light, strata, MOST_PATCHES)
    prediction = light.latest(
        "prediction", (strata, rest), lambda: Prediction.of(patches, strata.light, rest)
    )
    share = float(light.luminous_flux.sum()) / strata.light
    allowed = settings.allowed_error(share)

    cut = patches

    def with_lights(count: int) -> ChosenSuns:
        if settings.method == "edge":
            chosen = edge_suns(cut, strata, settings, count)
        else:
            chosen = sampled_suns(light, strata, settings, count)
        return replace(
            chosen,
            predicted_error=prediction.error(chosen.suns),
            ground_error=prediction.wrong_on_ground(chosen.suns) / strata.part_on_ground,
        )

    if allowed is None:
        chosen = with_lights(settings.most_lights)
    elif settings.method == "edge":
        rough = split_of(_patches(light, strata, FEWEST_PATCHES), settings.shape)

        def expected(count: int) -> float:
            return BALANCED * rough.error_of_cuts(count) * share

        likely = first_guess(allowed / 100, settings.most_lights, expected)
        cut = _patches(light, strata, _enough_patches(likely))
        chosen = fewest(with_lights, allowed / 100, settings.most_lights, expected)
    else:
        chosen = fewest(with_lights, allowed / 100, settings.most_lights)
    notes = (*chosen.notes, *_count_note(chosen, light, settings, allowed))
    return replace(chosen, notes=notes)


def _enough_patches(count: int) -> int:
    """A power of two."""
    return int(np.clip(PER_LIGHT << (count - 1).bit_length(), FEWEST_PATCHES, MOST_PATCHES))


def _patches(light: RegionLight, strata: Strata, most: int) -> Patches:
    if len(light.pixels) <= most:
        most = MOST_PATCHES  # all of them are pixels
    return light.once(
        ("patches", strata, most),
        lambda: patches_of(light, strata.luminance.ravel()[light.pixels], most),
    )


def _count_note(
    chosen: ChosenSuns, light: RegionLight, settings: ConversionSettings, allowed: float | None
) -> list[str]:
    """Why there are not as many lights as were asked for, or not as few errors."""
    made, asked = len(chosen.suns), settings.lights
    percent = 100 * chosen.worst
    if allowed is not None and percent > allowed:
        more = "" if asked else ": set the number of lights for more"
        return [
            f"{made} lights are predicted to be wrong by {percent:.2g} %, which is more than the "
            f"{allowed:g} % allowed{more}."
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
