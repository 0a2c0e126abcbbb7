"""Light in patches, as the method "edge" looks at it: what its cells would get wrong.

A shadow's edge crosses a cell with a probability that grows with its width, and costs what the disc
in its place gets wrong of the cell's light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..environment import LUMINANCE_WEIGHTS
from ..patches import Patches
from ..settings import Shape
from ..shadow_edges import cap_beyond, edges_across, facing_up, half_widths
from ..sums import weighted_sum
from ..suns import disc_diameter, disc_on_ground

Floats = NDArray[np.float64]
Owner = NDArray[np.intp]

TURNS, PLACES = 4, 24
"""Edges across a cell: at so many angles, in so many places each. With 6 angles or 48 places the
errors of 4 to 64 lights are the same."""

SEEN_BY = np.array([1.0, 0.01, 1.2])
"""Of red, green and blue, what a cell's mean direction and width are made of.

Luminance is nearly green, and green lies between: a disc in the mean of green is right there and
wrong for red and blue, which a warm sun in a blue sky pulls to either side. Midway between those
two no channel is wrong by much. Blue counts a little more, as it is spread the widest; green where
nothing else shines.
"""

JUDGED = 3
"""Red, blue and luminance, each against all of its kind, are what a cell gets wrong."""

TOGETHER = 7.0
"""How much a piece of light is drawn to where it brings the colours of a cell back to one place,
against how much it is drawn to the nearest cell. The worst channel is wrong by 1.24 to 1.25 times
what luminance is with 4, 16 and 64 lights; with 5 or 10 by 1.22 to 1.31 times."""

GROUND = 1.0
"""How much what level ground gets wrong counts against a shadow's edge anywhere: the horizon is one
edge that nearly every scene has. With 10, shadows of 4 lights get 15 % worse."""

PULLED = 0, 2
"""The channels that are brought back, red and blue: green lies between."""

HEAVY = 0.1
"""A patch with more than this part of its cell's light stays there: from hand to hand it would
turn the widths of whole cells at each step, and never settle."""

A_PART = 0.1
"""Of all light, what the bright or the faint part has at least: a sun's dark rim is none."""

FLUX, RELATIVE, VECTORS = slice(0, 3), slice(3, 6), slice(6, 15)
TOTAL, SEEN = slice(15, 15 + JUDGED), slice(15 + JUDGED, 15 + 2 * JUDGED)
HELD = SEEN.stop
"""Columns of what is summed over cells, see `EdgeLight.held`, and how many there are."""

DISTANCES = 1 << 14
"""Distances of patches to cells that are worked out at a time: few enough for a processor's own
memory, and so few that BLAS gives them to one thread (see `sums`)."""

CELLS = 512
"""Cells whose edges are held in memory at a time."""


@dataclass(frozen=True, eq=False)
class PatchCells:
    """Cells of patches and the disc or point in the place of each.

    owner: the cell of each patch, (p,). held: sums over each cell, see `EdgeLight.held`, (n, HELD).
    to_light: unit vectors, (n, 3). shortfall: 1 - R of each, where R is the length of its mean
    direction, (n,). error: predicted for all of them together, as a part of all light of the
    channel that is most wrong.
    """

    owner: Owner
    held: Floats
    to_light: Floats
    shortfall: Floats
    error: float

    @property
    def flux(self) -> Floats:
        """Scalar irradiance of each cell, (n, 3)."""
        return self.held[:, FLUX]


