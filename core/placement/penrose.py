"""Importance sampling by Penrose tiling: blue noise of any density, without chance.

Ostromoukhov, Donohue, Jodoin: Fast Hierarchical Importance Sampling with Blue Noise Properties,
SIGGRAPH 2004. In the paper a point of value v is a sample where the importance, times a
magnitude, reaches v. Here the magnitude is not searched for: a point is a sample from the
magnitude (v + 1/2) / importance on, so the points where this ratio is least are the samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..region import RegionLight
from .penrose_table import CORRECTIONS
from .penrose_tiles import DEEPEST, DENSITY, FIBONACCI, PHI, UNIT, Tiles, subdivide
from .placement import Placement

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

PHASES = 21
"""Steps of importance from one level of the tiling to the next, each with its corrections."""

STRUCTURES = FIBONACCI[8]
"""Kinds of neighbourhood that the six newest digits of a point's code tell apart."""

_BORDERS = np.array(
    [
        (PHI ** (2 * (level + phase / PHASES)) - 1) / math.sqrt(5)
        for level in range(DEEPEST + 1)
        for phase in range(PHASES)
    ]
)
"""Importance at which each phase of each level begins; level n begins near F(2n)."""


def penrose(light: RegionLight, count: int) -> Placement:
    """Samples as dense on the map as its light, pixels weighted by their area on the sphere."""
    x, y = penrose_points(light.plane(), count).T
    return Placement(sphere.to_directions(x / light.width, y / light.height), light)


def penrose_points(importance: Floats, count: int) -> Floats:
    """Exactly `count` positions (x, y) in pixels, y downwards, as dense as the importance asks.

    importance: (height, width), finite, nonnegative, of any scale, constant over each pixel.
    Every position lies in a pixel with importance. They come in the order in which they appear
    as count grows: a larger count begins with the same points of the tiling, each moved a little
    differently. Returns float64 (count, 2). ValueError where no pixel has importance.
    """
    return sample(importance, count).position


@dataclass(frozen=True, eq=False)
class Samples:
    """base: the tiling's own points, (n, 2). position: where corrections move them, (n, 2).

    ratio: the magnitudes from which on each is a sample, rising, for importance 1 at the peak.
    """

    base: Floats
    position: Floats
    ratio: Floats


