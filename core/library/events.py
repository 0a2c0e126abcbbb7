"""What is told while a library is converted: to a listener, and to Python's `logging`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .records import Row

log = logging.getLogger("sunsplit")
"""What happens to each map, for pipelines that listen: failures are warnings."""
log.addHandler(logging.NullHandler())  # else Python prints them where nobody listens


@dataclass(frozen=True)
class Settled:
    """A map of which nothing more is to be done. known: it had been converted before. number: of
    maps that are settled, out of `total`. fraction: of all work done, 0 to 1, about."""

    row: Row
    known: bool
    number: int
    total: int
    fraction: float


@dataclass(frozen=True)
class AssetSettled:
    """A .blend file of which nothing more is to be done.

    blend: its path from the output's folder, with slashes. sources: the maps in it, from the
    library's. known: whether it had been made before. sentence: why it could not be made, or which
    maps are not in it; "" where all is well. number: of files that are settled, out of `total`.
    """

    blend: str
    sources: tuple[str, ...]
    known: bool
    sentence: str
    number: int
    total: int


Event = Settled | AssetSettled

Listener = Callable[[Event], None]
"""Called in the thread that has called `convert_library`; what it raises ends the run."""


class Told:
    """Counts what is settled, and tells the listener. weights: of all maps, in seconds or so."""

    def __init__(self, weights: Sequence[float], listen: Listener | None) -> None:
        self._weights, self._whole, self._listen = weights, sum(weights), listen
        self._number, self._weight = 0, 0.0

    def settled(self, number: int, row: Row, known: bool) -> None:
        """The map of this number is."""
        self._number += 1
        self._weight += self._weights[number]
        if row.status == "failed":
            log.warning("%s: %s", row.source, row.sentence)
        elif not known:
            log.info("%s: %d lights, %.1f s", row.source, row.lights, row.seconds)
        if self._listen:
            total, fraction = len(self._weights), self._weight / self._whole
            self._listen(Settled(row, known, self._number, total, fraction))

    def asset(self, asset: AssetSettled) -> None:
        """A .blend file is."""
        if asset.sentence:
            log.warning("%s: %s", asset.blend, asset.sentence)
        elif not asset.known:
            log.info("%s", asset.blend)
        if self._listen:
            self._listen(asset)
