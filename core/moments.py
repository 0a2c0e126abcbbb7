"""Sums over many cells at once: what a light that replaces a cell must give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .region import RegionLight

Floats = NDArray[np.float64]

AT_ONCE = 1 << 20
"""Pixels whose directions are held in memory at a time."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Of n cells. flux: scalar irradiance, (n, 3). luminous_flux: its luminance, (n,).

    area: of the pixels, steradians, (n,). to_light: unit vector of the mean direction, (n, 3); of
    the brightest pixel where there is none. shortfall: 1 - R, see `Cell.shortfall`, (n,).
    """

    flux: Floats
    luminous_flux: Floats
    area: Floats
    to_light: Floats
    shortfall: Floats


def moments_of(light: RegionLight, owner: NDArray[np.intp], count: int) -> Moments:
    """Moments of `count` cells; owner: the cell of each pixel of the light, (p,)."""
    flux = np.stack([np.bincount(owner, channel, count) for channel in light.flux.T], axis=-1)
    luminous = np.bincount(owner, light.luminous_flux, count)
    solid = sphere.row_solid_angles(light.width, light.height)
    area = np.bincount(owner, solid[light.pixels // light.width], count)
    to_light = _mean_directions(light, owner, luminous)
    apart = np.zeros(count)
    for part in _blocks(light):
        pixels, weight, of = light.pixels[part], light.luminous_flux[part], owner[part]
        directions = sphere.pixel_directions(pixels, light.width, light.height)
        own = ((directions - to_light[of]) ** 2).sum(axis=1) / 2
        own += sphere.pixel_spread(pixels, light.width, light.height)
        apart += np.bincount(of, weight * own, count)
    shortfall = np.divide(apart, luminous, out=np.zeros(count), where=luminous > 0)
    return Moments(flux, luminous, area, to_light, shortfall)


def _mean_directions(light: RegionLight, owner: NDArray[np.intp], luminous: Floats) -> Floats:
    count = len(luminous)
    total = np.zeros((count, 3))
    for part in _blocks(light):
        directions = sphere.pixel_directions(light.pixels[part], light.width, light.height)
        weighted = directions * light.luminous_flux[part, None]
        for axis in range(3):
            total[:, axis] += np.bincount(owner[part], weighted[:, axis], count)
    length = np.linalg.norm(total, axis=1)
    lost = length <= 1e-9 * luminous  # light from all sides, or none at all
    total[~lost] /= length[~lost, None]
    if lost.any():
        # Written in rising order of brightness, so the brightest stays; the first of equals.
        order = np.argsort(light.luminous_flux[::-1], kind="stable")
        brightest = np.zeros(count, np.intp)
        brightest[owner[::-1][order]] = light.pixels[::-1][order]
        total[lost] = sphere.pixel_directions(brightest[lost], light.width, light.height)
    return total


def _blocks(light: RegionLight) -> list[slice]:
    return [slice(start, start + AT_ONCE) for start in range(0, len(light.pixels), AT_ONCE)]
