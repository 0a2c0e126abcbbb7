"""All pixels of a map, a few rows at a time: a wide one need not be held whole."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Strip = tuple[NDArray[np.floating], ...]
"""Some rows of a map: red, green and blue, (rows, width) each, of the type that they come in."""

Planes = NDArray[np.float32]
"""The same, (3, rows, width)."""


class Pixels(Protocol):
    """Of a map of any size, linear Rec.709, rows downwards."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def least_rows(self) -> int:
        """Strips must have a multiple of so many."""
        ...

    @property
    def packed_rows(self) -> int:
        """A file packs so many together: what takes fewer at a time unpacks them more than once."""
        ...

    def strips(self, rows: int) -> Iterator[Strip]:
        """From the top, so many rows at a time (fewer at the end): red, green and blue,
        (rows, width) each, of any type of number."""
        ...


@dataclass(frozen=True)
class MapSize:
    """What a file's header says of its map. held: its pixels can only be read all at once."""

    width: int
    height: int
    held: bool


@dataclass(frozen=True, eq=False)
class HeldPixels:
    """Pixels that are in memory. planes: red, green and blue, (height, width) each."""

    planes: Strip

    @classmethod
    def of(cls, radiance: NDArray[np.floating]) -> HeldPixels:
        """Of a map, (height, width, 3)."""
        return cls(tuple(np.moveaxis(radiance, -1, 0)))

    @property
    def width(self) -> int:
        return self.planes[0].shape[1]

    @property
    def height(self) -> int:
        return self.planes[0].shape[0]

    @property
    def least_rows(self) -> int:
        return 1

    @property
    def packed_rows(self) -> int:
        return 1

    def strips(self, rows: int) -> Iterator[Strip]:
        for top in range(0, self.height, rows):
            yield tuple(plane[top : top + rows] for plane in self.planes)


def whole(pixels: Pixels) -> NDArray[np.float32]:
    """All of them at once, (height, width, 3)."""
    planes = planes_of(next(pixels.strips(pixels.height)))
    return np.ascontiguousarray(np.moveaxis(planes, 0, -1))


def copy_as_float64(plane: NDArray[np.floating], out: NDArray[np.float64]) -> None:
    """Copy numbers of any type, halfs only if finite, into an array of that shape."""
    if plane.dtype == np.float16:
        out[...] = _as_single(plane)
    else:
        out[...] = plane


def planes_of(strip: Strip) -> Planes:
    """A copy of some rows."""
    planes = np.empty((3, *strip[0].shape), np.float32)
    for plane, out in zip(strip, planes, strict=True):
        if plane.dtype == np.float16 and _is_finite(plane):
            out[...] = _as_single(plane)
            continue
        # What float32 cannot hold becomes infinite, and a signalling NaN an ordinary one.
        with np.errstate(over="ignore", invalid="ignore"):
            out[...] = plane
    return planes


HALF_IN_SINGLE = np.float32(2.0**112)
"""The bits of a half float mean so much less in the place of those of a float32."""

SIGN_AND_REST = np.int32(-0x70000001)
"""All bits but the three between the sign and what a half's exponent becomes."""


def _is_finite(plane: NDArray[np.float16]) -> bool:
    return bool((plane.view(np.uint16) & 0x7FFF).max() < 0x7C00)


def _as_single(plane: NDArray[np.float16]) -> NDArray[np.float32]:
    """Finite halfs with their bits moved to where a float32 has them: several times faster than
    casting, and as exact."""
    bits = plane.view(np.int16).astype(np.int32)  # the sign fills all bits from its own upwards
    np.left_shift(bits, 13, out=bits)
    bits &= SIGN_AND_REST
    singles = bits.view(np.float32)
    return np.multiply(singles, HALF_IN_SINGLE, out=singles)


def highest_light(plane: NDArray[np.floating]) -> float:
    """The largest number; nan unless all are finite as float32 and not below 0 (or -0)."""
    if plane.dtype == np.float16:  # as integers they are in the same order, and compared faster
        highest = int(plane.view(np.uint16).max())
        return float(np.uint16(highest).view(np.float16)) if highest < 0x7C00 else np.nan
    if plane.dtype == np.float32:
        bits = plane.view(np.uint32).max()
        return float(bits.view(np.float32)) if bits < 0x7F800000 else np.nan
    highest = float(plane.max())  # carries nan along
    return highest if plane.min() >= 0 and highest <= np.finfo(np.float32).max else np.nan
