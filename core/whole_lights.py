"""Which bright spots become suns where the program chooses: those that would make noise.

Cycles shows what stays in the residual with its shadows, so nothing is lost there; but a bright
speck that only chance hits is noise. A path tracer that samples by surfaces has, for a residual of
luminance R and a map with all light F, the relative variance 4 pi (integral of R^2) / F^2 less the
square of what R adds (`noise` is more exact, and slower to ask for one speck after the other).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .memo import Memo
from .noise import OTHERWISE, squared_noise
from .placement.choice import choose_suns
from .placement.placement import ChosenSuns
from .region import RegionLight
from .settings import ConversionSettings
from .strata import Strata
from .visible import VisiblePart

Floats = NDArray[np.float64]

AS_CALM = 1.25
"""So much more variance, in all, than without any spot is not worth more suns."""


@dataclass(frozen=True, eq=False)
class WholeLights(Memo):
    """The connected groups of region A, the brightest first.

    light: of all of them, rims included. rank: of each of its pixels' group, (p,). flux: luminous,
    of each group as a part of all light, (g,). variance: of the residual with the first 0, 1, ...
    g groups taken out, (g + 1,).
    """

    light: RegionLight
    rank: NDArray[np.intp]
    flux: Floats
    variance: Floats

    @property
    def noisy(self) -> int:
        """How many of the brightest must be taken out, so that the residual is calm."""
        variance = self.variance + OTHERWISE
        return int(np.argmax(variance <= AS_CALM * variance[-1]))

    def brightest(self, count: int) -> RegionLight:
        return self.once(count, lambda: self.light.part(self.rank < count))

    def note(self, count: int, why: str) -> tuple[str, ...]:
        """A sentence about those that are not among the brightest `count`."""
        left = self.flux[count:]
        left = left[left > 0]
        if not len(left):
            return ()
        spots = "1 bright spot" if len(left) == 1 else f"{len(left)} bright spots"
        return (f"{spots} with {left.sum():.2%} of all light stay in the residual: {why}.",)


def suns_for_whole_lights(
    light: RegionLight,
    strata: Strata,
    settings: ConversionSettings,
    visible: VisiblePart | None = None,
) -> tuple[RegionLight, ChosenSuns, tuple[str, ...]]:
    """The light that suns replace, those suns, and what the user should know of the rest. visible:
    see `choose_suns`.

    Where as many suns as were asked for stand for it only badly, half of the spots at a time are
    left in the residual, down to one for each sun, if noise is the lesser evil.
    """
    groups = light.once("whole lights", lambda: whole_lights(light, strata))
    lights, least = settings.most_lights, np.inf
    counts = _fewer_and_fewer(groups.noisy, lights)
    noise = [squared_noise(groups.variance[count] + OTHERWISE) for count in counts]
    for k, count in enumerate(counts):
        if min(noise[k:]) >= least:  # however well suns stand for the rest
            break
        chosen = choose_suns(groups.brightest(count), strata, settings, visible=visible)
        evil = chosen.predicted_error**2 + noise[k]
        if evil < least:
            best, least = (count, chosen), evil
        if chosen.predicted_error <= settings.tolerated / 100:
            break
    count, chosen = best
    why = "too faint to make noise"
    if count < groups.noisy:
        why = f"beyond the limit of {lights} lights"
    return groups.brightest(count), chosen, groups.note(count, why)


def _fewer_and_fewer(count: int, lights: int) -> list[int]:
    """A count, half of it, ... down to a number of lights, or the count alone if that is less."""
    counts = [count]
    while counts[-1] > lights:
        counts.append(max(counts[-1] // 2, lights))
    return counts


def whole_lights(light: RegionLight, strata: Strata) -> WholeLights:
    """Group the light of region A."""
    labels, count = sphere.connected_groups(strata.region_a)
    if len(light.pixels) > np.count_nonzero(labels):
        labels = sphere.grow_groups(labels, strata.luminance)
    owner = labels.ravel()[light.pixels] - 1
    flux = np.bincount(owner, light.luminous_flux, count) / strata.light
    order = np.argsort(-flux, kind="stable")
    rank = np.empty(count, np.intp)
    rank[order] = np.arange(count)
    squares = np.bincount(owner, _squares_taken(light, strata), count)[order]
    left = 1 - np.concatenate([[0], np.cumsum(flux[order])])
    variance = strata.square - np.concatenate([[0], np.cumsum(squares)]) - left**2
    return WholeLights(light, rank[owner], flux[order], variance)


def _squares_taken(light: RegionLight, strata: Strata) -> Floats:
    """What each pixel takes from 4 pi (integral of R^2) / F^2 if its light is taken out, (p,)."""
    solid = sphere.row_solid_angles(light.width, light.height)[light.pixels // light.width]
    before = strata.luminance.ravel()[light.pixels]
    after = np.maximum(before - light.luminous_flux / solid, 0)
    return 4 * np.pi * solid * (before**2 - after**2) / strata.light**2