def sample(importance: Floats, count: int, corrected: bool = True) -> Samples:
    """What `penrose_points` gives, with what it comes from; with corrections or without."""
    if not count:
        return Samples(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    field = ImportanceField.of(importance)
    points = field.first_points(count)
    here = field.at(points.position)
    ratio = (points.value + 0.5) / here
    order = np.lexsort((points.value, ratio))[:count]
    points, ratio = points[order], ratio[order]
    moved = points.position
    if corrected:
        places = locate(points, ratio[-1] * here[order])
        moved = moved + field.scale * places.offset(CORRECTIONS)
        # The vectors are made for even importance: none may carry a point out of a small sun,
        # or into one, where density differs by more than a whole level of the tiling.
        change = field.at(moved) / here[order]
        moved = np.where((change >= PHI**-2) & (change <= PHI**2), moved, points.position)
    return Samples(_pairs(points.position), _pairs(moved), ratio)


def _pairs(positions: Complexes) -> Floats:
    return positions.view(np.float64).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class Places:
    """Where points stand in the tiling at their importance.

    level: the deepest of their surroundings. phase, structure: indices of a correction.
    direction: complex unit vector of their frame. scale: of that level, for a root of 1.
    All (n,).
    """

    level: NDArray[np.intp]
    phase: NDArray[np.intp]
    structure: NDArray[np.intp]
    direction: Complexes
    scale: Floats

    def offset(self, corrections: Floats) -> Complexes:
        """Movements for a root of scale 1; corrections: (PHASES, STRUCTURES, 2)."""
        u, w = corrections[self.phase, self.structure].T
        x, y = self.direction.real, self.direction.imag
        moved = np.empty(len(u), np.complex128)
        moved.real = self.scale * (x * u - y * w)
        moved.imag = self.scale * (y * u + x * w)
        return moved


def locate(points: Tiles, importance: Floats) -> Places:
    """The correction that each point takes; importance: where it lies, magnitude included, (n,).

    The importance must exceed the point's value. A point, once born, turns by 180 degrees with
    every second level.
    """
    index = np.searchsorted(_BORDERS, importance, side="right") - 1
    level, phase = np.divmod(index, PHASES)
    # Beyond 2**53 rounding may put an importance below the level that its point was born at.
    level = np.maximum(level, points.level)
    turned = points.direction + 10 * ((level - points.level) // 2)
    scale = np.array([PHI**-n for n in range(DEEPEST + 1)])
    return Places(level, phase, _structure(points.value, level), UNIT[turned % 20], scale[level])


def _structure(value: NDArray[np.int64], level: NDArray[np.intp]) -> NDArray[np.intp]:
    """The six newest digits of values in Fibonacci code at these levels, as a number below 21."""
    # F(1) and F(0) are no digits.
    digits = np.array([0, 0, *FIBONACCI[2 : 2 * DEEPEST + 2]])
    rest, structure = value.copy(), np.zeros(len(value), np.intp)
    for place in range(6):
        digit = digits[np.maximum(2 * level + 1 - place, 0)]
        has = (digit > 0) & (rest >= digit)
        rest -= np.where(has, digit, 0)
        structure += np.where(has, FIBONACCI[7 - place], 0)
    return structure


@dataclass(frozen=True, eq=False)
class ImportanceField:
    """Importance over the plane, and its maxima over blocks of pixels.

    pyramid: the pixels, then the maxima of 2 x 2, of 4 x 4 and so on, down to one. Importance is
    given out as a part of its peak, so that neither huge nor tiny maps overflow.
    """

    pyramid: list[Floats]
    peak: float

    @classmethod
    def of(cls, importance: Floats) -> ImportanceField:
        pyramid = [np.asarray(importance, dtype=np.float64)]
        while pyramid[-1].size > 1:
            pyramid.append(_halved(pyramid[-1]))
        peak = float(pyramid[-1][0, 0])
        if not 0 < peak < math.inf:
            raise ValueError(f"no pixel has finite importance above 0 (peak {peak})")
        return cls(pyramid, peak)

    @property
    def scale(self) -> float:
        """Scale of the root, pixels."""
        return 2.0 * max(self.pyramid[0].shape)

    def total(self) -> float:
        pixels = self.pyramid[0]
        rows = max(1, 2**20 // pixels.shape[1])
        parts = (pixels[row : row + rows] for row in range(0, len(pixels), rows))
        return sum(float((part / self.peak).sum()) for part in parts)

    def at(self, positions: Complexes) -> Floats:
        """Importance at positions, (n,); 0 outside of the map."""
        height, width = self.pyramid[0].shape
        x, y = positions.real, positions.imag
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        found = np.zeros(len(positions))
        column, row = x[inside].astype(np.intp), y[inside].astype(np.intp)
        found[inside] = self.pyramid[0][row, column] / self.peak
        return found

    def most(self, low: Complexes, high: Complexes, width: float) -> Floats:
        """At least the greatest importance in boxes no wider than this, (n,); 0 outside.

        Blocks are as wide as the boxes or wider, so four of them cover one.
        """
        # Positions err by rounding, 45 times 2**-52 scales at most; a box must not lose its point.
        slack = self.scale * 2.0**-40
        number = min(max(math.ceil(math.log2(width + 2 * slack)), 0), len(self.pyramid) - 1)
        blocks, size = self.pyramid[number], 2.0**number
        ends = []
        for lowest, highest, limit in (
            (low.imag, high.imag, self.pyramid[0].shape[0]),
            (low.real, high.real, self.pyramid[0].shape[1]),
        ):
            first, last = np.clip([lowest - slack, highest + slack], -1, limit)
            ends.append((first, last, (last >= 0) & (first < limit)))
        (top, bottom, rows_meet), (left, right, columns_meet) = ends
        found = np.zeros(len(low))
        meet = rows_meet & columns_meet
        rows, columns = (
            np.clip(np.stack([first[meet], last[meet]]) / size, 0, length - 1).astype(np.intp)
            for first, last, length in zip((top, left), (bottom, right), blocks.shape, strict=True)
        )
        found[meet] = blocks[rows[:, None], columns[None, :]].max(axis=(0, 1)) / self.peak
        return found

    def points(self, magnitude: float) -> Tiles:
        """All points (v + 1/2) / importance <= magnitude, in no special order."""
        levels = [Tiles.empty()]
        for points in subdivide(
            self.scale,
            # So that the triangle covers the map, its base a quarter of the map above it.
            -self.scale * complex(PHI**2 / 2 - 0.25, 0.125),
            lambda low, high, width: magnitude * self.most(low, high, width),
        ):
            reached = magnitude * self.at(points.position) >= points.value + 0.5
            levels.append(points[reached])
        return Tiles.joined(levels)

    def first_points(self, count: int) -> Tiles:
        """The `count` points of the least ratios, and some more."""
        deepest = float(FIBONACCI[2 * DEEPEST + 2])
        wanted = count + 3 * math.sqrt(count) + 8
        magnitude = wanted * self.scale**2 / (DENSITY * self.total())
        while True:
            points = self.points(min(magnitude, deepest))
            if len(points) >= count:
                return points
            if magnitude >= deepest:
                raise ValueError(f"{count} samples are more than the tiling can place here")
            magnitude *= min(max(1.1 * wanted / (len(points) + 1), 1.2), 8.0)


def _halved(values: Floats) -> Floats:
    """Maxima of blocks of 2 x 2; an odd last row or column stands alone."""
    odd = [(0, length % 2) for length in values.shape]
    values = np.pad(values, odd, "edge") if any(end for _, end in odd) else values
    rows = np.maximum(values[::2], values[1::2])
    return np.maximum(rows[:, ::2], rows[:, 1::2])
