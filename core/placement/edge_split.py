"""Cells for the truest shadows: cut where a shadow's edge would be most wrong, then balanced.

A shadow's edge crosses a cell with a probability that grows with its width, and costs what the
disc in its place gets wrong of the cell's light. The cell for which that is worst is cut in two,
until there are enough; then the cells share out their borders among each other.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count as counter

import numpy as np
from numpy.typing import NDArray

from ..environment import LUMINANCE_WEIGHTS
from ..patches import Patches
from ..settings import Shape
from ..shadow_edges import cap_beyond, edges_across, facing_up, half_widths, let_through
from ..suns import disc_diameter, disc_on_ground

Floats = NDArray[np.float64]

TURNS, PLACES = 6, 24
"""Edges across a cell: at so many angles, in so many places each. With 48 places the errors of 4 to
256 lights are the same, and 64 take a fifth longer."""

MANY, FEWER = 2048, 16
"""Cells of more patches than this are cut anyway: so many places tell how soon."""

SEEN_BY = np.array([1.0, 0.01, 1.2])
"""Of red, green and blue, what a cell's mean direction and width are made of.

Luminance is nearly green, and green lies between: a disc in the mean of green is right there and
wrong for red and blue, which a warm sun in a blue sky pulls to either side. Midway between those
two no channel is wrong by much. Blue counts a little more, as it is spread the widest; green where
nothing else shines.
"""

JUDGED = 3
"""Red, blue and luminance, each against all of its kind, count alike in a cell's error."""

TOGETHER = 7.0
"""How much a piece of light is drawn to where it brings the colours of a cell back to one place,
against how much it is drawn to the nearest cell. Between 5 and 10 the worst channel's error falls
by 3 % against luminance's, while the latter grows by 5 %."""

STEPS = 16
"""How often borders are shared out: three quarters of what can be won comes with the first two,
and after 20 the error of 256 lights falls by one part in a hundred."""

JUDGED_STEPS = 4, 8, STEPS
"""After these the cells are judged: a few in a narrow sun do not settle, and are best early."""

GROUND = 1.0
"""How much what level ground gets wrong counts against a shadow's edge anywhere: the horizon is one
edge that nearly every scene has. With 10, shadows of 4 lights get 15 % worse."""

HEAVY = 0.1
"""A patch with more than this part of its cell's light stays there: from hand to hand it would
turn the widths of whole cells at each step, and never settle."""


DISTANCES = 1 << 22
"""Distances of patches to cells that are held in memory at a time."""


@dataclass(frozen=True, eq=False)
class PatchCells:
    """Cells of patches and the disc or point in the place of each.

    owner: the cell of each patch, (p,). flux: scalar irradiance of each cell, (n, 3). to_light:
    unit vectors, (n, 3). shortfall: 1 - R of each, where R is the length of its mean
    direction, (n,). error: predicted for all of them together, as a part of all light.
    """

    owner: NDArray[np.intp]
    flux: Floats
    to_light: Floats
    shortfall: Floats
    error: float


def edge_split(patches: Patches, count: int, shape: Shape, allowed: float = 0.0) -> PatchCells:
    """At most `count` cells: as many as make the predicted error smaller, until it is `allowed`.

    patches: some, all of them lit. allowed: a part of all light; see `PatchCells.error`.
    """
    light = _Light(patches, shape)
    best, least = np.zeros(len(patches), np.intp), np.inf
    for owner, error in _cuts(light, count):
        if error < least:  # a round sun cut in two is two bad halves
            best, least = owner.copy(), error
        if error <= allowed:
            break
    return _balanced(light, best, least)


def _cuts(light: _Light, count: int) -> Iterator[tuple[NDArray[np.intp], float]]:
    """One cell, two cells, ... : the owner of each patch, and what is predicted to be wrong."""
    owner = np.zeros(len(light.patches), np.intp)
    order = counter()  # cells of equal badness in the order in which they were made

    def entry(number: int, members: NDArray[np.intp]) -> tuple[float, int, int, NDArray[np.intp]]:
        return -light.squared_error(members), next(order), number, members

    heap, finished, cells = [entry(0, np.arange(len(owner)))], 0.0, 1
    yield owner, _root(heap, finished)
    while heap and cells < count:
        worst, _, number, members = heapq.heappop(heap)
        first = light.halves(members)
        if first is None:
            finished -= worst
            continue
        owner[members[~first]] = cells
        heapq.heappush(heap, entry(number, members[first]))
        heapq.heappush(heap, entry(cells, members[~first]))
        cells += 1
        yield owner, _root(heap, finished)


