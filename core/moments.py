"""Sums over many cells at once: what a light that replaces a cell must give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .region import RegionLight

Floats = NDArray[np.float64]

AT_ONCE = 1 << 20
"""Pixels whose directions are held in memory at a time."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over the cells of a light, each made when it is first asked for.

    owner: the cell of each pixel of the light, (p,). count: of cells, n.
    """

    light: RegionLight
    owner: NDArray[np.intp]
    count: int

    @cached_property
    def flux(self) -> Floats:
        """Scalar irradiance of each cell, (n, 3)."""
        channels = [np.bincount(self.owner, one, self.count) for one in self.light.flux.T]
        return np.stack(channels, axis=-1)

    @cached_property
    def luminous_flux(self) -> Floats:
        """Its luminance, (n,)."""
        return np.bincount(self.owner, self.light.luminous_flux, self.count)

    @cached_property
    def area(self) -> Floats:
        """Of each cell's pixels, steradians, (n,)."""
        solid = sphere.row_solid_angles(self.light.width, self.light.height)
        return np.bincount(self.owner, solid[self.light.pixels // self.light.width], self.count)

    @cached_property
    def vector(self) -> Floats:
        """Sum of luminous flux times direction, (n, 3)."""
        total = np.zeros((self.count, 3))
        for part, directions in self._blocks():
            for axis in range(3):
                weighted = directions[:, axis] * self.light.luminous_flux[part]
                total[:, axis] += np.bincount(self.owner[part], weighted, self.count)
        return total

    @cached_property
    def to_light(self) -> Floats:
        """Unit vectors of the mean directions, (n, 3); of the brightest pixel where is none."""
        length = np.linalg.norm(self.vector, axis=1)
        lost = length <= 1e-9 * self.luminous_flux  # light from all sides, or none at all
        unit = self.vector / np.where(lost, 1, length)[:, None]
        if lost.any():
            # Written in rising order of brightness, so the brightest stays; the first of equals.
            order = np.argsort(self.light.luminous_flux[::-1], kind="stable")
            brightest = np.zeros(self.count, np.intp)
            brightest[self.owner[::-1][order]] = self.light.pixels[::-1][order]
            size = self.light.width, self.light.height
            unit[lost] = sphere.pixel_directions(brightest[lost], *size)
        return unit

    @cached_property
    def shortfall(self) -> Floats:
        """1 - R of each cell, (n,); R is the length of its mean direction."""
        apart = np.zeros(self.count)
        for part, directions in self._blocks():
            owner = self.owner[part]
            own = ((directions - self.to_light[owner]) ** 2).sum(axis=1) / 2
            own += self.light.spread(part)
            apart += np.bincount(owner, self.light.luminous_flux[part] * own, self.count)
        lit = self.luminous_flux > 0
        return np.divide(apart, self.luminous_flux, out=np.zeros(self.count), where=lit)

    def _blocks(self) -> Iterator[tuple[slice, Floats]]:
        """Parts of the pixels with their directions."""
        for start in range(0, len(self.light.pixels), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            yield part, self.light.directions(part)
