"""Which light became which sun, kept with the conversion: what shows it need not convert again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HALVES = 2
"""Squares are told in halves of a pixel: a pixel with much light may be cut into four."""

OUTSIDE = -1
"""The label of what gives its light to no sun."""


@dataclass(frozen=True, eq=False)
class Taken:
    """What suns took, in squares, as the placement looked at it.

    squares: row and column of the upper left corner and side of each, in halves of a pixel, (n, 3).
    sun: the index of each square's sun, (n,).
    """

    squares: NDArray[np.int32]
    sun: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Cells:
    """Pixels of a map that gave light, and which sun took it.

    pixels: flat indices, (p,). taken: squares that cover all of them, and may reach beyond.
    """

    pixels: NDArray[np.intp]
    taken: Taken
    width: int
    height: int

    def labels(self) -> NDArray[np.signedinteger]:
        """The sun of each quarter of a pixel, OUTSIDE where there is none, (2 height, 2 width), of
        the smallest type that holds them."""
        shape = HALVES * self.height, HALVES * self.width
        squares, sun = self.taken.squares, self.taken.sun
        labels = np.full(shape, OUTSIDE, np.min_scalar_type(-1 - int(sun.max(initial=0))))
        for side in np.unique(squares[:, 2]):
            mine = squares[:, 2] == side
            reach = np.arange(side)
            # What a block has beyond the map's end falls on its last row or column, unseen.
            rows = np.minimum(squares[mine, :1] + reach, shape[0] - 1)
            columns = np.minimum(squares[mine, 1:2] + reach, shape[1] - 1)
            labels[rows[:, :, None], columns[:, None, :]] = sun[mine, None, None]
        outside = np.ones(self.width * self.height, bool)
        outside[self.pixels] = False
        outside = outside.reshape(self.height, self.width)
        for quarter in np.ndindex(HALVES, HALVES):
            np.copyto(labels[quarter[0] :: HALVES, quarter[1] :: HALVES], OUTSIDE, where=outside)
        return labels


def squares_of_pixels(pixels: NDArray[np.intp], width: int) -> NDArray[np.int32]:
    """Each of some pixels as a square, see `Taken`, (p, 3)."""
    rows, columns = np.divmod(pixels, width)
    return squares_at(rows, columns, HALVES)


def squares_at(rows: NDArray[np.intp], columns: NDArray[np.intp], side: int) -> NDArray[np.int32]:
    """Squares of one side, in halves of a pixel, in these rows and columns of such squares."""
    sides = np.full(len(rows), side)
    return np.stack([rows * side, columns * side, sides], axis=-1).astype(np.int32)
