"""Cells: the light of some pixels that one sun shall replace, and how well a disc replaces it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS

Floats = NDArray[np.float64]

EDGE_ANGLES = 8
"""Directions from which a shadow edge is drawn across a cell to predict its error."""

EDGE_BINS = 256
"""Positions of that edge: fine against a disc, as no disc holds less than a few bins of them."""


@dataclass(frozen=True, eq=False)
class Cell:
    """The light that some pixels give away.

    pixels: flat indices, (n,). flux: scalar irradiance of each, float64 (n, 3).
    directions: unit vectors to their centres, (n, 3). spread: see `sphere.pixel_spread`, (n,).
    """

    pixels: NDArray[np.intp]
    flux: Floats
    directions: Floats
    spread: Floats

    @classmethod
    def of(cls, pixels: NDArray[np.intp], flux: Floats, width: int, height: int) -> Cell:
        directions = sphere.pixel_directions(pixels, width, height)
        return cls(pixels, flux, directions, sphere.pixel_spread(pixels, width, height))

    def part(self, mask: NDArray[np.bool_]) -> Cell:
        return Cell(self.pixels[mask], self.flux[mask], self.directions[mask], self.spread[mask])

    @cached_property
    def luminous_flux(self) -> Floats:
        """Luminance of each pixel's flux, (n,): what weighs directions."""
        return self.flux @ LUMINANCE_WEIGHTS

    @cached_property
    def total(self) -> float:
        """Luminance of the scalar irradiance of the whole cell."""
        return float(self.luminous_flux.sum())

    @cached_property
    def to_light(self) -> Floats:
        """Unit vector of the cell's mean direction (its brightest pixel's where none exists)."""
        mean = self.luminous_flux @ self.directions
        length = np.linalg.norm(mean)
        if length <= 1e-9 * self.total:
            return self.directions[np.argmax(self.luminous_flux)]
        return mean / length

    @cached_property
    def shortfall(self) -> float:
        """1 - R, where R is the length of the mean direction; written so that nothing cancels."""
        apart = ((self.directions - self.to_light) ** 2).sum(axis=1) / 2 + self.spread
        return float(self.luminous_flux @ apart) / self.total

    @property
    def angular_diameter(self) -> float:
        """Diameter in radians of the uniform disc with the cell's moments."""
        return disc_diameter(self.shortfall)

    def misfit(self) -> float:
        """Predicted shadow-edge error of a disc in the place of this cell, times its light.

        A straight shadow edge at any position over the hemisphere and from any side lets through
        F of the cell's flux and G of the disc's. The root of the mean of (F - G)^2, times the
        cell's luminous flux: what the picture is wrong by, in scalar irradiance.
        """
        if self.shortfall >= 0.5:
            return self.total
        radius = np.sin(self.angular_diameter / 2)
        across = self.directions @ np.stack(sphere.tangents(self.to_light), axis=-1)
        turns = np.arange(EDGE_ANGLES) * (np.pi / EDGE_ANGLES)
        squares = [
            _edge_difference(across @ [np.cos(turn), np.sin(turn)], self.luminous_flux, radius)
            for turn in turns
        ]
        return self.total * float(np.sqrt(np.mean(squares) / 2))


def disc_diameter(shortfall: float) -> float:
    """Diameter in radians, at most pi, of a uniform disc by its 1 - R.

    Such a disc has R = (1 + cos a) / 2, so a = 2 asin sqrt(1 - R); a hemisphere at most.
    """
    return min(4 * float(np.arcsin(np.sqrt(min(shortfall, 0.5)))), np.pi)


def _edge_difference(position: Floats, flux: Floats, radius: float) -> float:
    """Integral over an edge's position t of (F_cell(t) - G_disc(t))^2."""
    reach = max(float(np.abs(position).max()), radius) * (1 + 1e-9)
    step = 2 * reach / EDGE_BINS
    index = ((position + reach) / step).astype(np.intp)
    light = np.bincount(index, flux, minlength=EDGE_BINS)[:EDGE_BINS]
    # Up to the middle of each bin, as half of the bin's flux lies before it.
    before = (np.cumsum(light) - light / 2) / light.sum()
    z = np.clip((-reach + step * (np.arange(EDGE_BINS) + 0.5)) / radius, -1, 1)
    disc = 0.5 + (z * np.sqrt(1 - z * z) + np.arcsin(z)) / np.pi
    return float(((before - disc) ** 2).sum() * step)


def split(cell: Cell) -> tuple[Cell, ...]:
    """A cell cut in two at its mean, across its longest axis; nothing where it cannot be cut."""
    weight = cell.luminous_flux
    mean = weight @ cell.directions / cell.total
    offset = cell.directions - mean
    _, axes = np.linalg.eigh((offset * weight[:, None]).T @ offset)
    first = offset @ axes[:, -1] < 0
    if not weight[first].any() or not weight[~first].any():
        return ()
    return cell.part(first), cell.part(~first)
