"""What became of a map, in lines on the map: region A, the borders of cells, the discs of suns."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .cells import OUTSIDE

if TYPE_CHECKING:  # what draws outlines does not convert
    from .conversion import Conversion

Floats = NDArray[np.float64]
Runs = NDArray[np.uint16]
Labels = NDArray[np.signedinteger]
Places = NDArray[np.intp]

MOST_RUNS = 32_768
"""Of region A, and of cells: a megabyte in memory, and drawn in no time. A noisy map has more, and
is outlined in squares of 2, 4, ... pixels."""

VERSION = b"1"


@dataclass(frozen=True, eq=False)
class Outlines:
    """Straight runs along the sides of pixels: column and row of both ends of each, (n, 4).

    region: around region A. cells: between cells of different suns. They are told on two grids of
    their own, of so many columns and rows: region_size, cells_size.
    """

    region: Runs
    cells: Runs
    region_size: tuple[int, int]
    cells_size: tuple[int, int]

    def region_lines(self) -> Floats:
        """Both ends of each run in u, v (v downwards), (n, 2, 2)."""
        return _in_image(self.region, self.region_size)

    def cell_lines(self) -> Floats:
        return _in_image(self.cells, self.cells_size)

    def to_text(self) -> str:
        """As ASCII, to be kept in a file of others."""
        head = np.array([*self.region_size, *self.cells_size, len(self.region)], "<u4")
        runs = np.concatenate([self.region, self.cells]).astype("<u2")
        return base64.b64encode(VERSION + zlib.compress(head.tobytes() + runs.tobytes())).decode()

    @classmethod
    def from_text(cls, text: str) -> Outlines:
        """What `to_text` has written. Raises ValueError for anything else."""
        try:
            packed = base64.b64decode(text, validate=True)
            data = zlib.decompress(packed[1:])
        except (ValueError, zlib.error) as error:
            raise ValueError("no outlines") from error
        if packed[:1] != VERSION or len(data) < 20 or len(data) % 8 != 4:
            raise ValueError("outlines of another version, or that end too early")
        *sizes, count = (int(number) for number in np.frombuffer(data[:20], "<u4"))
        runs = np.frombuffer(data[20:], "<u2").astype(np.uint16).reshape(-1, 4)
        return cls(runs[:count], runs[count:], (sizes[0], sizes[1]), (sizes[2], sizes[3]))


def outlines_of(conversion: Conversion) -> Outlines:
    """Of a conversion, as detailed as `MOST_RUNS` allows."""
    region, region_size = _bounded(conversion.strata.region_a.astype(np.int8) - 1, True)
    if conversion.cells is None:
        return Outlines(region, np.empty((0, 4), np.uint16), region_size, region_size)
    cells, cells_size = _bounded(conversion.cells.labels(), False)
    return Outlines(region, cells, region_size, cells_size)


def runs_between(labels: Labels, outer: bool) -> Runs:
    """Straight runs along the sides of pixels whose labels differ, (n, 4); see `Outlines`.

    labels: (H, W). outer: between something and OUTSIDE; else between two things. The columns wrap:
    a border at the seam is told at both ends. At a pole nothing has a border: it is one point.
    """
    height, width = labels.shape
    row, column = _borders(labels[:, :-1], labels[:, 1:], outer)
    seam, _ = _borders(labels[:, -1:], labels[:, :1], outer)
    column = np.concatenate([column + 1, np.zeros_like(seam), np.full_like(seam, width)])
    x, top, bottom = _runs(column, np.concatenate([row, seam, seam]), height)
    y, left, right = _runs(*_borders(labels[:-1], labels[1:], outer), width)
    found = [np.stack([x, top, x, bottom], axis=-1), np.stack([left, y + 1, right, y + 1], axis=-1)]
    return np.concatenate(found).astype(np.uint16)


def lines_in_image(directions: Floats) -> list[Floats]:
    """A line over the sphere as lines on the map, each u, v (v downwards) of its points, (k, 2).

    directions: unit vectors along it, (n, 3), near to one another. What leaves the map at one end
    of the seam comes back at the other.
    """
    u, v = sphere.to_image(directions)
    points = np.stack([np.unwrap(u, period=1), v], axis=-1)
    whole = np.floor(points[:, 0])
    crossing = np.flatnonzero(np.diff(whole))
    seam = np.maximum(whole[crossing], whole[crossing + 1])
    start, end = points[crossing], points[crossing + 1]
    part = (seam - start[:, 0]) / (end[:, 0] - start[:, 0])
    at_seam = np.stack([seam, start[:, 1] + part * (end[:, 1] - start[:, 1])], axis=-1)
    points = np.insert(points, crossing + 1, at_seam, axis=0)
    ends = crossing + 1 + np.arange(len(crossing))
    lines = []
    for first, last in zip([0, *ends], [*ends, len(points) - 1], strict=True):
        line = points[first : last + 1]
        middle = (line[:, 0].min() + line[:, 0].max()) / 2
        if len(line) > 1:
            lines.append(line - (np.floor(middle), 0))
    return lines


def _bounded(labels: Labels, outer: bool) -> tuple[Runs, tuple[int, int]]:
    """Runs between labels, and on how many columns and rows."""
    runs = runs_between(labels, outer)
    while len(runs) > MOST_RUNS:
        labels = _halved(labels)
        runs = runs_between(labels, outer)
    return runs, labels.shape[::-1]


def _halved(labels: Labels) -> Labels:
    """Of each square of 2 x 2 the largest label."""
    height, width = labels.shape
    labels = np.pad(labels, ((0, height % 2), (0, width % 2)), mode="edge")
    return np.maximum.reduceat(
        np.maximum.reduceat(labels, np.arange(0, len(labels), 2)),
        np.arange(0, labels.shape[1], 2),
        axis=1,
    )


def _borders(one: Labels, other: Labels, outer: bool) -> tuple[Places, Places]:
    """Rows and columns where two labels differ, and one or none of them is OUTSIDE, in reading
    order: first all places where they differ, which are few."""
    rows, columns = np.divmod(np.flatnonzero(one != other), max(one.shape[1], 1))
    outside = (one[rows, columns] == OUTSIDE) | (other[rows, columns] == OUTSIDE)
    wanted = outside if outer else ~outside
    return rows[wanted], columns[wanted]


def _runs(line: Places, place: Places, length: int) -> tuple[Places, Places, Places]:
    """Of places in lines, each `length` long: line, first place and the place behind the last of
    each run of them in a line."""
    # With a gap between two lines.
    at = np.sort(line * (length + 1) + place)
    begins = np.flatnonzero(np.diff(at, prepend=-2) != 1)
    ends = np.append(begins[1:], len(at)) - 1 if len(at) else begins
    lines, first = np.divmod(at[begins], length + 1)
    return lines, first, at[ends] - lines * (length + 1) + 1


def _in_image(runs: Runs, size: tuple[int, int]) -> Floats:
    return runs.reshape(-1, 2, 2) / np.array(size, np.float64)
