"""Progress of long work: a plain callback, so that a terminal, a window and a test can listen.

A listener that wants to cancel raises an exception of its own; nothing in `core` catches it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, float], None]
"""Called with the name of the stage that begins and the fraction of all work done, 0 to 1."""


def silent(stage: str, fraction: float) -> None:
    """Listen to nothing."""


@contextmanager
def terminal_progress(delay: float = 1.0) -> Iterator[Progress]:
    """A bar on stderr that appears only on a terminal and only when work takes over `delay` s."""
    from tqdm import tqdm

    bar_format = "{desc:<24}{percentage:3.0f}% |{bar}| {elapsed}"
    disable = not sys.stderr.isatty()
    with tqdm(total=1.0, delay=delay, disable=disable, leave=False, bar_format=bar_format) as bar:

        def report(stage: str, fraction: float) -> None:
            bar.set_description(stage, refresh=False)
            bar.update(fraction - bar.n)

        yield report
