"""How much memory there is, and how much a map takes.

What conversions take was measured, for files of every kind and width up to 16,384; a map that takes
more all the same is stopped in time, see `local`.
"""

from __future__ import annotations

import re
from pathlib import Path

import psutil

from ..settings import BadSetting
from .scan import MapFile

USED_BY_ITSELF = 0.75
"""Of what is free when work begins: others want to work, too."""

MEGABYTE = 1024**2

WORKER = 230 * MEGABYTE
"""A worker with its libraries and a map 1,024 wide: 190 to 228 after many of them."""

PER_COLUMN = 16 * 1024
"""Bytes for each pixel of width of a map that is read a few rows at a time: 0 to 15 KB, most for
.hdr."""

PER_COLUMN_WRITTEN = 32 * 1024
"""And where all pixels are written, too: 15 to 31 KB, most for DWAB."""

PER_HELD_PIXEL = 24
"""Bytes for each pixel of a map that can only be read all at once: 11 for EXR of two parts, 20 for
TIFF."""

LEAST = 400 * MEGABYTE
"""For this program and one worker."""

WIDE = 1024
"""Pixels of width up to which maps are read whole, see `environment.WIDE`."""

_UNITS = {"": 1, "k": 1024, "m": MEGABYTE, "g": 1024**3, "t": 1024**4}


def parse_memory(text: str) -> int:
    """Bytes of "800M", "16G" or "1.5 GiB". Raises BadSetting."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kmgt]?)(?:i?b)?\s*", text.lower())
    if not found:
        raise BadSetting(f"memory must be a number of bytes such as 800M or 16G, not {text!r}.")
    return int(float(found[1]) * _UNITS[found[2]])


def usable_memory() -> int:
    """Bytes that a run may take by itself, of what is free on this machine or for this group of
    processes."""
    return int(USED_BY_ITSELF * min([psutil.virtual_memory().available, *_left_in_group()]))


def memory_of(file: MapFile, written: int) -> int:
    """Bytes that converting a map takes at most, its worker's included, but for rare files.

    written: width of the widest residual map that is asked for; 0: as light needs.
    """
    if file.held:
        return WORKER + PER_HELD_PIXEL * file.width * file.height
    each = PER_COLUMN_WRITTEN if written > WIDE else PER_COLUMN
    return WORKER + each * max(file.width - WIDE, 0)


def _left_in_group() -> list[int]:
    """What Linux lets a container have more, where there is such a limit."""
    group = Path("/sys/fs/cgroup")
    try:
        limit = (group / "memory.max").read_text().strip()
        used = int((group / "memory.current").read_text())
    except (OSError, ValueError):
        return []
    return [] if limit == "max" else [max(int(limit) - used, 0)]
