"""Cells for the truest shadows: cut where a shadow's edge would be most wrong, then balanced.

The cell for which that is worst is cut in two, until there are enough; then the cells share out
their borders among each other. Where they begin decides where they end: several beginnings are
tried, with colours weighed over the whole light or over its bright and its faint part each. The
better ends go on, with the worst cells cut again, and with colours drawn together more strongly;
the best of all is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..patches import Patches
from ..settings import Shape
from .edge_balance import TOGETHER, Balance
from .edge_cells import PatchCells, cells_of, error_of, judged, squared_errors, widths
from .edge_cuts import Cuts
from .edge_exchange import exchanged, filled
from .edge_light import EdgeLight, Owner

FIRST, MORE = 8, 4
"""How often borders are shared out before cells are judged: at first, and after other changes.
Three quarters of what can be won comes with the first two times."""

GO_ON = 2
"""Of the cells that were tried, how many go into another round."""

STRONGER = 2.0
"""In another round colours are also drawn together by so many times as much as before. With this
and the cells that are moved, the worst channel of 4, 16 and 64 lights for 17 maps is wrong by 6.2,
1.23 and .328 % instead of 6.6, 1.30 and .335 %."""

GENTLER = 0.5
"""Where sharing out makes cells worse than they were cut, colours are drawn together so much less:
among lights of strong colours cells tear each other apart."""


LAST = 8
"""Of so many numbers of cells the last ones are kept: an eighth of a megabyte each at most."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """Cells on their way. together: see `edge_balance.TOGETHER`."""

    balance: Balance
    cells: PatchCells
    together: float = TOGETHER

    def after(self, steps: int) -> _Trial:
        """With borders shared out so many times, and judged."""
        cells = self.balance.after(self.cells, steps, self.together)
        return replace(self, cells=judged(self.balance.light, cells))

    def moved(self, count: int) -> _Trial:
        """With the worst cells cut and others joined: `count` cells."""
        return replace(self, cells=exchanged(self.balance.light, self.cells, count))

    def drawn(self, times: float) -> _Trial:
        """With colours drawn together by so many times as much from now on."""
        return replace(self, together=times * self.together)

    def filled(self, count: int) -> list[_Trial]:
        """With cells in the place of lost ones, if any are."""
        if len(self.cells.held) >= count:
            return []
        more = filled(self.balance.light, self.cells, count)
        return [replace(self, cells=more).after(0)]


def edge_split(
    patches: Patches, count: int, shape: Shape, allowed: float = 0.0, level: bool = False
) -> PatchCells:
    """At most `count` cells: as many as make the predicted error smaller, until it is `allowed`.

    patches: some, all of them lit. allowed: a part of all light; see `PatchCells.error`. level:
    whether they are chosen by `PatchCells.level_error` instead.
    """
    return split_of(patches, shape).cells(count, allowed, level)


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
        self._last: dict[tuple[int, bool], PatchCells] = {}
        self._beginnings = [(Balance(light), Cuts(light, widths)) for light in lights]

    def cells(self, count: int, allowed: float = 0.0, level: bool = False) -> PatchCells:
        """See `edge_split`."""

        made = self._enough(count, allowed), level
        if made not in self._last:  # often another number that is asked for comes to the same
            if len(self._last) == LAST:
                del self._last[next(iter(self._last))]
            self._last[made] = self._balanced(*made)
        return self._last[made]

    def _balanced(self, enough: int, level: bool) -> PatchCells:
        """The best of `enough` cells that were tried."""

        def error(trial: _Trial) -> float:
            return trial.cells.level_error if level else trial.cells.error

        owner = self._truest.owner(enough)
        cut = _Trial(self._beginnings[0][0], cells_of(self._whole, owner)).after(0)
        if enough == 1:
            return cut.cells
        first = []
        for trial in self._begun(owner, enough):
            first.append(trial.after(FIRST))
            if error(first[-1]) > error(cut):
                first.append(trial.drawn(GENTLER).after(FIRST))
        tried, best = first, cut
        for _ in range(2):
            tried = sorted(tried, key=error)[:GO_ON]
            best = min([best, *tried], key=error)
            ways = [way for one in tried for way in (one.moved(enough), one.drawn(STRONGER))]
            tried = [way.after(MORE) for way in ways]
        best = min([best, *tried], key=error)
        return min([best, *best.filled(enough)], key=error).cells

    def _begun(self, owner: Owner, count: int) -> list[_Trial]:
        """From different beginnings. owner: of the cells that are cut by predicted error, (p,)."""
        begun = []
        for balance, widest in self._beginnings:
            widest.grow(count)
            for one in (owner, widest.owner(min(count, widest.count))):
                begun.append(_Trial(balance, cells_of(balance.light, one)))
        return begun

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
