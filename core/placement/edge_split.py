"""Cells for the truest shadows: cut where a shadow's edge would be most wrong, then balanced.

The cell for which that is worst is cut in two, until there are enough; then the cells share out
their borders among each other. Where they begin decides where they end: several beginnings are
tried, with colours weighed over the whole light or over its bright and its faint part each, and
the best end is taken.
"""

from __future__ import annotations

import numpy as np

from ..patches import Patches
from ..settings import Shape
from .edge_balance import Balance
from .edge_cells import PatchCells, cells_of, error_of, judged, squared_errors, widths
from .edge_cuts import Cuts
from .edge_light import EdgeLight

ROUNDS = 8, 8
"""How often borders are shared out before the cells are judged: three quarters of what can be won
comes with the first two times."""

GO_ON = 2
"""Of the cells that were tried, how many go into another round."""


def edge_split(patches: Patches, count: int, shape: Shape, allowed: float = 0.0) -> PatchCells:
    """At most `count` cells: as many as make the predicted error smaller, until it is `allowed`.

    patches: some, all of them lit. allowed: a part of all light; see `PatchCells.error`.
    """
    return split_of(patches, shape).cells(count, allowed)


def split_of(patches: Patches, shape: Shape) -> EdgeSplit:
    """The same one each time: cut for one number of cells, patches are cut for all smaller ones."""
    return patches.once(("split", shape), lambda: EdgeSplit(patches, shape))


class EdgeSplit:
    """Patches that are cut into cells: asked for several numbers of cells, they are cut once.

    patches: some, all of them lit.
    """

    def __init__(self, patches: Patches, shape: Shape) -> None:
        whole = EdgeLight.of(patches, shape)
        parts = whole.in_two_parts()
        self.patches = patches
        self._whole, self._truest = whole, Cuts(parts, squared_errors)
        lights = (whole,) if parts is whole else (whole, parts)
        self._beginnings = [(Balance(light), Cuts(light, widths)) for light in lights]

    def cells(self, count: int, allowed: float = 0.0) -> PatchCells:
        """See `edge_split`."""
        enough = self._enough(count, allowed)
        owner = self._truest.owner(enough)
        best = judged(self._whole, cells_of(self._whole, owner))
        if enough == 1:
            return best
        tried = []
        for balance, widest in self._beginnings:
            widest.grow(enough)
            for cut in (owner, widest.owner(min(enough, widest.count))):
                tried.append((balance, cells_of(balance.light, cut)))
        for steps in ROUNDS:
            tried = [
                (balance, judged(balance.light, balance.after(cells, steps)))
                for balance, cells in tried
            ]
            tried.sort(key=lambda one: one[1].error)
            best = min(best, tried[0][1], key=lambda cells: cells.error)
            tried = tried[:GO_ON]
        return best

    def error_of_cuts(self, count: int) -> float:
        """About what so many cells get wrong: before they are balanced; see `PatchCells.error`."""
        self._truest.grow(count)
        return error_of(self._truest.wrong[:count][-1])

    def _enough(self, count: int, allowed: float) -> int:
        """With how many cells, before they are balanced, least is wrong, or little enough."""
        self._truest.grow(count, allowed)
        last = min(count, self._truest.count)
        # Where only some of the worst are cut, the rest of them would be next.
        numbers = np.array([*(end for end in self._truest.ends if end < last), last])
        wrong = self._truest.wrong[numbers - 1]
        within = np.sqrt(wrong.max(axis=1)) <= allowed
        if within.any():
            wrong = wrong[: np.argmax(within) + 1]
        # A round sun cut in two is two bad halves.
        return int(numbers[np.argmin(wrong.sum(axis=1))])
