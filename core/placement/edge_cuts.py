"""Cells cut in two, the worst first: one run holds the cells of every smaller number, too."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .edge_cells import error_of
from .edge_light import EdgeLight, Floats, Owner

ONE_IN = 8
"""One in so many cells is cut at a time: the worst of many would be cut soon anyway."""

Measure = Callable[[EdgeLight, Owner, Owner, int], Floats]
"""What is wrong of cells: `edge_cells.squared_errors`, or like it."""


@dataclass(order=True)
class _Cell:
    """A cell that may be cut; of equal badness the one that was made first comes first."""

    rank: tuple[float, int]
    number: int = field(compare=False)
    members: Owner = field(compare=False)
    wrong: Floats = field(compare=False)


class Cuts:
    """One cell, two cells, ... of the patches of a light; more are cut when they are asked for.

    ends: how many cells there were each time after the worst were cut, rising.
    """

    def __init__(self, light: EdgeLight, measure: Measure) -> None:
        self._light, self._measure = light, measure
        self._owner = np.zeros(len(light), np.intp)
        self._parents = [0]
        self.ends = [1]
        self._wrong: list[Floats] = []
        self._heap: list[_Cell] = []
        self._made = 0
        everything = np.arange(len(self._owner))
        self._wrong.append(self._measured([(0, everything)])[0])

    @property
    def count(self) -> int:
        """How many cells there are by now."""
        return len(self._parents)

    def wrong(self, counts: Owner) -> Floats:
        """Sums of what is measured of so many cells, (n,), at most `count` each: (n, JUDGED)."""
        return np.stack([self._wrong[number - 1] for number in counts])

    def grow(self, count: int, allowed: float = -1.0) -> None:
        """Cut until there are `count` cells or a few more, or nothing can be cut, or only `allowed`
        is wrong: see `error_of`."""
        while self._heap and self.count < count and error_of(self._wrong[-1]) > allowed:
            # Never fewer at a time: what comes out must not depend on what was asked for before.
            self._cut(min(max(self.count // ONE_IN, 1), len(self._heap)))

    def owner(self, count: int) -> Owner:
        """The cell of each patch, (p,), as it was when there were so many cells."""
        before = np.arange(self.count)
        for number in range(count, self.count):
            before[number] = before[self._parents[number]]
        return before[self._owner]

    def _cut(self, most: int) -> None:
        """Cut the worst `most` cells."""
        cut: list[_Cell] = []
        made: list[tuple[int, Owner]] = []
        for _ in range(most):
            worst = heapq.heappop(self._heap)
            first = self._light.halves(worst.members)
            if first is None:
                continue
            self._owner[worst.members[~first]] = self.count
            made += [(worst.number, worst.members[first]), (self.count, worst.members[~first])]
            self._parents.append(worst.number)
            cut.append(worst)
        if not made:
            return
        wrong = self._measured(made)
        for number, worst in enumerate(cut):
            halves = wrong[2 * number] + wrong[2 * number + 1]
            self._wrong.append(self._wrong[-1] - worst.wrong + halves)
        self.ends.append(self.count)

    def _measured(self, made: list[tuple[int, Owner]]) -> Floats:
        """What is wrong of new cells, (m, JUDGED), which may be cut from now on."""
        members = np.concatenate([some for _, some in made])
        cell = np.repeat(np.arange(len(made)), [len(some) for _, some in made])
        found = self._measure(self._light, members, cell, len(made))
        for (number, some), wrong in zip(made, found, strict=True):
            rank = (-float(wrong.sum()), self._made)
            heapq.heappush(self._heap, _Cell(rank, number, some, wrong))
            self._made += 1
        return found
