"""Cells moved to where they are needed: the worst are cut, as many others joined in pairs.

Cells that share out their borders stay in their neighbourhood. Where too many of them were cut in
one place, they are too few in another.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .edge_cells import PatchCells, cells_of, widths_of
from .edge_light import EdgeLight, Owner

ONE_IN = 8
"""One in so many cells is cut; of few cells one."""

NEIGHBOURS = 32
"""Cells with which each may be joined: faint ones far apart may be the best to join."""


def exchanged(light: EdgeLight, cells: PatchCells, wanted: int) -> PatchCells:
    """`wanted` cells, at least as many as there are: the worst in two halves each, and others
    joined for that. cells: judged."""
    count = len(cells.held)
    if count < 3:
        return cells
    moved = max(count // ONE_IN, 1)
    worst = _worst(cells, moved + wanted - count)
    becomes, freed = _joined(light, cells, worst, moved)
    return _cut(light, cells, becomes, worst, [*freed, *range(count, wanted)])


def filled(light: EdgeLight, cells: PatchCells, wanted: int) -> PatchCells:
    """`wanted` cells, or as many as can be cut out of the worst: where borders are shared out a
    cell may lose all that it has. cells: judged."""
    count = len(cells.held)
    worst = _worst(cells, wanted - count)
    return _cut(light, cells, np.arange(count), worst, range(count, wanted))


def _worst(cells: PatchCells, most: int) -> Owner:
    """Cells that can be cut, the worst first, by the channel that is most wrong of all together:
    that is what counts in the end."""
    channel = int(np.argmax(cells.wrong.sum(axis=0)))
    wrong = np.where(np.bincount(cells.owner) > 1, cells.wrong[:, channel], 0)
    worst = np.argsort(-wrong, kind="stable")[:most]
    return worst[wrong[worst] > 0]


def _cut(
    light: EdgeLight, cells: PatchCells, becomes: Owner, worst: Owner, free: Sequence[int]
) -> PatchCells:
    """Each cell as what it becomes, (n,), and the worst in two: second halves get a free number."""
    owner = becomes[cells.owner]
    for number, cell in zip(free, worst, strict=False):
        members = np.flatnonzero(owner == cell)
        first = light.halves(members)
        if first is not None:
            owner[members[~first]] = number
    return cells_of(light, owner)


def _joined(light: EdgeLight, cells: PatchCells, kept: Owner, most: int) -> tuple[Owner, list[int]]:
    """What each cell becomes, (n,), and the numbers that are free then, if at most so many pairs
    are joined: those of which least is wrong then, none of them of `kept`."""
    first, second = _pairs(cells)
    own = widths_of(light, cells.held).sum(axis=1)
    both = widths_of(light, cells.held[first] + cells.held[second]).sum(axis=1)
    becomes, freed = np.arange(len(own)), []
    used = np.zeros(len(own), bool)
    used[kept] = True
    for pair in np.argsort(both - own[first] - own[second], kind="stable"):
        stays, goes = first[pair], second[pair]
        if len(freed) >= min(most, len(kept)):
            break
        if used[stays] or used[goes]:
            continue
        used[[stays, goes]] = True
        becomes[goes] = stays
        freed.append(int(goes))
    return becomes, freed


def _pairs(cells: PatchCells) -> tuple[Owner, Owner]:
    """Cells that lie near each other, each pair once: the lower number first, (m,) each."""
    from scipy.spatial import cKDTree

    count = len(cells.held)
    near = min(NEIGHBOURS + 1, count)
    _, found = cKDTree(cells.to_light).query(cells.to_light, near)
    mine = np.repeat(np.arange(count), near)
    pairs = np.stack([mine, found.ravel()], axis=-1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    return pairs[:, 0], pairs[:, 1]
