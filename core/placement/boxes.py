"""Boxes of the map, halved until there are enough: median cut and variance minimisation.

A box is a rectangle of pixels, trimmed to those that shine; boxes do not reach over the seam. As
in both papers all boxes of a level are halved before the next level; where the number wanted is
no power of two, the last level halves those first that the method finds worst.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count as counter

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..moments import Moments
from ..region import RegionLight
from .placement import Placement

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """Rows and columns of a map, the ends excluded."""

    top: int
    bottom: int
    left: int
    right: int

    def of(self, plane: Floats) -> Floats:
        return plane[self.top : self.bottom, self.left : self.right]

    def halves(self, axis: int, at: int) -> tuple[Box, Box]:
        """Cut before the `at`-th row (axis 0) or column (axis 1) of the box."""
        if axis == 0:
            middle = self.top + at
            return (
                Box(self.top, middle, self.left, self.right),
                Box(middle, self.bottom, self.left, self.right),
            )
        middle = self.left + at
        return (
            Box(self.top, self.bottom, self.left, middle),
            Box(self.top, self.bottom, middle, self.right),
        )

    def trimmed(self, plane: Floats) -> Box:
        """Without the rows and columns at its sides that hold no light."""
        lit = self.of(plane) > 0
        rows, columns = np.flatnonzero(lit.any(axis=1)), np.flatnonzero(lit.any(axis=0))
        return Box(
            self.top + int(rows[0]),
            self.top + int(rows[-1]) + 1,
            self.left + int(columns[0]),
            self.left + int(columns[-1]) + 1,
        )


Cut = tuple[int, int]
"""An axis and a place, see `Box.halves`."""


def median_cut(light: RegionLight, count: int) -> Placement:
    """Boxes of equal light, cut across their longer side (Debevec 2005).

    Lengths along a row are scaled by the cosine of the box's latitude.
    """
    plane = light.plane()

    def cut(box: Box) -> Cut | None:
        high, wide = box.bottom - box.top, box.right - box.left
        if high * wide == 1:
            return None
        middle = np.pi * (box.top + box.bottom) / 2 / light.height
        across_row = wide * np.sin(middle) >= high
        axis = 1 if high == 1 or (wide > 1 and across_row) else 0
        before = np.cumsum(box.of(plane).sum(axis=1 - axis))
        return axis, int(np.argmin(np.abs(before[:-1] - before[-1] / 2))) + 1

    return _divided(light, count, plane, cut, lambda box: float(box.of(plane).sum()))


def variance(light: RegionLight, count: int) -> Placement:
    """Boxes whose light is least spread: each cut makes the worse half as good as it can be
    (Viriyothai and Debevec 2009).

    The spread of a box is the sum of flux times squared distance from the mean, on the sphere.
    """
    plane = light.plane()
    azimuth, polar = sphere.centroid_angles(light.width, light.height)
    azimuth_parts = np.stack([np.ones_like(azimuth), np.cos(azimuth), np.sin(azimuth)])
    polar_parts = np.stack([np.ones_like(polar), np.sin(polar), np.cos(polar)])

    def moments(box: Box, axis: int) -> Floats:
        """Flux and its vector sum (x, y, z) of each row or column of a box, (4, k)."""
        rows, columns = slice(box.top, box.bottom), slice(box.left, box.right)
        if axis == 0:
            flux, x, y = np.einsum("ac,rc->ar", azimuth_parts[:, columns], box.of(plane))
            _, ring, up = polar_parts[:, rows]
            return np.stack([flux, x * ring, y * ring, flux * up])
        flux, ring, up = np.einsum("ar,rc->ac", polar_parts[:, rows], box.of(plane))
        _, x, y = azimuth_parts[:, columns]
        return np.stack([flux, x * ring, y * ring, up])

    def cut(box: Box) -> Cut | None:
        best, least = None, np.inf
        for axis, length in ((0, box.bottom - box.top), (1, box.right - box.left)):
            if length == 1:
                continue
            each = moments(box, axis)
            # From either end: what is next to nothing is lost in a difference of two large sums.
            first, second = np.cumsum(each, axis=1), np.cumsum(each[:, ::-1], axis=1)[:, ::-1]
            worse = np.maximum(_spread(first[:, :-1]), _spread(second[:, 1:]))
            at = int(np.argmin(worse))
            if worse[at] < least:
                best, least = (axis, at + 1), worse[at]
        return best

    return _divided(
        light, count, plane, cut, lambda box: float(_spread(moments(box, 0).sum(axis=1)))
    )


def _spread(moments: Floats) -> Floats:
    """Sum of flux times squared distance from the mean of unit vectors: flux - |sum|^2 / flux."""
    flux = np.maximum(moments[0], np.finfo(float).tiny)
    return np.maximum(flux - (moments[1:] ** 2).sum(axis=0) / flux, 0)


def _divided(
    light: RegionLight,
    count: int,
    plane: Floats,
    cut: Callable[[Box], Cut | None],
    badness: Callable[[Box], float],
) -> Placement:
    """Halve boxes, level by level and the worst of a level first; a site where each one's light
    has its mean."""
    order = counter()  # boxes of equal badness in the order in which they were made

    def entry(level: int, box: Box) -> tuple[int, float, int, Box]:
        return level, -badness(box), next(order), box

    whole = Box(0, light.height, 0, light.width).trimmed(plane)
    waiting, done = [entry(0, whole)], []
    while waiting and len(waiting) + len(done) < count:
        level, _, _, box = heapq.heappop(waiting)
        where = cut(box)
        if where is None:
            done.append(box)
            continue
        for half in box.halves(*where):
            heapq.heappush(waiting, entry(level + 1, half.trimmed(plane)))
    boxes = sorted([*done, *(box for *_, box in waiting)], key=lambda box: (box.top, box.left))
    return _placed(light, boxes)


def _placed(light: RegionLight, boxes: list[Box]) -> Placement:
    labels = np.zeros((light.height, light.width), np.int32)
    for number, box in enumerate(boxes):
        box.of(labels)[:] = number
    owner = labels.ravel()[light.pixels].astype(np.intp)
    return Placement(Moments(light, owner, len(boxes)).to_light, light, owner)
