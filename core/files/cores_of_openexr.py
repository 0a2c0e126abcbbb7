"""OpenEXR on all cores that there are for us: by itself it uses one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..cores import usable


@contextmanager
def on_all_cores() -> Iterator[None]:
    """What OpenEXR reads and writes meanwhile; the files are the same to the last bit."""
    import OpenEXR

    before = OpenEXR.global_thread_count()
    OpenEXR.set_global_thread_count(usable())
    try:
        yield
    finally:
        OpenEXR.set_global_thread_count(before)
