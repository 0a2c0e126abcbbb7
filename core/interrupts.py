"""Ctrl-C that is neither lost nor untimely. Only where Python itself handles it.

In Blender, or in a thread, no KeyboardInterrupt can come, and nothing here does anything.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_asked = threading.Event()


def check() -> None:
    """Raise a KeyboardInterrupt that Python has dropped; see `remembered`."""
    if _asked.is_set():
        raise KeyboardInterrupt


@contextmanager
def remembered() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt as ever, and `check` raises it again.

    Where it arises in a callback, of a weak reference during an import for instance, Python
    prints "Exception ignored" and goes on: the user would wait for what they have cancelled. Where
    it arises while a C library is imported, the library makes an ImportError of it.
    """
    if not _is_handled():
        yield
        return
    _asked.clear()
    handler, hook = signal.signal(signal.SIGINT, _remember), sys.unraisablehook
    sys.unraisablehook = _without_interrupts
    try:
        yield
    except Exception as error:
        if _asked.is_set():
            raise KeyboardInterrupt from error
        raise
    finally:
        sys.unraisablehook = hook
        signal.signal(signal.SIGINT, handler)
        _asked.clear()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Ctrl-C waits until the block has ended."""
    if not _is_handled():
        yield
        return
    late: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: late.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if late:
        raise KeyboardInterrupt


def _is_handled() -> bool:
    in_main_thread = threading.current_thread() is threading.main_thread()
    return in_main_thread and callable(signal.getsignal(signal.SIGINT))


def _remember(number: int, frame: FrameType | None) -> None:
    _asked.set()
    raise KeyboardInterrupt


def _without_interrupts(dropped: sys.UnraisableHookArgs) -> None:
    if not issubclass(dropped.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(dropped)
