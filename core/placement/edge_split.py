"""Cells for the truest shadows: cut where a shadow's edge would be most wrong, then balanced.

The cell for which that is worst is cut in two, until there are enough; then the cells share out
their borders among each other. Where they begin decides where they end: several beginnings are
tried, with colours weighed over the whole light or over its bright and its faint part each, and
the best end is taken.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from itertools import count as counter

import numpy as np

from ..patches import Patches
from ..settings import Shape
from .edge_light import JUDGED, EdgeLight, Floats, Owner, PatchCells, error_of

ROUNDS = 8, 8
"""How often borders are shared out before the cells are judged: three quarters of what can be won
comes with the first two times."""

GO_ON = 2
"""Of the cells that were tried, how many go into another round."""

ONE_IN = 8
"""One in so many cells is cut at a time: the worst of many would be cut soon anyway."""

Measure = Callable[[Owner, Owner, int], Floats]
"""What is wrong of cells: `EdgeLight.squared_errors`, or like it."""


def edge_split(patches: Patches, count: int, shape: Shape, allowed: float = 0.0) -> PatchCells:
    """At most `count` cells: as many as make the predicted error smaller, until it is `allowed`.

    patches: some, all of them lit. allowed: a part of all light; see `PatchCells.error`.
    """
    whole = EdgeLight.of(patches, shape)
    parts = whole.in_two_parts()
    owner = _truest_cuts(parts, count, allowed)
    enough = int(owner.max()) + 1
    best = whole.judge(whole.cells(owner))
    if enough == 1:
        return best
    lights = (whole,) if parts is whole else (whole, parts)
    tried = [
        (light, light.cells(cut))
        for light in lights
        for cut in (owner, _widest_cuts(light, enough))
    ]
    for steps in ROUNDS:
        tried = [(light, light.judge(_balanced(light, cells, steps))) for light, cells in tried]
        tried.sort(key=lambda one: one[1].error)
        best = min(best, tried[0][1], key=lambda cells: cells.error)
        tried = tried[:GO_ON]
    return best


def _truest_cuts(light: EdgeLight, count: int, allowed: float) -> Owner:
    best, least = np.zeros(0, np.intp), np.inf
    for owner, squared in _cuts(light, count, light.squared_errors):
        if squared.sum() < least:  # a round sun cut in two is two bad halves
            best, least = owner.copy(), squared.sum()
        if error_of(squared) <= allowed:
            break
    return best


def _widest_cuts(light: EdgeLight, count: int) -> Owner:
    for owner, _ in _cuts(light, count, light.widths):
        last = owner
    return last


def _cuts(light: EdgeLight, count: int, measure: Measure) -> Iterator[tuple[Owner, Floats]]:
    """One cell, two cells, ... up to `count`, at last a few more each time: the owner of each
    patch, the same array each time, and the sum of what is measured, (JUDGED,)."""
    owner = np.zeros(len(light.patches), np.intp)
    order = counter()  # cells of equal badness in the order in which they were made
    heap: list[tuple[float, int, int, Owner, Floats]] = []
    total = np.zeros(JUDGED)

    def add(made: list[tuple[int, Owner]]) -> None:
        members = np.concatenate([some for _, some in made])
        cell = np.repeat(np.arange(len(made)), [len(some) for _, some in made])
        for (number, some), wrong in zip(made, measure(members, cell, len(made)), strict=True):
            heapq.heappush(heap, (-wrong.sum(), next(order), number, some, wrong))
            total[:] += wrong

    add([(0, np.arange(len(owner)))])
    cells = 1
    yield owner, total
    while heap and cells < count:
        made: list[tuple[int, Owner]] = []
        for _ in range(min(max(cells // ONE_IN, 1), count - cells, len(heap))):
            _, _, number, members, wrong = heapq.heappop(heap)
            first = light.halves(members)
            if first is None:
                continue
            total -= wrong
            owner[members[~first]] = cells
            made += [(number, members[first]), (cells, members[~first])]
            cells += 1
        if made:
            add(made)
            yield owner, total


def _balanced(light: EdgeLight, cells: PatchCells, steps: int) -> PatchCells:
    """The cells after sharing out their borders so many times."""
    for _ in range(steps):
        cells = light.cells(light.shared_out(cells))
    return cells
