"""The light of region A: what its pixels give to suns."""

from __future__ import annotations

from dataclasses import dataclass, replace
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

    pixels: flat indices, rising, (p,). flux: scalar irradiance of each, float64 (p, 3). given: mean
    direction of the light of each, at most 1 long, (p, 3), where the map was wider and its own
    pixels tell; `step` of those lie along a side of each.
    """

    pixels: NDArray[np.intp]
    flux: Floats
    width: int
    height: int
    given: Floats | None = None
    step: int = 1

    @cached_property
    def luminous_flux(self) -> Floats:
        """Luminance of each pixel's flux, (p,)."""
        return self.flux @ LUMINANCE_WEIGHTS

    def directions(self, part: slice = slice(None)) -> Floats:
        """Unit vectors to where the light of some of the pixels has its mean, (n, 3)."""
        if self.given is None:
            return sphere.pixel_directions(self.pixels[part], self.width, self.height)
        return self.given[part] / np.linalg.norm(self.given[part], axis=1, keepdims=True)

    def spread(self, part: slice = slice(None)) -> Floats:
        """How much the extent of the light of each shortens a sum of directions, (n,); see
        `sphere.pixel_spread`."""
        if self.given is None:
            return self.own_spread(self.pixels[part] // self.width)
        shorter = np.maximum(1 - np.linalg.norm(self.given[part], axis=1), 0)
        return shorter + self.own_spread(self.pixels[part] // self.width)

    def own_spread(self, rows: NDArray[np.intp]) -> Floats:
        """Of one of the map's own pixels in the middle of each of these rows, (n,)."""
        middle = rows * self.step + self.step // 2
        width, height = self.width * self.step, self.height * self.step
        return sphere.pixel_spread(middle * width, width, height)

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
        given = None if self.given is None else self.given[mask]
        return replace(self, pixels=self.pixels[mask], flux=self.flux[mask], given=given)


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
        region = sphere.grown(region)
    pixels = np.flatnonzero(region)
    # In float64 from the float32 that will be stored: the account then closes by itself.
    before = environment.radiance.reshape(-1, 3)[pixels].astype(np.float64)
    radiance = before.copy()
    if fill == "surroundings":
        radiance -= surroundings(environment.radiance, region)
    solid = sphere.row_solid_angles(width, height)
    flux = radiance * solid[pixels // width, None]
    if environment.reduction is None:
        return RegionLight(pixels, flux, width, height)
    light = RegionLight(pixels, flux, width, height, step=environment.own_width // width)
    whole, taken = before @ LUMINANCE_WEIGHTS, radiance @ LUMINANCE_WEIGHTS
    part = np.divide(taken, whole, out=np.zeros_like(whole), where=whole > 0)
    seen = environment.reduction.direction.reshape(-1, 3)[pixels]
    return replace(light, given=_without_even_light(light, seen, part))


MOSTLY = 0.5
"""Part of a pixel's light from which on where it lies is told by what the pixel shows: of less, the
grain of what stays there would tell it."""


def _without_even_light(light: RegionLight, seen: Floats, part: Floats) -> Floats:
    """Mean directions of what is taken from pixels, (p, 3): the rest of their light is even.

    seen: of all of their light, (p, 3). part: of their luminance that is taken, (p,).
    """
    size = light.width, light.height
    shorter = sphere.pixel_spread(light.pixels, *size)
    shorter -= light.own_spread(light.pixels // light.width)
    even = sphere.pixel_directions(light.pixels, *size) * (1 - shorter)[:, None]
    told = (part > MOSTLY)[:, None]
    return np.where(told, even + (seen - even) / np.maximum(part, MOSTLY)[:, None], even)
