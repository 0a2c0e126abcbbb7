"""How much memory there is, and how much a map takes.

What conversions take was measured with `tests.benchmarks.library_memory`.
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

WORKER = 256 * MEGABYTE
"""A worker with its libraries and a map that is looked at with 1,024 pixels of width."""

PER_COLUMN = 16 * 1024
"""Bytes for each pixel of width of a map that is read a few rows at a time."""

PER_HELD_PIXEL = 40
"""Bytes for each pixel of a map that can only be read all at once."""

LEAST = 512 * MEGABYTE
"""For this program and one worker."""

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


def memory_of(file: MapFile) -> int:
    """Bytes that converting a map takes at most, its worker's included."""
    pixels = file.width * file.height
    if file.held:
        return WORKER + PER_HELD_PIXEL * pixels
    return WORKER + PER_COLUMN * max(file.width - 1024, 0)


def _left_in_group() -> list[int]:
    """What Linux lets a container have more, where there is such a limit."""
    group = Path("/sys/fs/cgroup")
    try:
        limit = (group / "memory.max").read_text().strip()
        used = int((group / "memory.current").read_text())
    except (OSError, ValueError):
        return []
    return [] if limit == "max" else [max(int(limit) - used, 0)]
