"""What is known of the map that was converted last: nothing is found out twice.

A map is known by its pixels, wherever they come from, so an image that was changed or loaded again
is never taken for what it was.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.conversion import Conversion, convert
from ..core.environment import EnvironmentMap
from ..core.settings import ConversionSettings
from ..core.visible import VisiblePart

MOST_BYTES = 2**28
"""Of a map's pixels: what is larger, 8k and up, is not kept in memory."""

_BLOCK = 2**16
"""Numbers that are summed into one by a fingerprint."""

_WEIGHTS = np.random.default_rng(0).integers(2**64, size=_BLOCK, dtype=np.uint64) | np.uint64(1)


@dataclass(frozen=True, eq=False)
class _Known:
    """conversion: the last one of this map; made for these settings and this visible part."""

    fingerprint: str
    environment: EnvironmentMap
    made_for: object = None
    conversion: Conversion | None = None


_last: list[_Known] = []


def known_map(
    pixels: NDArray[np.float32], name: str, read: Callable[[], EnvironmentMap]
) -> EnvironmentMap:
    """The map of some pixels, with all that is known of it, or else what `read` makes of them."""
    if pixels.nbytes > MOST_BYTES:
        forget()
        return read()
    fingerprint = f"{name} {pixels.size} {_fingerprint(pixels)}"
    if not _last or _last[0].fingerprint != fingerprint:
        environment = read()
        _last[:] = [_Known(fingerprint, environment)]
    return _last[0].environment


def known_conversion(
    environment: EnvironmentMap, settings: ConversionSettings, visible: VisiblePart | None
) -> Conversion:
    """A conversion of a map, the last one if it is the same."""
    made_for = settings, visible.key if visible else None
    for known in _last:
        if known.environment is environment and known.made_for == made_for and known.conversion:
            return known.conversion
    conversion = convert(environment, settings, visible=visible)
    _last[:] = [
        _Known(known.fingerprint, environment, made_for, conversion)
        for known in _last
        if known.environment is environment
    ]
    return conversion


def forget() -> None:
    """Free the memory."""
    _last.clear()


def _fingerprint(pixels: NDArray[np.float32]) -> str:
    """Differs where pixels do: sums with odd weights modulo 2^64, and a hash of these; a hash of
    all pixels would take as long as what is to be saved."""
    whole = pixels.size // (2 * _BLOCK) * 2 * _BLOCK
    sums = pixels[:whole].view(np.uint64).reshape(-1, _BLOCK) @ _WEIGHTS
    return hashlib.sha256(sums.tobytes() + pixels[whole:].tobytes()).hexdigest()
