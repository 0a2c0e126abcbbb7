"""How much of a map becomes suns where the user leaves that to the program.

Cycles shows the residual with its shadows: there the border is put where least noise is left (see
`noise`), and higher where too few suns would stand for too much. EEVEE and game engines light with
the residual from everywhere at once, whatever stands in the way: there more of the map in suns
means truer shadows, until too few suns stand for too much.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap
from .memo import Memo
from .noise import PER_OCTAVE, Borders, borders, squared_noise
from .patches import patches_of
from .placement.edge import edge_suns
from .prediction import Prediction
from .region import RegionLight, light_of_map
from .residual import without
from .settings import ConversionSettings
from .strata import Strata, stratify, stratify_at
from .visible import VisiblePart

SHARES = (1.0, 0.99, 0.95, 0.9, 0.8, 0.65, 0.5, 0.3)
"""What is tried, in this order, after whole peaks with their halo. Between two of them the error is
flat; once it has risen twice, it goes on rising."""

MOST_OF_A_WORLD = 0.99
"""Where the residual is a scene's world: mirrors must have something to show. They show 3 to 15 %
of the light then, as region A keeps what its surroundings shine."""

CLEARLY = 0.98
"""A higher share is taken where it is less wrong by more than this: lamps cost, in every frame."""

ROUGH = 4096
"""Patches with which shares are compared: their order is what counts."""

LITTLE = 10
"""So many times less wrong than noise is, a higher border is not worth looking at."""

USUAL_LIGHTS = 16
"""For as many lights the share is chosen where their number is chosen after it."""


@dataclass(frozen=True, eq=False)
class Seen(Memo):
    """What counts of a map: the luminance of what is visible, (height, width)."""

    environment: EnvironmentMap
    visible: VisiblePart | None

    @cached_property
    def luminance(self) -> NDArray[np.float64]:
        lum = self.environment.luminance
        return self.visible.of(lum) if self.visible else lum

    @cached_property
    def borders(self) -> Borders:
        """That the map could be cut at."""
        solid = sphere.row_solid_angles(*self.luminance.shape[::-1])
        return borders(self.luminance, solid, self.visible.through if self.visible else None)

    def strata(self, level: float, count: int) -> Strata:
        return self.once((level, count), lambda: stratify_at(self.luminance, level, count))


def choose_strata(
    environment: EnvironmentMap, settings: ConversionSettings, visible: VisiblePart | None = None
) -> Strata:
    """The strata for a share that is given or chosen for the map, the lights and the target.

    visible: what region A is chosen from, where it is chosen for least noise.
    """
    if settings.share is not None:
        choice = settings.share, settings.strata
        return environment.latest("strata", choice, lambda: stratify(environment, *choice))
    if not settings.shadowed_residual:
        return _truest(environment, settings)
    part = visible.key if visible else None
    # Scenes with openings ask for both in turn.
    name = "seen through openings" if visible and visible.through else "seen"
    seen = environment.latest(name, part, lambda: Seen(environment, visible))
    if settings.lights is not None:
        return _calmest(seen, settings)
    return seen.strata(seen.borders.best_level, settings.strata)


def _calmest(seen: Seen, settings: ConversionSettings) -> Strata:
    """From the border of least noise upwards, as long as noise and wrong shadows become less."""
    found, environment = seen.borders, seen.environment
    best, least = seen.strata(found.best_level, settings.strata), np.inf
    if not found.best:
        return best
    noise = squared_noise(found.variance[found.best])
    if _error_of_fewer(environment, best, settings) ** 2 < noise / LITTLE:
        return best
    for k in range(found.best, 0, -PER_OCTAVE):
        noise = squared_noise(found.variance[k])
        if noise > least:  # whatever shadows would be wrong by
            break
        strata = seen.strata(float(found.level[k]), settings.strata)
        wrong = _error(environment, strata, settings) ** 2
        if wrong + noise < least:
            best, least = strata, wrong + noise
        if wrong < noise / LITTLE:
            break
    return best


def _error_of_fewer(
    environment: EnvironmentMap, strata: Strata, settings: ConversionSettings
) -> float:
    """At least what is wrong of as many suns as are allowed: of the next lower power of two, which
    another number of them has often been asked for too."""
    fewer = replace(settings, lights=1 << (settings.most_lights.bit_length() - 1))
    return strata.once(
        ("error", fewer.lights, fewer.shape), lambda: _error(environment, strata, fewer)
    )


def _truest(environment: EnvironmentMap, settings: ConversionSettings) -> Strata:
    """The share of least predicted error, where the rest of the map is seen from everywhere."""
    best = stratify(environment, None, settings.strata)
    least, before, rises = _error(environment, best, settings), np.inf, 0
    for share in SHARES:
        if share > MOST_OF_A_WORLD and settings.in_eevee and settings.mirrors:
            continue
        strata = stratify(environment, share, settings.strata)
        error = _error(environment, strata, settings)
        if error < CLEARLY * least:
            best, least = strata, error
        rises = rises + 1 if error > before else 0
        before = error
        if rises == 2:
            break
    return best


def _error(environment: EnvironmentMap, strata: Strata, settings: ConversionSettings) -> float:
    """Predicted, for as many suns as are allowed; for both renderers of both together."""
    bright = strata.once("bright", lambda: _about_region_a(environment, strata))
    unshadowed = None
    if not settings.shadowed_residual:
        rest = light_of_map(without(environment, bright))
        unshadowed = patches_of(rest, rest.luminous_flux, ROUGH)
    eevee = settings.in_eevee
    if not len(bright.pixels):
        nothing = Prediction.of(None, strata.light, unshadowed, eevee)
        return nothing.error(()) if unshadowed else 0.0
    patches = bright.once("rough", lambda: patches_of(bright, bright.luminous_flux, ROUGH))
    prediction = bright.latest(
        "prediction",
        (unshadowed, eevee),
        lambda: Prediction.of(patches, strata.light, unshadowed, eevee),
    )
    suns = edge_suns(patches, strata, settings, settings.lights or USUAL_LIGHTS).suns
    error = prediction.error(suns)
    if settings.target == "both":  # Cycles shows the residual with its shadows
        error = hypot(error, Prediction.of(patches, strata.light).error(suns))
    return error


def _about_region_a(environment: EnvironmentMap, strata: Strata) -> RegionLight:
    """About what suns get: what exceeds the mean along region A's border."""
    width, height = environment.width, environment.height
    lum, region = strata.luminance.ravel(), strata.region_a.ravel()
    inside = np.flatnonzero(region)
    near = sphere.neighbours(inside, width, height).ravel()
    border = near[~region[near]]
    level = lum[border].mean() if len(border) else 0.0
    excess = np.maximum(1 - level / np.maximum(lum[inside], 1e-300), 0)
    solid = sphere.row_solid_angles(width, height)[inside // width]
    flux = environment.radiance.reshape(-1, 3)[inside] * (excess * solid)[:, None]
    return RegionLight(inside, flux, width, height).part(excess > 0)
