"""Libraries that print on their own account, kept from doing so."""

from __future__ import annotations

import ctypes
import io
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import BinaryIO, TextIO

STDOUT, STDERR = 1, 2

MOST_REMARKS = 1 << 16
"""Bytes of what libraries print that anyone looks at."""

_one_at_a_time = threading.RLock()
"""Two threads that swap the same descriptor would restore each other's replacement."""


@contextmanager
def quiet_libraries() -> Iterator[io.StringIO]:
    """Keep C libraries off stderr and stdout; yields what they have said, once the block has ended.

    A damaged file is one sentence of ours. OpenEXR, OpenJPH in it and libpng add lines of their own
    on the descriptors themselves, and OpenEXR on Python's stdout, in the midst of a JSON answer.
    """
    with _one_at_a_time, redirect_stdout(io.StringIO()) as remarks, _scratch_file() as printed:
        _flush_c()
        if sys.stderr:
            sys.stderr.flush()
        with (
            _redirected(STDOUT, sys.__stdout__, printed),
            _redirected(STDERR, sys.__stderr__, printed),
        ):
            try:
                yield remarks
            finally:
                _flush_c()
        printed.seek(0)
        remarks.write(printed.read(MOST_REMARKS).decode(errors="replace"))


def _scratch_file() -> BinaryIO:
    """A file without a name; where there is no room for one, nowhere."""
    try:
        return tempfile.TemporaryFile()
    except OSError:
        return Path(os.devnull).open("w+b")


def _flush_c() -> None:
    """C libraries keep back what they print until there is more of it: print it now."""
    ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)


@contextmanager
def _redirected(descriptor: int, own: TextIO | None, file: BinaryIO) -> Iterator[None]:
    """What is printed on a descriptor goes into a file. own: what Python has on it, if anything.

    Where it was closed from the beginning, its number may by now be that of a map being read.
    """
    try:
        kept = os.dup(descriptor) if own else None
    except OSError:
        kept = None
    if kept is None:
        yield
        return
    try:
        os.dup2(file.fileno(), descriptor)
        yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)
