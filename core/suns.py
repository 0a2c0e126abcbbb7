"""Suns: directional lights that stand for cells of the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cells import Cell


@dataclass(frozen=True, eq=False)
class Sun:
    """A uniform disc at infinity.

    to_light: unit vector from the scene to the disc's centre, (3,).
    irradiance: on a surface that faces the centre, linear Rec.709, (3,); a lamp's strength.
    scalar_irradiance: radiance integrated over the disc, (3,); what the account adds up.
    angular_diameter: radians, up to pi. stratum: of the brightest pixel, 1 the darkest.
    """

    to_light: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    scalar_irradiance: NDArray[np.float64]
    angular_diameter: float
    stratum: int

    @property
    def radiance(self) -> NDArray[np.float64]:
        """Radiance of the disc, (3,)."""
        return self.scalar_irradiance / (4 * np.pi * np.sin(self.angular_diameter / 4) ** 2)


def disc_sun(cell: Cell, stratum: int) -> Sun:
    """The disc whose total, mean direction and second moment are the cell's.

    A cap of half-angle a gives a facing surface (1 + cos a) / 2 of its scalar irradiance.
    """
    diameter = cell.angular_diameter
    scalar = cell.flux.sum(axis=0)
    return Sun(
        to_light=cell.to_light,
        irradiance=scalar * (1 + np.cos(diameter / 2)) / 2,
        scalar_irradiance=scalar,
        angular_diameter=diameter,
        stratum=stratum,
    )
