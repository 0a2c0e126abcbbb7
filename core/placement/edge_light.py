"""Light in patches, as the method "edge" looks at it: how much each colour counts where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..environment import LUMINANCE_WEIGHTS
from ..patches import Patches
from ..settings import Shape
from ..shadow_edges import facing_up, half_widths
from ..sums import weighted_sum

Floats = NDArray[np.float64]
Owner = NDArray[np.intp]

SEEN_BY = np.array([1.0, 0.01, 1.2])
"""Of red, green and blue, what a cell's mean direction and width are made of.

Luminance is nearly green, and green lies between: a disc in the mean of green is right there and
wrong for red and blue, which a warm sun in a blue sky pulls to either side. Midway between those
two no channel is wrong by much. Blue counts a little more, as it is spread the widest; green where
nothing else shines.
"""

JUDGED = 3
"""Red, blue and luminance, each against all of its kind, are what a cell gets wrong."""

A_PART = 0.1
"""Of all light, what the bright or the faint part has at least: a sun's dark rim is none."""

FLUX, RELATIVE, VECTORS = slice(0, 3), slice(3, 6), slice(6, 15)
TOTAL, SEEN = slice(15, 15 + JUDGED), slice(15 + JUDGED, 15 + 2 * JUDGED)
HELD = SEEN.stop
"""Columns of what is summed over cells, see `EdgeLight.held`, and how many there are."""


@dataclass(frozen=True, eq=False)
class EdgeLight:
    """Patches with what cutting and balancing ask of them.

    fades: whether shadows of wide discs do, as in EEVEE; see `two_orders.part_shadowed`.
    directions: unit vectors, (p, 3). half_width: see `shadow_edges.half_widths`, (p,). part: of the
    light that each is of, 0 or 1, (p,). relative: red, green and blue as parts of the red, green
    and blue of that part, times how much of all light is in it, (p, 3): against the whole map's
    red, that of a sky under a red sun is next to nothing. held: all that is asked of cells in sums
    over their patches, (p, HELD): flux; what is `relative`; the mean direction times each of that;
    red, blue and luminance as parts of all of each; and what level ground gets of that.
    """

    shape: Shape
    fades: bool
    directions: Floats
    half_width: Floats
    part: Owner
    relative: Floats
    held: Floats

    @classmethod
    def of(
        cls, patches: Patches, shape: Shape, fades: bool = False, part: Owner | None = None
    ) -> EdgeLight:
        """All in one part, if none are given."""
        if part is None:
            part = np.zeros(len(patches), np.intp)
        half_width = half_widths(patches.spread)
        relative = _relative(patches.flux, part)
        mean = (1 - patches.spread)[:, None] * patches.directions
        vectors = relative[:, :, None] * mean[:, None, :]
        judged = _judged(patches.flux)
        seen = judged * facing_up(patches.directions, half_width)[:, None]
        sums = [patches.flux, relative, vectors.reshape(-1, 9), judged, seen]
        held = np.concatenate(sums, axis=1)
        return cls(shape, fades, patches.directions, half_width, part, relative, held)

    @classmethod
    def joined(cls, lights: Sequence[EdgeLight]) -> EdgeLight:
        """Side by side."""
        names = ("directions", "half_width", "part", "relative", "held")
        arrays = (np.concatenate([getattr(one, name) for one in lights]) for name in names)
        return cls(lights[0].shape, lights[0].fades, *arrays)

    def __len__(self) -> int:
        return len(self.part)

    @property
    def judged(self) -> Floats:
        """Red, blue and luminance of each patch, as parts of all of each, (p, 3)."""
        return self.held[:, TOTAL]

    @cached_property
    def light(self) -> Floats:
        """Of each patch as a part of all light, (p,)."""
        return self.relative @ SEEN_BY / SEEN_BY.sum()

    def halves(self, members: Owner) -> NDArray[np.bool_] | None:
        """Which members come first if a cell is cut at its mean, across its longest axis, or
        between the parts if it has of both."""
        if len(members) < 2:
            return None
        part = self.part[members] > 0
        if part.any() and not part.all():
            return part
        directions = self.directions.take(members, axis=0)
        relative = self.relative.take(members, axis=0)
        weight = relative @ (SEEN_BY * relative.sum(axis=0))
        offset = directions - weighted_sum(weight, directions) / weight.sum()
        _, axes = np.linalg.eigh((offset * weight[:, None]).T @ offset)
        first = offset @ axes[:, -1] < 0
        return first if first.any() and not first.all() else None

    def moments(self, held: Floats, members: Owner, owner: Owner) -> tuple[Floats, Floats]:
        """Mean directions (n, 3) and shortfalls (n,) of cells; see `edge_cells.PatchCells`.

        held: of each cell, (n, HELD). members: patches, (m,), with the cell of each.
        """
        vector, total = self._vectors(held)
        length = np.linalg.norm(vector, axis=1)
        lost = length <= 1e-9 * total  # light from all sides
        to_light = vector / np.where(lost, 1, length)[:, None]
        for cell in np.flatnonzero(lost):
            mine = members[owner == cell]
            brightest = np.argmax(self.relative[mine] @ (SEEN_BY * held[cell, RELATIVE]))
            to_light[cell] = self.directions[mine[brightest]]
        return to_light, np.maximum(1 - length / total, 0)

    def shortfalls(self, held: Floats) -> Floats:
        """The same without the directions, (n,)."""
        vector, total = self._vectors(held)
        return np.maximum(1 - np.linalg.norm(vector, axis=1) / total, 0)

    def _vectors(self, held: Floats) -> tuple[Floats, Floats]:
        """Sums of light times direction, (n, 3), and of that light, (n,).

        What a patch counts is by its cell's own colour, as what is little of a channel may lie
        anywhere. Each patch is as long as the mean of what it holds: sums are as over its pixels.
        """
        shares = SEEN_BY * held[:, RELATIVE]
        total = (shares * held[:, RELATIVE]).sum(axis=1)
        return np.einsum("nc,nca->na", shares, held[:, VECTORS].reshape(-1, 3, 3)), total


def two_parts(patches: Patches) -> Owner | None:
    """Which patches are bright, 1, or faint, 0, (p,): the border is the mean brightness, in
    octaves, of where light is. None if one of them has next to nothing of it."""
    luminous = patches.flux @ LUMINANCE_WEIGHTS
    luminous /= luminous.sum()
    octaves = np.log2(np.maximum(patches.brightness, 1e-300))
    bright = octaves > weighted_sum(luminous, octaves)
    if not A_PART < luminous[bright].sum() < 1 - A_PART:
        return None
    return bright.astype(np.intp)


def _relative(flux: Floats, part: Owner) -> Floats:
    """See `EdgeLight.relative`."""
    total = sums_of(part, flux, int(part.max()) + 1)
    shares = total @ LUMINANCE_WEIGHTS / (total @ LUMINANCE_WEIGHTS).sum()
    scale = shares[:, None] / np.where(total > 0, total, 1)
    return flux * scale[part]


def _judged(flux: Floats) -> Floats:
    """See `EdgeLight.judged`."""
    kinds = np.stack([flux[:, 0], flux[:, 2], flux @ LUMINANCE_WEIGHTS], axis=-1)
    total = kinds.sum(axis=0)
    return kinds / np.where(total > 0, total, 1)


def sums_of(owner: Owner, values: Floats, count: int) -> Floats:
    """Of each cell, (n, k), from values of pieces, (p, k)."""
    from scipy.sparse import csc_array

    pieces = len(owner)
    of_cells = csc_array((np.ones(pieces), owner, np.arange(pieces + 1)), shape=(count, pieces))
    return of_cells @ values
