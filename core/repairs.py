"""Values that are no light become light that does no harm; what there was is counted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .pixels import Pixels, Planes, Strip, highest_light, planes_of
from .tolerances import HALF_MAXIMUM


@dataclass(frozen=True)
class Repairs:
    """Pixels whose values were no light, counted once each by the worst of their channels."""

    nan: int = 0
    infinite: int = 0
    negative: int = 0
    negative_energy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Scalar irradiance that setting negative values to zero has added, per channel."""

    @property
    def pixels(self) -> int:
        return self.nan + self.infinite + self.negative

    def __str__(self) -> str:
        counts = [(self.nan, "NaN"), (self.infinite, "infinite"), (self.negative, "negative")]
        return ", ".join(f"{count} {name}" for count, name in counts if count) or "none"

    def __add__(self, other: Repairs) -> Repairs:
        energy = np.add(self.negative_energy, other.negative_energy)
        return Repairs(
            self.nan + other.nan,
            self.infinite + other.infinite,
            self.negative + other.negative,
            (float(energy[0]), float(energy[1]), float(energy[2])),
        )


def repair(planes: Planes) -> Repairs:
    """Repair a whole map, (3, height, width), in place; see `repair_planes`."""
    if not any(np.isnan(highest_light(plane)) for plane in planes):
        return Repairs()
    solid = sphere.row_solid_angles(planes.shape[2], planes.shape[1])
    return repair_planes(planes, highest_finite(planes), solid)


def repair_planes(
    planes: Planes,
    highest: NDArray[np.float32],
    solid: NDArray[np.float64],
    halo: tuple[int, int] = (0, 0),
) -> Repairs:
    """Repair rows of a map in place.

    NaN: the mean of the finite neighbours, over the seam too (0 where there are none).
    +Inf: the channel's largest finite value, but at least the largest half, because that is the
    bound that an overflowing half file has passed. Negative values and -Inf: 0.
    highest: finite value of each channel of the whole map, (3,). solid: angle of a pixel of each
    row, (rows,). halo: so many rows at the top and at the bottom are only there as neighbours: they
    are not counted.
    """
    own = slice(halo[0], planes.shape[1] - halo[1])
    if np.isfinite(planes.min()) and np.isfinite(planes.max()):
        return _repair_negative(planes, solid, own)
    negative = planes < 0
    lost = np.where(planes >= -np.finfo(np.float32).max, np.minimum(planes, 0), 0)
    np.maximum(planes, 0, out=planes)  # NaN stays
    nan, infinite = np.isnan(planes), np.isposinf(planes)
    for channel in range(3):
        planes[channel][infinite[channel]] = max(highest[channel], HALF_MAXIMUM)
        _repair_nan(planes[channel], nan[channel])
    has_nan, has_inf, has_negative = (bad[:, own].any(axis=0) for bad in (nan, infinite, negative))
    energy = -lost[:, own].sum(axis=2, dtype=np.float64) @ solid[own]
    return Repairs(
        nan=int(has_nan.sum()),
        infinite=int((has_inf & ~has_nan).sum()),
        negative=int((has_negative & ~has_inf & ~has_nan).sum()),
        negative_energy=(float(energy[0]), float(energy[1]), float(energy[2])),
    )


def _repair_negative(planes: Planes, solid: NDArray[np.float64], own: slice) -> Repairs:
    """The same where nothing else is wrong, which is the usual damage and need not take long."""
    count = int((planes[:, own].min(axis=0) < 0).sum())
    lost = np.minimum(planes[:, own], 0).sum(axis=2, dtype=np.float64)
    energy = -lost @ solid[own]
    np.maximum(planes, 0, out=planes)
    return Repairs(
        negative=count, negative_energy=(float(energy[0]), float(energy[1]), float(energy[2]))
    )


def _repair_nan(plane: NDArray[np.float32], nan: NDArray[np.bool_]) -> None:
    rows, columns = np.nonzero(nan)
    if not len(rows):
        return
    height, width = plane.shape
    total = np.zeros(len(rows))
    count = np.zeros(len(rows))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            near = plane[np.clip(rows + down, 0, height - 1), (columns + right) % width]
            good = ~np.isnan(near)
            total += np.where(good, near, 0.0)
            count += good
    plane[rows, columns] = total / np.maximum(count, 1)


def highest_finite(planes: Planes) -> NDArray[np.float32]:
    """Of each channel, (3,), at least 0."""
    finite = np.where(np.isfinite(planes), planes, 0)
    return np.maximum(finite.max(axis=(1, 2)), 0)


@dataclass(frozen=True, eq=False)
class RepairedPixels:
    """Pixels, a few rows at a time, with what is wrong repaired.

    highest: finite value of each channel, (3,). damaged: whether there is anything to repair.
    """

    raw: Pixels
    highest: NDArray[np.float32]
    damaged: bool

    @property
    def width(self) -> int:
        return self.raw.width

    @property
    def height(self) -> int:
        return self.raw.height

    @property
    def least_rows(self) -> int:
        return self.raw.least_rows

    @property
    def packed_rows(self) -> int:
        return self.raw.packed_rows

    def strips(self, rows: int) -> Iterator[Strip]:
        """See `Pixels`."""
        if not self.damaged:
            yield from self.raw.strips(rows)
            return
        for planes, _ in repaired_strips(self.raw, rows, self.highest):
            yield tuple(planes)


def repaired_strips(
    raw: Pixels, rows: int, highest: NDArray[np.float32]
) -> Iterator[tuple[Planes, Repairs]]:
    """Strips of all pixels, and what was repaired in each; a strip's neighbours are one row above
    and below it."""
    solid = sphere.row_solid_angles(raw.width, raw.height)
    above, waiting, top = None, None, 0
    for strip in chain(raw.strips(rows), [None]):
        below = None if strip is None else planes_of(strip)
        if waiting is not None:
            yield _repaired(above, waiting, below, highest, solid[top : top + waiting.shape[1]])
            top += waiting.shape[1]
        above, waiting = waiting, below


def _repaired(
    above: Planes | None,
    planes: Planes,
    below: Planes | None,
    highest: NDArray[np.float32],
    solid: NDArray[np.float64],
) -> tuple[Planes, Repairs]:
    """Some rows with the neighbours of their first and of their last row."""
    parts = [planes]
    halo = (int(above is not None), int(below is not None))
    if above is not None:
        parts.insert(0, above[:, -1:])
    if below is not None:
        parts.append(below[:, :1])
    whole = np.concatenate(parts, axis=1)
    weights = np.pad(solid, halo, mode="edge")
    repairs = repair_planes(whole, highest, weights, halo)
    return whole[:, halo[0] : whole.shape[1] - halo[1]], repairs
