"""How many lights it takes: the fewest with which shadows are predicted to be right enough."""

from __future__ import annotations

from collections.abc import Callable
from math import log

from .placement import ChosenSuns

FALL = 1.1
"""The error falls about as the number of lights to this power, see docs/benchmarks/lights: a first
guess, so that few numbers must be tried."""

CAUTION = 2 / 3
"""What is most wrong of too few lights falls faster than what is expected, by this power: level
ground is at once right where no cell lies across the horizon any more."""

FEW = 24
"""The error of few lights falls the least evenly. None of 7 regions under nine maps that took more
would have got fewer of them."""

PROMISING = 1.6
"""Of 84 numbers of lights under nine maps, a quarter smaller than what was enough, four were enough
with care: without, these were wrong by at most 1.53 times what is allowed."""


def fewest(
    with_lights: Callable[[int], ChosenSuns],
    allowed: float,
    most: int,
    expected: Callable[[int], float] = lambda count: count**-FALL,
    with_care: Callable[[int], ChosenSuns] | None = None,
) -> ChosenSuns:
    """About the fewest suns, at most `most`, that are wrong by at most `allowed`:
    `ChosenSuns.worst`.

    expected: about how wrong so many are; a guess, so that few numbers must be tried. with_care:
    what takes longer than `with_lights` and is often less wrong.
    Where even `most` are not enough, those that are least wrong of all that were tried. The error
    need not fall evenly with the number; a number smaller by at most an eighth than is returned
    was tried too, without care, and was not enough: up to 15 lights that is the next smaller one.
    Of up to FEW so was a number smaller by a quarter, with care if that was PROMISING.
    """
    tried: dict[int, ChosenSuns] = {}

    def error(count: int) -> float:
        if count not in tried:
            tried[count] = with_lights(count)
        return tried[count].worst

    def error_with_care(count: int) -> float:
        if with_care and error(count) > allowed:
            tried[count] = min(tried[count], with_care(count), key=lambda one: one.worst)
        return error(count)

    low, high = 0, first_guess(allowed, most, expected)
    while error(high) > allowed and high < most:
        aim = expected(high) * (allowed / error(high)) ** CAUTION
        low, high = high, _guess(high + 1, aim, most, expected)
    if error(high) > allowed and error_with_care(high) > allowed:
        return min(tried.values(), key=lambda one: one.worst)
    while True:
        high = _least_between(low, high, error, allowed)
        fewer = high * 3 // 4
        if high > FEW or not fewer or error(fewer) > PROMISING * allowed:
            return tried[high]
        if error_with_care(fewer) > allowed:
            return tried[high]
        high = fewer
        low = max((n for n in tried if n < high and tried[n].worst > allowed), default=0)


def _least_between(low: int, high: int, error: Callable[[int], float], allowed: float) -> int:
    """About the least number from `low` + 1 to `high` that is wrong by at most `allowed`, as `high`
    is: one that is smaller by at most an eighth is not, or it is `low`, which is not either."""
    while high - low > max(high // 8, 1):
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
    return high


def first_guess(allowed: float, most: int, expected: Callable[[int], float]) -> int:
    """The number of lights that `fewest` tries first."""
    return _guess(1, allowed, most, expected)


def _guess(least: int, aim: float, most: int, expected: Callable[[int], float]) -> int:
    """The first number, from `least` up to `most`, that is expected to be no more wrong than `aim`;
    not many times more than `least`."""
    last = min(max(8 * least, 64), most)
    return next((n for n in range(least, last) if expected(n) <= aim), last)
