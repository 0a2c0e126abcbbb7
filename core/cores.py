"""How many cores of the processor a process may use."""

from __future__ import annotations

import os

LIMIT = "SUNSPLIT_CORES"
"""Environment variable with a smaller number: workers that share a machine have one core each."""


def usable() -> int:
    """At least 1: the cores that this process is allowed, or what `LIMIT` says."""
    asked = os.environ.get(LIMIT, "")
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):  # where a farm's scheduler has given us only some
        return len(os.sched_getaffinity(0)) or 1
    return os.cpu_count() or 1
