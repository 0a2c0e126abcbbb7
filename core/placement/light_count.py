"""How many lights it takes: the fewest with which shadows are predicted to be right enough."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, log

from .placement import ChosenSuns

FALL = 1.1
"""The error falls about as the number of lights to this power, see docs/benchmarks/lights: a first
guess, so that few numbers must be tried."""


def fewest(with_lights: Callable[[int], ChosenSuns], allowed: float, most: int) -> ChosenSuns:
    """The fewest suns, at most `most`, that are wrong by at most `allowed`: `ChosenSuns.worst`.

    Where even `most` are not enough, those that are least wrong of all that were tried. The error
    need not fall evenly with the number; the next smaller number than is returned was tried too,
    and is not enough.
    """
    tried: dict[int, ChosenSuns] = {}

    def error(count: int) -> float:
        if count not in tried:
            tried[count] = with_lights(count)
        return tried[count].worst

    low, high = 0, 1
    while error(high) > allowed:
        if high >= most:
            return min(tried.values(), key=lambda one: one.worst)
        low, high = high, min(max(_guess(high, error(high), allowed), high + 1), most)
    while high - low > 1:
        middle = (low + high) // 2
        if low and error(low) > allowed > error(high) > 0:
            # On a line between the two, in logarithms, but well inside of them.
            part = log(error(low) / allowed) / log(error(low) / error(high))
            middle = round(low * (high / low) ** part)
            eighth = (high - low) // 8
            middle = min(max(middle, low + 1 + eighth), high - 1 - eighth)
            middle = min(max(middle, low + 1), high - 1)
        if error(middle) > allowed:
            low = middle
        else:
            high = middle
    return tried[high]


def _guess(count: int, error: float, allowed: float) -> int:
    return ceil(count * min((error / allowed) ** (1 / FALL), 8.0))
