"""How much of a map becomes suns where the user leaves that to the program.

Cycles shows the residual with its shadows: there the share is what makes the residual calm (see
`strata.calm_threshold`). EEVEE and game engines light with it from everywhere at once, whatever
stands in the way: there more of the map in suns means truer shadows, until too few suns stand for
too much.
"""

from __future__ import annotations

import numpy as np

from . import sphere
from .environment import EnvironmentMap
from .patches import patches_of
from .placement.edge import edge_suns
from .prediction import Prediction
from .region import RegionLight, light_of_map
from .settings import ConversionSettings
from .strata import Strata, stratify

SHARES = (1.0, 0.95, 0.9, 0.8, 0.65, 0.5, 0.3)
"""What is tried, in this order, after whole peaks with their halo. Between two of them the error is
flat; once it has risen twice, it goes on rising."""

MOST_OF_A_WORLD = 0.95
"""Where the residual is a scene's world: mirrors must have something to show."""

ROUGH = 4096
"""Patches with which shares are compared: their order is what counts."""

USUAL_LIGHTS = 16
"""For as many lights the share is chosen where their number is chosen after it."""


def choose_strata(environment: EnvironmentMap, settings: ConversionSettings) -> Strata:
    """The strata for a share that is given or chosen for the map, the lights and the target."""
    if settings.share is not None or settings.shadowed_residual:
        return stratify(environment, settings.share, settings.strata)
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
    """Predicted, with the rest of the map seen from everywhere."""
    bright, dark = (
        patches_of(part, part.luminous_flux, ROUGH) if len(part.pixels) else None
        for part in _parted(whole, strata)
    )
    if bright is None:
        return Prediction.of(None, strata.light, dark).error(())
    suns = edge_suns(bright, strata, settings, settings.lights or USUAL_LIGHTS).suns
    return Prediction.of(bright, strata.light, dark).error(suns)


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
