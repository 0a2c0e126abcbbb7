"""All pixels of a map, a few rows at a time: a wide one need not be held whole."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Planes = NDArray[np.float32]
"""Some rows of a map: red, green and blue, (3, rows, width)."""


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

    def strips(self, rows: int) -> Iterator[tuple[NDArray[np.floating], ...]]:
        """From the top, so many rows at a time (fewer at the end): red, green and blue,
        (rows, width) each, half or float32."""
        ...


@dataclass(frozen=True, eq=False)
class ArrayPixels:
    """Pixels that are in memory. radiance: (height, width, 3)."""

    radiance: NDArray[np.float32]

    @property
    def width(self) -> int:
        return self.radiance.shape[1]

    @property
    def height(self) -> int:
        return self.radiance.shape[0]

    @property
    def least_rows(self) -> int:
        return 1

    def strips(self, rows: int) -> Iterator[tuple[NDArray[np.floating], ...]]:
        for top in range(0, self.height, rows):
            yield tuple(np.moveaxis(self.radiance[top : top + rows], -1, 0))


_VALUES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
"""Of all half floats: looked up they are had in half the time of casting."""


def as_float32(plane: NDArray[np.floating], out: NDArray[np.float32]) -> None:
    """Copy numbers of any type into an array of the same shape."""
    if plane.dtype == np.float16:
        np.take(_VALUES, plane.view(np.uint16), out=out, mode="clip")
    else:
        out[...] = plane


def planes_of(strip: tuple[NDArray[np.floating], ...]) -> Planes:
    """A copy of some rows."""
    planes = np.empty((3, *strip[0].shape), np.float32)
    for plane, out in zip(strip, planes, strict=True):
        as_float32(plane, out)
    return planes


def highest_light(plane: NDArray[np.floating]) -> float:
    """The largest number; nan unless all are finite and not below 0 (or -0)."""
    if plane.dtype == np.float16:  # as integers they are in the same order, and compared faster
        highest = int(plane.view(np.uint16).max())
        return float(_VALUES[highest]) if highest < 0x7C00 else np.nan
    if plane.dtype == np.float32:
        bits = plane.view(np.uint32).max()
        return float(bits.view(np.float32)) if bits < 0x7F800000 else np.nan
    highest = float(plane.max())  # carries nan along
    return highest if plane.min() >= 0 and highest < np.inf else np.nan