def _root(heap: list[tuple[float, int, int, NDArray[np.intp]]], finished: float) -> float:
    return float(np.sqrt(finished - sum(entry[0] for entry in heap)))


def _balanced(light: _Light, owner: NDArray[np.intp], error: float) -> PatchCells:
    """The cells after sharing out their borders, where that is predicted to be truer."""
    cells = light.described(owner, error)
    if len(cells.flux) == 1:
        return cells
    best = cells
    for step in range(1, STEPS + 1):
        cells = light.described(light.shared_out(cells))
        if step in JUDGED_STEPS:
            best = min(best, light.judge(cells), key=lambda one: one.error)
    return best


@dataclass(frozen=True, eq=False)
class _Light:
    """Patches with what each step asks of them."""

    patches: Patches
    shape: Shape

    @cached_property
    def relative(self) -> Floats:
        """Red, green and blue of each patch as parts of all red, green and blue, (p, 3)."""
        total = self.patches.flux.sum(axis=0)
        return self.patches.flux / np.where(total > 0, total, 1)

    @cached_property
    def judged(self) -> Floats:
        """Red, blue and luminance of each patch, as parts of all of each, (p, 3)."""
        luminous = self.patches.flux @ LUMINANCE_WEIGHTS
        return np.stack(
            [self.relative[:, 0], self.relative[:, 2], luminous / luminous.sum()], axis=-1
        )

    @cached_property
    def light(self) -> Floats:
        """Of each patch as a part of all light, (p,)."""
        return self.relative @ SEEN_BY / SEEN_BY.sum()

    @cached_property
    def weighted(self) -> dict[int, Floats]:
        """Direction times red and times blue of each patch, (p, 3) each."""
        return {c: self.relative[:, c, None] * self.patches.directions for c in (0, 2)}

    @cached_property
    def features(self) -> Floats:
        """What distances of patches are linear in, (p, 10): direction, 1, and direction once more
        times red and times blue against all of the patch's light."""
        whole = np.maximum(self.light, 1e-300)[:, None]
        parts = [self.patches.directions, np.ones_like(whole)]
        for vector in self.weighted.values():
            parts.append(vector / whole)
        return np.concatenate(parts, axis=1)

    @cached_property
    def half_width(self) -> Floats:
        return half_widths(self.patches.spread)

    @cached_property
    def on_ground(self) -> Floats:
        """What level ground gets of each patch: the cosine, 0 below the horizon, (p,)."""
        return facing_up(self.patches.directions, self.half_width)

    def squared_error(self, members: NDArray[np.intp]) -> float:
        """Mean over all great circles of what the cell's disc lets through too much or too little,
        squared, as a part of all light; red, blue and luminance alike."""
        patches, judged = self.patches, self.judged[members]
        directions = patches.directions[members]
        weight = self._weight(members, np.zeros(len(members), np.intp), 1)
        to_light, shortfall = _moments(
            directions, patches.spread[members], weight, np.zeros(len(members), np.intp), 1
        )
        places = PLACES if len(members) <= MANY else FEWER
        normals, parts = edges_across(directions, weight, to_light[0], TURNS, places)
        seen = let_through(directions, self.half_width[members], normals)
        height = normals @ to_light[0]
        half = 0.0 if self.shape == "point" else disc_diameter(float(shortfall[0])) / 2
        of_disc = cap_beyond(height, half)
        wrong = judged.T @ seen - judged.sum(axis=0)[:, None] * of_disc
        squared = float((wrong**2).sum(axis=0) @ parts)
        ground = judged.T @ self.on_ground[members] - judged.sum(axis=0) * disc_on_ground(
            to_light[0, 2], half
        )
        return (squared + GROUND * float(ground @ ground)) / JUDGED

    def halves(self, members: NDArray[np.intp]) -> NDArray[np.bool_] | None:
        """Which members come first if a cell is cut at its mean, across its longest axis."""
        if len(members) < 2:
            return None
        directions = self.patches.directions[members]
        weight = self._weight(members, np.zeros(len(members), np.intp), 1)
        offset = directions - (weight @ directions) / weight.sum()
        _, axes = np.linalg.eigh((offset * weight[:, None]).T @ offset)
        first = offset @ axes[:, -1] < 0
        return first if first.any() and not first.all() else None

    def described(self, owner: NDArray[np.intp], error: float = np.inf) -> PatchCells:
        """Cells by their moments; those that have lost all patches are left out."""
        occupied, owner = np.unique(owner, return_inverse=True)
        count = len(occupied)
        weight = self._weight(slice(None), owner, count)
        to_light, shortfall = _moments(
            self.patches.directions, self.patches.spread, weight, owner, count
        )
        flux = _sums(owner, self.patches.flux, count)
        return PatchCells(owner, flux, to_light, shortfall, error)

    def judge(self, cells: PatchCells) -> PatchCells:
        """The same cells with their predicted error."""
        ends = np.cumsum(np.bincount(cells.owner))
        groups = np.split(np.argsort(cells.owner, kind="stable"), ends[:-1])
        error = float(np.sqrt(sum(self.squared_error(members) for members in groups)))
        return replace(cells, error=error)

    def shared_out(self, cells: PatchCells) -> NDArray[np.intp]:
        """For each patch the cell that is best to have it: a new owner, (p,).

        Near, in a measure of each cell's own: bright and narrow cells take little from around
        them. And where it brings the colours of a cell back together.
        """
        count = len(cells.flux)
        of_cell = _sums(cells.owner, self.relative, count)
        whole = of_cell @ SEEN_BY / SEEN_BY.sum()
        scale = np.sqrt(whole / (2 * np.maximum(cells.shortfall, 1e-9)))
        # The squared chord, 2 - 2 cos, and how far a channel's mean lies aside of the cell's: both
        # linear in a patch's direction, so that one product of matrices holds them all.
        of_cells = [-2 * cells.to_light * scale[:, None], 2 * scale[:, None]]
        for channel in (0, 2):
            vector = _sums(cells.owner, self.weighted[channel], count)
            aside = vector - (vector * cells.to_light).sum(axis=1)[:, None] * cells.to_light
            aside *= (TOGETHER * scale / np.maximum(whole, 1e-300))[:, None]
            of_cells.append(aside)
        cell_parts = np.concatenate(of_cells, axis=1).T
        owner = np.empty(len(self.patches), np.intp)
        at_once = max(DISTANCES // count, 1)
        for start in range(0, len(owner), at_once):
            some = slice(start, start + at_once)
            owner[some] = np.argmin(self.features[some] @ cell_parts, axis=1)
        stays = self.light > HEAVY * whole[cells.owner]
        owner[stays] = cells.owner[stays]
        return owner

    def _weight(
        self, members: NDArray[np.intp] | slice, owner: NDArray[np.intp], count: int
    ) -> Floats:
        """What each patch counts in its cell's mean direction: by the cell's own colour, as what
        is little of a channel may lie anywhere."""
        relative = self.relative[members]
        shares = SEEN_BY * _sums(owner, relative, count)
        return (relative * shares[owner]).sum(axis=1)


def _moments(
    directions: Floats, spread: Floats, weight: Floats, owner: NDArray[np.intp], count: int
) -> tuple[Floats, Floats]:
    """Mean directions (n, 3) and shortfalls (n,) of cells; see `PatchCells`."""
    total = np.bincount(owner, weight, count)
    # Each patch is as long as the mean of what it holds: sums are as over its pixels.
    vector = _sums(owner, (weight * (1 - spread))[:, None] * directions, count)
    length = np.linalg.norm(vector, axis=1)
    lost = length <= 1e-9 * total  # light from all sides
    to_light = vector / np.where(lost, 1, length)[:, None]
    for cell in np.flatnonzero(lost):
        mine = np.flatnonzero(owner == cell)
        to_light[cell] = directions[mine[np.argmax(weight[mine])]]
    apart = (1 - spread) * ((directions - to_light[owner]) ** 2).sum(axis=1) / 2 + spread
    return to_light, np.bincount(owner, weight * apart, count) / total


def _sums(owner: NDArray[np.intp], values: Floats, count: int) -> Floats:
    return np.stack([np.bincount(owner, one, count) for one in values.T], axis=-1)
