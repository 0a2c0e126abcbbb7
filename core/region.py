"""The light of region A: what its pixels give to suns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS, EnvironmentMap
from .settings import ConversionSettings, Fill
from .strata import Strata
from .surroundings import surroundings

Floats = NDArray[np.float64]

SMALLEST_SUN = 0.005
"""Part of all light below which the automatic choice makes no sun: nobody would see its shadow."""


@dataclass(frozen=True, eq=False)
class RegionLight:
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


def light_for_suns(
    environment: EnvironmentMap, strata: Strata, settings: ConversionSettings
) -> tuple[RegionLight, tuple[str, ...]]:
    """The light that suns replace, and what the user should know of light that they do not.

    It is all of region A, but where the program chooses the share and whole lights: then specks,
    and what exceeds the number of lights, stay in the residual, where nothing is lost.
    """
    light = light_of_region_a(environment, strata, settings.filled)
    if settings.method != "edge" or settings.share is not None or not len(light.pixels):
        return light, ()
    return _whole_lights(light, strata, settings.most_lights)


def _whole_lights(
    light: RegionLight, strata: Strata, most: int
) -> tuple[RegionLight, tuple[str, ...]]:
    """The light of the `most` brightest connected groups of region A, rims included."""
    labels, count = sphere.connected_groups(strata.region_a)
    if len(light.pixels) > np.count_nonzero(labels):
        labels = sphere.grow_groups(labels, strata.luminance)
    owner = labels.ravel()[light.pixels] - 1
    flux = np.bincount(owner, light.luminous_flux, count) / strata.light
    order = np.argsort(-flux, kind="stable")
    seen = np.count_nonzero(flux >= SMALLEST_SUN)
    kept = np.zeros(count, bool)
    kept[order[: min(seen, most)]] = True
    notes = (
        *_left_out(flux[order[seen:]], f"each below {SMALLEST_SUN:.1%}"),
        *_left_out(flux[order[:seen][most:]], f"beyond the limit of {most} lights"),
    )
    return light.part(kept[owner]), notes


def _left_out(flux: Floats, why: str) -> list[str]:
    """A sentence about groups that hold these parts of all light."""
    flux = flux[flux > 0]
    if not len(flux):
        return []
    spots = "1 bright spot" if len(flux) == 1 else f"{len(flux)} bright spots"
    return [f"{spots} with {flux.sum():.2%} of all light stay in the residual: {why}."]
