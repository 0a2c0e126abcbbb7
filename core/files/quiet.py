"""Libraries that print on their own account, kept from doing so."""

from __future__ import annotations

import io
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

STDERR = 2

_one_at_a_time = threading.RLock()
"""Two threads that swap the same descriptor would restore each other's replacement."""


@contextmanager
def quiet_libraries() -> Iterator[io.StringIO]:
    """Keep C libraries off stderr, and OpenEXR's remarks off stdout; yields those remarks.

    A damaged file is one sentence of ours. OpenEXR and libpng add lines of their own on the
    descriptor itself, and OpenEXR prints to Python's stdout, in the midst of a JSON answer.
    """
    with _one_at_a_time, redirect_stdout(io.StringIO()) as remarks, _descriptor_to_nowhere(STDERR):
        yield remarks


@contextmanager
def _descriptor_to_nowhere(descriptor: int) -> Iterator[None]:
    if sys.stderr:
        sys.stderr.flush()
    try:
        kept = os.dup(descriptor)
    except OSError:  # it is closed: there is nothing to keep quiet
        yield
        return
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
        yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)
