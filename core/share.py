"""How much of a map becomes suns where the user leaves that to the program.

Cycles shows the residual with its shadows: there the border is put where least noise is left (see
`noise`), and higher where too few suns would stand for too much. EEVEE and game engines light with
the residual from everywhere at once, whatever stands in the way: there more of the map in suns
means truer shadows, until too few suns stand for too much.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap, luminance
from .noise import PER_OCTAVE, borders, squared_noise
from .patches import patches_of
from .placement.edge import edge_suns
from .prediction import Prediction
from .region import RegionLight, light_of_map
from .settings import ConversionSettings
from .strata import Strata, stratify, stratify_at, stratify_calm
from .visible import VisiblePart

SHARES = (1.0, 0.95, 0.9, 0.8, 0.65, 0.5, 0.3)
"""What is tried, in this order, after whole peaks with their halo. Between two of them the error is
flat; once it has risen twice, it goes on rising."""

MOST_OF_A_WORLD = 0.95
"""Where the residual is a scene's world: mirrors must have something to show."""

ROUGH = 4096
"""Patches with which shares are compared: their order is what counts."""

USUAL_LIGHTS = 16
"""For as many lights the share is chosen where their number is chosen after it."""


def choose_strata(
    environment: EnvironmentMap, settings: ConversionSettings, visible: VisiblePart | None = None
) -> Strata:
    """The strata for a share that is given or chosen for the map, the lights and the target.

    visible: what region A is chosen from, where it is chosen for least noise.
    """
    if settings.share is not None:
        return stratify(environment, settings.share, settings.strata)
    if not settings.shadowed_residual:
        return _truest(environment, settings)
    radiance = visible.of(environment.radiance) if visible else environment.radiance
    if settings.lights is not None:
        return _calmest(radiance, settings)
    return stratify_calm(luminance(radiance), settings.strata)


def _calmest(radiance: NDArray[np.float32], settings: ConversionSettings) -> Strata:
    """From the border of least noise upwards, as long as noise and wrong shadows become less."""
    whole = light_of_map(radiance)
    lum = luminance(radiance)
    found = borders(lum, sphere.row_solid_angles(whole.width, whole.height))
    best, least = stratify_at(lum, found.best_level, settings.strata), np.inf
    for k in range(found.best, 0, -PER_OCTAVE):
        strata = stratify_at(lum, float(found.level[k]), settings.strata)
        wrong = _error(whole, strata, settings) ** 2
        noise = squared_noise(found.variance[k])
        if wrong + noise < least:
            best, least = strata, wrong + noise
        if noise > least or wrong < noise / 10:
            break
    return best


def _truest(environment: EnvironmentMap, settings: ConversionSettings) -> Strata:
    """The share of least predicted error, where the rest of the map is seen from everywhere."""
    whole = light_of_map(environment.radiance)
    best = stratify(environment, None, settings.strata)
    least, before, rises = _error(whole, best, settings), np.inf, 0
    for share in SHARES:
        if share > MOST_OF_A_WORLD and settings.target == "eevee":
            continue
        strata = stratify(environment, share, settings.strata)
        error = _error(whole, strata, settings)
        if error < least:
            best, least = strata, error
        rises = rises + 1 if error > before else 0
        before = error
        if rises == 2:
            break
    return best


def _error(whole: RegionLight, strata: Strata, settings: ConversionSettings) -> float:
    """Predicted, for as many suns as are allowed."""
    bright, dark = (
        patches_of(part, part.luminous_flux, ROUGH) if len(part.pixels) else None
        for part in _parted(whole, strata)
    )
    unshadowed = None if settings.shadowed_residual else dark
    if bright is None:
        return Prediction.of(None, strata.light, unshadowed).error(()) if unshadowed else 0.0
    suns = edge_suns(bright, strata, settings, settings.lights or USUAL_LIGHTS).suns
    return Prediction.of(bright, strata.light, unshadowed).error(suns)


def _parted(whole: RegionLight, strata: Strata) -> tuple[RegionLight, RegionLight]:
    """About what suns get, and all the rest: what exceeds the mean along region A's border."""
    luminance, region = strata.luminance.ravel(), strata.region_a
    inside = np.flatnonzero(region)
    near = sphere.neighbours(inside, whole.width, whole.height).ravel()
    border = near[~region.ravel()[near]]
    level = luminance[border].mean() if len(border) else 0.0
    excess = np.where(region.ravel(), 1 - level / np.maximum(luminance, 1e-300), 0.0)
    excess = np.maximum(excess, 0)
    size = whole.width, whole.height
    bright = RegionLight(whole.pixels, whole.flux * excess[:, None], *size)
    dark = RegionLight(whole.pixels, whole.flux * (1 - excess)[:, None], *size)
    return bright.part(excess > 0), dark.part((excess < 1) & (luminance > 0))
