"""Suns: directional lights that stand for cells of the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Sun:
    """A uniform disc at infinity, or a point.

    to_light: unit vector from the scene to the disc's centre, (3,).
    irradiance: on a surface that faces the centre, linear Rec.709, (3,); a lamp's strength.
    scalar_irradiance: radiance integrated over the disc, (3,); what the account adds up.
    angular_diameter: radians, 0 (a point) up to pi. stratum: of the brightest pixel, 1 the darkest.
    """

    to_light: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    scalar_irradiance: NDArray[np.float64]
    angular_diameter: float
    stratum: int

    @property
    def radiance(self) -> NDArray[np.float64]:
        """Radiance of the disc, (3,); a point has none."""
        return self.scalar_irradiance / (4 * np.pi * np.sin(self.angular_diameter / 4) ** 2)


def disc_sun(
    flux: NDArray[np.float64], to_light: NDArray[np.float64], shortfall: float, stratum: int
) -> Sun:
    """The disc whose total, mean direction and second moment are those of a cell.

    flux: scalar irradiance, (3,). shortfall: 1 - R, where R is the length of the cell's
    mean direction. A cap of half-angle a gives a
    facing surface (1 + cos a) / 2 of its scalar irradiance.
    """
    diameter = float(disc_diameter(shortfall))
    return Sun(to_light, flux * (1 + np.cos(diameter / 2)) / 2, flux, diameter, stratum)


def disc_diameter(shortfall: ArrayLike) -> NDArray[np.float64]:
    """Diameters in radians, at most pi, of uniform discs by their 1 - R.

    Such a disc has R = (1 + cos a) / 2, so a = 2 asin sqrt(1 - R); a hemisphere at most.
    """
    return np.minimum(4 * np.arcsin(np.sqrt(np.minimum(shortfall, 0.5))), np.pi)


def disc_on_ground(height: ArrayLike, half_angle: ArrayLike) -> NDArray[np.float64]:
    """Mean over each disc of what level ground gets: the cosine, 0 below the horizon.

    height: of its middle, the sine of the elevation. half_angle: radians, 0 for a point.
    """
    height, half_angle = np.asarray(height)[..., None, None], np.asarray(half_angle)
    along = 1 - _RINGS * 2 * np.sin(half_angle[..., None, None] / 2) ** 2
    aside = np.sqrt((1 - along**2) * np.maximum(1 - height**2, 0))
    return np.maximum(along * height + aside * _AROUND, 0).mean(axis=(-2, -1))


_RINGS = ((np.arange(8) + 0.5) / 8)[:, None]
_AROUND = np.cos((np.arange(16) + 0.5) / 16 * np.pi)
"""A disc as rings of equal area and places around each; the other half is alike."""


def point_sun(flux: NDArray[np.float64], to_light: NDArray[np.float64], stratum: int) -> Sun:
    """A light of no width (paper, 2.2): all of a cell's light from one direction."""
    return Sun(to_light, flux, flux, 0.0, stratum)
