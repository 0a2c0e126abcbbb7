"""What is known of the map that was converted last: nothing is found out twice.

A map is known by its file, as it was written last, or by its pixels where they come from anywhere
else: an image that was changed or loaded again is never taken for what it was.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core.conversion import Conversion, convert
from ..core.environment import EnvironmentMap
from ..core.progress import Progress, silent
from ..core.settings import ConversionSettings
from ..core.visible import VisiblePart

MOST_BYTES = 2**28
"""Of pixels in memory: a map of more, 8k and up, is not kept. Of a file only what it was narrowed
to is held anyway."""

CONVERSIONS = 2
"""Of a map are kept: of a scene with openings two are asked for in turn."""

_BLOCK = 2**16
"""Numbers that are summed into one by a fingerprint."""

_WEIGHTS = np.random.default_rng(0).integers(2**64, size=_BLOCK, dtype=np.uint64) | np.uint64(1)


@dataclass(frozen=True, eq=False)
class _Known:
    """made: the last conversions of this map, by the settings and visible part they are for."""

    fingerprint: str
    environment: EnvironmentMap
    made: Mapping[object, Conversion] = field(default_factory=dict)


_last: list[_Known] = []


def known_map(
    pixels: NDArray[np.float32], name: str, read: Callable[[], EnvironmentMap]
) -> EnvironmentMap:
    """The map of some pixels, with all that is known of it, or else what `read` makes of them."""
    if pixels.nbytes > MOST_BYTES:
        forget()
        return read()
    return _known_or_read(f"{name} {pixels.size} {_fingerprint(pixels)}", read)


def known_file(path: Path, name: str, read: Callable[[], EnvironmentMap]) -> EnvironmentMap:
    """The map of a file, with all that is known of it, or else what `read` makes of it. A file is
    another one when it was written again."""
    at = path.stat()
    return _known_or_read(f"{name} {path} {at.st_ino} {at.st_size} {at.st_mtime_ns}", read)


def _known_or_read(fingerprint: str, read: Callable[[], EnvironmentMap]) -> EnvironmentMap:
    if not _last or _last[0].fingerprint != fingerprint:
        environment = read()
        _last[:] = [_Known(fingerprint, environment)]
    return _last[0].environment


def known_conversion(
    environment: EnvironmentMap,
    settings: ConversionSettings,
    visible: VisiblePart | None,
    progress: Progress = silent,
) -> Conversion:
    """A conversion of a map, one of the last if it is the same."""
    made_for = settings, visible.whole_key if visible else None
    known = next((one for one in _last if one.environment is environment), None)
    if known and made_for in known.made:
        return known.made[made_for]
    conversion = convert(environment, settings, progress, visible)
    if known:
        made = {**known.made, made_for: conversion}
        last = dict(list(made.items())[-CONVERSIONS:])
        _last[:] = [_Known(known.fingerprint, environment, last)]
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
