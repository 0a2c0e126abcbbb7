"""Cells for the truest shadows: cut where a shadow's edge would be most wrong, then balanced.

The cell for which that is worst is cut in two, until there are enough; then the cells share out
their borders among each other. Where they begin decides where they end: several beginnings are
tried, with colours weighed over the whole light or over its bright and its faint part each. The
better ends go on, with the worst cells cut again, and with colours drawn together more strongly;
the best of all is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..patches import Patches
from ..settings import Shape
from .edge_balance import Trial, balanced
from .edge_cells import PatchCells, cells_of, error_of, squared_errors, widths
from .edge_cuts import Cuts
from .edge_exchange import exchanged, filled
from .edge_light import EdgeLight, two_parts

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
"""Of so many numbers of cells the last ones are kept."""

Key, Made = TypeVar("Key"), TypeVar("Made")


def edge_split(
    patches: Patches,
    count: int,
    shape: Shape,
    allowed: float = 0.0,
    level: bool = False,
    rough: bool = False,
    fades: bool = False,
) -> PatchCells:
    """At most `count` cells: as many as make the predicted error smaller, until it is `allowed`.

    patches: some, all of them lit. allowed: a part of all light; see `PatchCells.error`. level:
    whether they are chosen by `PatchCells.level_error` instead. rough: of half of the first round,
    in little more than a quarter of the time; half of all are wrong by at most 3.4 % more. fades:
    see `EdgeLight`.
    """
    split = split_of(patches, shape, fades)
    return split.rough(count, allowed, level) if rough else split.cells(count, allowed, level)


def split_of(patches: Patches, shape: Shape, fades: bool = False) -> EdgeSplit:
    """The same one each time: cut for one number of cells, patches are cut for all smaller ones."""
    return patches.once(("split", shape, fades), lambda: EdgeSplit(patches, shape, fades))


class EdgeSplit:
    """Patches that are cut into cells: asked for several numbers of cells, they are cut once.

    patches: some, all of them lit.
    """

    def __init__(self, patches: Patches, shape: Shape, fades: bool = False) -> None:
        lights, part = [EdgeLight.of(patches, shape, fades)], two_parts(patches)
        if part is not None:
            lights.append(EdgeLight.of(patches, shape, fades, part))
        self._whole, self._truest = lights[0], Cuts(lights[-1], squared_errors)
        self._first: dict[tuple[int, bool], list[Trial]] = {}
        self._best: dict[tuple[int, bool], PatchCells] = {}
        self._beginnings = [(light, Cuts(light, widths)) for light in lights]

    def cells(self, count: int, allowed: float = 0.0, level: bool = False) -> PatchCells:
        """See `edge_split`."""
        enough = self._enough(count, allowed)
        # Often another number that is asked for comes to the same.
        return _kept(self._best, (enough, level), lambda: self._balanced(enough, level).cells)

    def rough(self, count: int, allowed: float = 0.0, level: bool = False) -> PatchCells:
        """See `edge_split`."""
        first = self._first_round(self._enough(count, allowed), level)
        return min(first, key=_by_error(level)).cells

    def _balanced(self, enough: int, level: bool) -> Trial:
        """The best of `enough` cells that were tried."""
        error = _by_error(level)
        cut, *tried = self._first_round(enough, level)
        if tried:
            for beginning in self._beginnings[1:]:
                tried += self._begun(*beginning, enough, level, error(cut))
        best = cut
        for _ in range(2 if tried else 0):
            tried = sorted(tried, key=error)[:GO_ON]
            best = min([best, *tried], key=error)
            ways = []
            for one in tried:
                moved = replace(one, cells=exchanged(one.light, one.cells, enough))
                ways += [moved, replace(one, together=STRONGER * one.together)]
            tried = balanced(ways, MORE)
        best = min([best, *tried], key=error)
        if len(best.cells.held) >= enough:
            return best
        more = replace(best, cells=filled(best.light, best.cells, enough))
        return min([best, *balanced([more], 0)], key=error)

    def _first_round(self, enough: int, level: bool) -> list[Trial]:
        """`enough` cells as they are cut, and more that share out their borders by colours weighed
        over the whole light."""

        def made() -> list[Trial]:
            cells = cells_of(self._whole, self._truest.owner(enough))
            [cut] = balanced([Trial(self._whole, cells)], 0)
            if enough == 1:
                return [cut]
            begun = self._begun(*self._beginnings[0], enough, level, _by_error(level)(cut))
            return [cut, *begun]

        return _kept(self._first, (enough, level), made)

    def _begun(
        self, light: EdgeLight, widest: Cuts, count: int, level: bool, of_cut: float
    ) -> list[Trial]:
        """So many cells by one way to weigh colours, from two beginnings; again, more gently, where
        they end up more wrong than cells as they are cut, `of_cut`."""
        error = _by_error(level)
        widest.grow(count)
        owners = self._truest.owner(count), widest.owner(min(count, widest.count))
        begun = [Trial(light, cells_of(light, owner)) for owner in owners]
        tried = balanced(begun, FIRST)
        worse = [
            replace(before, together=GENTLER * before.together)
            for before, after in zip(begun, tried, strict=True)
            if error(after) > of_cut
        ]
        return [*tried, *(balanced(worse, FIRST) if worse else [])]

    def error_of_cuts(self, count: int) -> float:
        """About what so many cells get wrong: before they are balanced; see `PatchCells.error`."""
        self._truest.grow(count)
        return error_of(self._truest.wrong(np.array([min(count, self._truest.count)]))[0])

    def _enough(self, count: int, allowed: float) -> int:
        """With how many cells, before they are balanced, least is wrong, or little enough."""
        self._truest.grow(count, allowed)
        last = min(count, self._truest.count)
        # Where only some of the worst are cut, the rest of them would be next.
        numbers = np.array([*(end for end in self._truest.ends if end < last), last])
        wrong = self._truest.wrong(numbers)
        within = np.sqrt(wrong.max(axis=1)) <= allowed
        if within.any():
            wrong = wrong[: np.argmax(within) + 1]
        # A round sun cut in two is two bad halves.
        return int(numbers[np.argmin(wrong.sum(axis=1))])


def _by_error(level: bool) -> Callable[[Trial], float]:
    return lambda one: one.cells.level_error if level else one.cells.error


def _kept(kept: dict[Key, Made], key: Key, make: Callable[[], Made]) -> Made:
    """The same as the last time for the LAST keys."""
    if key not in kept:
        if len(kept) == LAST:
            del kept[next(iter(kept))]
        kept[key] = make()
    return kept[key]