@dataclass(frozen=True, eq=False)
class EdgeLight:
    """Patches with what cutting and balancing ask of them.

    part: 0 or 1 for each patch, (p,). How much a colour counts is by the light of the same part:
    against the whole map's red, that of a sky under a red sun is next to nothing.
    """

    patches: Patches
    shape: Shape
    part: Owner

    @classmethod
    def of(cls, patches: Patches, shape: Shape) -> EdgeLight:
        """All in one part."""
        return cls(patches, shape, np.zeros(len(patches), np.intp))

    def in_two_parts(self) -> EdgeLight:
        """Bright and faint: the border is the mean brightness, in octaves, of where light is. The
        same as before if one of them has next to nothing of it."""
        luminous = self.patches.flux @ LUMINANCE_WEIGHTS
        luminous /= luminous.sum()
        octaves = np.log2(np.maximum(self.patches.brightness, 1e-300))
        bright = octaves > weighted_sum(luminous, octaves)
        if not A_PART < luminous[bright].sum() < 1 - A_PART:
            return self
        return replace(self, part=bright.astype(np.intp))

    @cached_property
    def relative(self) -> Floats:
        """Red, green and blue of each patch, as parts of the red, green and blue of its own part of
        the light, times that part, (p, 3)."""
        total = _sums(self.part, self.patches.flux, int(self.part.max()) + 1)
        shares = total @ LUMINANCE_WEIGHTS / (total @ LUMINANCE_WEIGHTS).sum()
        scale = shares[:, None] / np.where(total > 0, total, 1)
        return self.patches.flux * scale[self.part]

    @cached_property
    def judged(self) -> Floats:
        """Red, blue and luminance of each patch, as parts of all of each, (p, 3)."""
        flux = self.patches.flux
        kinds = np.stack([flux[:, 0], flux[:, 2], flux @ LUMINANCE_WEIGHTS], axis=-1)
        total = kinds.sum(axis=0)
        return kinds / np.where(total > 0, total, 1)

    @cached_property
    def light(self) -> Floats:
        """Of each patch as a part of all light, (p,)."""
        return self.relative @ SEEN_BY / SEEN_BY.sum()

    @cached_property
    def held(self) -> Floats:
        """All that is asked of cells in sums over their patches, (p, HELD): flux; what is
        `relative`; the mean direction times each of that; what is `judged`; and what level ground
        gets of that. One product of matrices sums them all."""
        mean = (1 - self.patches.spread)[:, None] * self.patches.directions
        vectors = self.relative[:, :, None] * mean[:, None, :]
        seen = self.judged * facing_up(self.patches.directions, self.half_width)[:, None]
        parts = [self.patches.flux, self.relative, vectors.reshape(-1, 9), self.judged, seen]
        return np.concatenate(parts, axis=1)

    @cached_property
    def features(self) -> Floats:
        """What distances of patches are linear in, (p, 10): direction, 1, and mean direction times
        red and times blue against all of the patch's light."""
        whole = np.maximum(self.light, 1e-300)[:, None]
        parts = [self.patches.directions, np.ones_like(whole)]
        vectors = self.held[:, VECTORS]
        parts += [vectors[:, 3 * c : 3 * c + 3] / whole for c in PULLED]
        return np.concatenate(parts, axis=1)

    @cached_property
    def half_width(self) -> Floats:
        return half_widths(self.patches.spread)

    def squared_errors(self, members: Owner, owner: Owner, count: int) -> Floats:
        """Mean over all great circles of what each cell's disc lets through too much or too
        little, squared, and of what level ground gets, as parts of all light: (n, JUDGED).

        members: patches, (m,), with the cell of each, rising from 0: every cell has one.
        """
        held = _sums(owner, self.held.take(members, axis=0), count)
        return self._squared_errors(members, owner, held)

    def widths(self, members: Owner, owner: Owner, count: int) -> Floats:
        """About what `squared_errors` says, at a fifth of the time: light squared, times how wide
        it is, (n, JUDGED)."""
        held = _sums(owner, self.held.take(members, axis=0), count)
        _, shortfall = self._moments(held, members, owner)
        return held[:, TOTAL] ** 2 * np.sqrt(shortfall)[:, None]

    def halves(self, members: Owner) -> NDArray[np.bool_] | None:
        """Which members come first if a cell is cut at its mean, across its longest axis, or
        between the parts if it has of both."""
        if len(members) < 2:
            return None
        part = self.part[members] > 0
        if part.any() and not part.all():
            return part
        directions = self.patches.directions.take(members, axis=0)
        relative = self.relative.take(members, axis=0)
        weight = relative @ (SEEN_BY * relative.sum(axis=0))
        offset = directions - weighted_sum(weight, directions) / weight.sum()
        _, axes = np.linalg.eigh((offset * weight[:, None]).T @ offset)
        first = offset @ axes[:, -1] < 0
        return first if first.any() and not first.all() else None

    def cells(self, owner: Owner) -> PatchCells:
        """Cells by their moments; those that have lost all patches are left out."""
        occupied = np.bincount(owner) > 0
        owner = (np.cumsum(occupied) - 1)[owner]
        count = int(occupied.sum())
        held = _sums(owner, self.held, count)
        to_light, shortfall = self._moments(held, np.arange(len(owner)), owner)
        return PatchCells(owner, held, to_light, shortfall, np.inf)

    def judge(self, cells: PatchCells) -> PatchCells:
        """The same cells with their predicted error."""
        order = np.argsort(cells.owner, kind="stable")
        owner = cells.owner[order]
        squared = np.zeros(JUDGED)
        for first in range(0, len(cells.held), CELLS):
            held = cells.held[first : first + CELLS]
            some = slice(*np.searchsorted(owner, (first, first + len(held))))
            squared += self._squared_errors(order[some], owner[some] - first, held).sum(axis=0)
        return replace(cells, error=error_of(squared))

    def shared_out(self, cells: PatchCells) -> Owner:
        """For each patch the cell that is best to have it: a new owner, (p,).

        Near, in a measure of each cell's own: bright and narrow cells take little from around
        them. And where it brings the colours of a cell back together.
        """
        whole = cells.held[:, RELATIVE] @ SEEN_BY / SEEN_BY.sum()
        owner = self._nearest(cells, whole)
        stays = self.light > HEAVY * whole[cells.owner]
        owner[stays] = cells.owner[stays]
        return owner

    def _squared_errors(self, members: Owner, owner: Owner, held: Floats) -> Floats:
        """See `squared_errors`. held: what each cell holds of it all, (n, HELD)."""
        to_light, shortfall = self._moments(held, members, owner)
        half = np.zeros(len(held))
        if self.shape == "disc":
            half = disc_diameter(shortfall) / 2
        judged = self.judged.take(members, axis=0)
        directions = self.patches.directions.take(members, axis=0)
        half_width = self.half_width.take(members)
        edges = edges_across(directions, half_width, judged, owner, to_light, TURNS, PLACES)
        of_disc = cap_beyond(edges.height, half[:, None])
        wrong = edges.beyond - held[:, None, TOTAL] * of_disc[..., None]
        squared = np.einsum("ne,nek->nk", edges.part, wrong**2)
        on_ground = disc_on_ground(to_light[:, 2], half)[:, None]
        return squared + GROUND * (held[:, SEEN] - held[:, TOTAL] * on_ground) ** 2

    def _nearest(self, cells: PatchCells, whole: Floats) -> Owner:
        """The cell to which the distance of each patch is the least, (p,).

        whole: light of each cell, (n,).
        """
        count = len(whole)
        scale = np.sqrt(whole / (2 * np.maximum(cells.shortfall, 1e-9)))
        # The squared chord, 2 - 2 cos, and how far a channel's mean lies aside of the cell's: both
        # linear in a patch's direction, so that one product of matrices holds them all.
        of_cells = [-2 * cells.to_light * scale[:, None], 2 * scale[:, None]]
        for channel in PULLED:
            vector = cells.held[:, VECTORS][:, 3 * channel : 3 * channel + 3]
            aside = vector - (vector * cells.to_light).sum(axis=1)[:, None] * cells.to_light
            aside *= (TOGETHER * scale / np.maximum(whole, 1e-300))[:, None]
            of_cells.append(aside)
        cell_parts = np.concatenate(of_cells, axis=1).T
        owner = np.empty(len(self.patches), np.intp)
        # Two patches at least, as one alone is another kind of product, with limits of its own.
        at_once = min(max(DISTANCES // count, 2), len(owner))
        distances = np.empty((at_once, count))
        for start in range(0, len(owner), at_once):
            some = slice(min(start, len(owner) - at_once), start + at_once)
            np.matmul(self.features[some], cell_parts, out=distances)
            np.argmin(distances, axis=1, out=owner[some])
        return owner

    def _moments(self, held: Floats, members: Owner, owner: Owner) -> tuple[Floats, Floats]:
        """Mean directions (n, 3) and shortfalls (n,) of cells; see `PatchCells`.

        What a patch counts is by its cell's own colour, as what is little of a channel may lie
        anywhere. Each patch is as long as the mean of what it holds: sums are as over its pixels.
        """
        shares = SEEN_BY * held[:, RELATIVE]
        total = (shares * held[:, RELATIVE]).sum(axis=1)
        vector = np.einsum("nc,nca->na", shares, held[:, VECTORS].reshape(-1, 3, 3))
        length = np.linalg.norm(vector, axis=1)
        lost = length <= 1e-9 * total  # light from all sides
        to_light = vector / np.where(lost, 1, length)[:, None]
        for cell in np.flatnonzero(lost):
            mine = members[owner == cell]
            brightest = np.argmax(self.relative[mine] @ shares[cell])
            to_light[cell] = self.patches.directions[mine[brightest]]
        return to_light, np.maximum(1 - length / total, 0)


def error_of(squared: Floats) -> float:
    """Of the channel that is most wrong, from squared errors of each, (JUDGED,)."""
    return float(np.sqrt(squared.max()))


def _sums(owner: Owner, values: Floats, count: int) -> Floats:
    """Of each cell, (n, k), from values of pieces, (p, k)."""
    from scipy.sparse import csc_array

    pieces = len(owner)
    of_cells = csc_array((np.ones(pieces), owner, np.arange(pieces + 1)), shape=(count, pieces))
    return of_cells @ values
