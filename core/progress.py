"""Progress of long work: a plain callback, so that a terminal, a window and a test can listen.

A listener that wants to cancel raises an exception of its own; nothing in `core` catches it.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from . import interrupts

if TYPE_CHECKING:
    from tqdm import tqdm

Progress = Callable[[str, float], None]
"""Called with the name of the stage that begins and the fraction of all work done, 0 to 1."""

REPAINT = 0.2
"""Seconds between two paintings of the bar: a stage may last long, and the clock should run."""


def silent(stage: str, fraction: float) -> None:
    """Listen to nothing."""


@contextmanager
def terminal_progress(delay: float = 1.0) -> Iterator[Progress]:
    """A bar on stderr that appears only on a terminal and only when work takes over `delay` s."""
    if not (sys.stderr and sys.stderr.isatty()):
        yield lambda stage, fraction: interrupts.check()
        return
    # A descriptor of its own, because reading a file keeps libraries off stderr.
    with os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding="utf-8") as terminal:
        yield from _painted_bar(terminal, delay)


def _painted_bar(terminal: object, delay: float) -> Iterator[Progress]:
    from tqdm import tqdm

    bar_format = "{desc:<24}{percentage:3.0f}% |{bar}| {elapsed}"
    done = threading.Event()
    # tqdm itself paints only when told of progress, and a long stage tells of none.
    bar = tqdm(total=1.0, file=terminal, delay=delay, leave=False, bar_format=bar_format)
    painter = threading.Thread(target=_paint, args=(bar, delay, done), daemon=True)

    def report(stage: str, fraction: float) -> None:
        interrupts.check()
        bar.set_description(stage, refresh=False)
        bar.n = fraction

    painter.start()
    try:
        yield report
    finally:
        done.set()
        painter.join()
        bar.close()


def _paint(bar: tqdm, delay: float, done: threading.Event) -> None:
    if done.wait(delay):
        return
    bar.delay = 0  # shown, so that closing it clears the line
    while not done.is_set():
        bar.refresh()
        done.wait(REPAINT)
