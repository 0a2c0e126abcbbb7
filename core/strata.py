"""Strata of accumulated luminance; the bright region A and the rest B (paper, section 3).

Luminance times solid angle is summed in increasing order of luminance. The dark strata, the first
half, hold the share 1 - X of the sum and make up region B; the bright ones hold X and make up A.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap
from .memo import Memo
from .noise import borders
from .sums import weighted_sum


@dataclass(frozen=True, eq=False)
class Strata(Memo):
    """n strata of one map.

    luminance: float64 (height, width).
    bounds: the n - 1 luminances between the strata, rising. A pixel belongs to stratum k (1 is
    the darkest) when its luminance is above k - 1 of them.
    share: the part of all light (solid-angle weighted luminance) that region A holds.
    """

    luminance: NDArray[np.float64]
    bounds: NDArray[np.float64]
    share: float

    @property
    def count(self) -> int:
        return len(self.bounds) + 1

    @cached_property
    def light(self) -> float:
        """Luminance of the whole map's scalar irradiance."""
        height, width = self.luminance.shape
        solid = sphere.row_solid_angles(width, height)
        return float(weighted_sum(solid, self.luminance.sum(axis=1)))

    @cached_property
    def part_on_ground(self) -> float:
        """Irradiance of level ground in the open as a part of all light, and a fortieth at least:
        where all light comes from below, nothing hangs on the ground."""
        height, width = self.luminance.shape
        solid = sphere.row_solid_angles(width, height)
        facing = np.maximum(np.cos(sphere.centroid_angles(width, height)[1]), 0)
        ground = weighted_sum(solid * facing, self.luminance.sum(axis=1))
        return max(float(ground) / self.light, 1 / 40)

    @cached_property
    def square(self) -> float:
        """4 pi (integral of luminance squared) / light^2; 1 for a constant map."""
        height, width = self.luminance.shape
        solid = sphere.row_solid_angles(width, height)
        integral = weighted_sum(solid, (self.luminance**2).sum(axis=1))
        return float(4 * np.pi * integral / self.light**2)

    @property
    def threshold(self) -> float:
        """Luminance above which a pixel belongs to region A."""
        return float(self.bounds[len(self.bounds) // 2])

    @cached_property
    def region_a(self) -> NDArray[np.bool_]:
        """Mask of region A, shape (height, width)."""
        return self.luminance > self.threshold

    def stratum(self, value: float) -> int:
        """The stratum, 1 to n, that a luminance falls into."""
        return int(np.searchsorted(self.bounds, value)) + 1


def stratify(environment: EnvironmentMap, share: float | None, count: int) -> Strata:
    """Cut a map into `count` strata so that region A holds `share` of its light.

    share: 0 (no region A) to 1, or None for the share that leaves a path tracer the least noise
        (see `noise`).
    Pixels of equal luminance stay together, so the share that comes out is the nearest possible.
    """
    lum = environment.luminance
    solid = sphere.row_solid_angles(environment.width, environment.height)
    if share is None:
        return stratify_at(lum, borders(lum, solid).best_level, count)
    levels = environment.once("levels", lambda: _Levels.of(lum, solid))
    return stratify_at(lum, levels.bound_of_share(share), count)


def stratify_at(lum: NDArray[np.float64], threshold: float, count: int) -> Strata:
    """Cut a map of luminance (height, width) into `count` strata, half of them above a border."""
    solid = sphere.row_solid_angles(*lum.shape[::-1])
    if count == 2:
        return Strata(lum, np.array([threshold]), 1 - _part_below(threshold, lum, solid))
    levels = _Levels.of(lum, solid)
    below = levels.below(threshold)
    half = count // 2
    dark = [levels.bound(below * k / half) for k in range(1, half)]
    bright = [levels.bound(below + (1 - below) * k / half) for k in range(1, half)]
    return Strata(lum, np.array([*dark, threshold, *bright]), 1 - below)


def _part_below(threshold: float, lum: NDArray[np.float64], solid: NDArray[np.float64]) -> float:
    dark = weighted_sum(solid, np.where(lum <= threshold, lum, 0.0).sum(axis=1))
    return float(dark / weighted_sum(solid, lum.sum(axis=1)))


@dataclass(frozen=True, eq=False)
class _Levels:
    """Accumulated luminance over a map's distinct luminances, rising; both (k,)."""

    value: NDArray[np.float64]
    accumulated: NDArray[np.float64]

    @classmethod
    def of(cls, lum: NDArray[np.float64], solid: NDArray[np.float64]) -> _Levels:
        value, inverse = np.unique(lum, return_inverse=True)
        light = np.bincount(inverse.ravel(), (lum * solid[:, None]).ravel())
        accumulated = np.cumsum(light)
        return cls(value, accumulated / accumulated[-1])

    def bound(self, part: float) -> float:
        """The level at and below which `part` of all light lies, as nearly as levels allow."""
        with_nothing = np.concatenate([[0.0], self.accumulated])
        nearest = int(np.argmin(np.abs(with_nothing - part)))
        # "-1" lies below every level: nothing is at or below it, black pixels included.
        return float(self.value[nearest - 1]) if nearest else -1.0

    def bound_of_share(self, share: float) -> float:
        """The level above which `share` of all light lies: one level at least, but never all of
        a map that has only one."""
        nearest = self.bound(1 - share)
        if share == 0:
            return float(self.value[-1])
        if nearest == self.value[-1] and len(self.value) > 1:
            return float(self.value[-2])
        return nearest

    def below(self, threshold: float) -> float:
        """Part of all light at and below a luminance."""
        index = int(np.searchsorted(self.value, threshold, side="right"))
        return float(self.accumulated[index - 1]) if index else 0.0
