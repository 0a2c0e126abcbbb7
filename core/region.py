"""The light of region A: what its pixels give to suns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS, EnvironmentMap
from .memo import Memo
from .settings import Fill
from .strata import Strata
from .surroundings import surroundings

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RegionLight(Memo):
    """The light that some pixels of a map give to suns.

    pixels: flat indices, rising, (p,). flux: scalar irradiance of each, float64 (p, 3).
    """

    pixels: NDArray[np.intp]
    flux: Floats
    width: int
    height: int

    @cached_property
    def luminous_flux(self) -> Floats:
        """Luminance of each pixel's flux, (p,)."""
        return self.flux @ LUMINANCE_WEIGHTS

    def plane(self) -> Floats:
        """Luminous flux on the map, (height, width): luminance corrected by area (paper, 2.1)."""
        plane = np.zeros(self.height * self.width)
        plane[self.pixels] = self.luminous_flux
        return plane.reshape(self.height, self.width)

    @cached_property
    def lit(self) -> RegionLight:
        """The part that shines."""
        return self.part(self.luminous_flux > 0)

    def part(self, mask: NDArray[np.bool_]) -> RegionLight:
        return RegionLight(self.pixels[mask], self.flux[mask], self.width, self.height)


def light_of_map(radiance: NDArray[np.float32]) -> RegionLight:
    """All light of a map, (height, width, 3)."""
    height, width = radiance.shape[:2]
    solid = np.repeat(sphere.row_solid_angles(width, height), width)
    flux = radiance.reshape(-1, 3) * solid[:, None]
    return RegionLight(np.arange(height * width), flux, width, height)


def light_of_region_a(environment: EnvironmentMap, strata: Strata, fill: Fill) -> RegionLight:
    """What region A gives away: all of its light, or what it shines above its surroundings.

    Above its surroundings it is taken with one pixel around it, as that holds a light's blurred
    rim, which would be left as a bright ring and raise what is filled in.
    """
    width, height = environment.width, environment.height
    region = strata.region_a
    if fill == "surroundings":
        region = sphere.grow_groups(region.astype(np.int32), strata.luminance) > 0
    pixels = np.flatnonzero(region)
    # In float64 from the float32 that will be stored: the account then closes by itself.
    radiance = environment.radiance.reshape(-1, 3)[pixels].astype(np.float64)
    if fill == "surroundings":
        radiance -= surroundings(environment.radiance, region)
    solid = sphere.row_solid_angles(width, height)
    return RegionLight(pixels, radiance * solid[pixels // width, None], width, height)
