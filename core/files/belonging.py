"""Files that belong together are read together: all of one conversion, never of two."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from ..errors import UnusableInput
from . import journal
from .atomic import finish_interrupted

PATIENCE = 10.0
"""Seconds to wait for a writer, who takes names in some milliseconds."""

Read = TypeVar("Read")


class NotTogether(UnusableInput):
    """A file is not the one that another one belongs to."""


def sha256(path: Path) -> str:
    """Of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_together(document: Path, read: Callable[[], Read]) -> Read:
    """What `read` makes of a document and the files that it names.

    What a killed process has begun there is finished first. Where the files do not belong
    together they are read once more, when nobody else can be writing. Raises UnusableInput.
    """
    finish_interrupted(document.parent)
    try:
        return read()
    except NotTogether:
        # Where one may not write, no lock can be had: then the first answer holds.
        with suppress(OSError), journal.alone(document.parent, PATIENCE):
            return read()
        raise


def read_named(file: Path, stated: str | None, by: str, read: Callable[[Path], Read]) -> Read:
    """What `read` makes of a file whose SHA-256 the document `by` states; older ones state none.

    Raises NotTogether when it is missing or another one, UnusableInput when it cannot be read.
    """
    try:
        before = _identity(file)
        same = stated is None or sha256(file) == stated
        try:
            content = read(file) if same else None
        except UnusableInput:
            if _identity(file) == before:
                raise
            same = False
        same = same and _identity(file) == before  # else it was replaced under our eyes
    except FileNotFoundError as error:
        raise NotTogether(f"{file} is missing: convert the map again.") from error
    except OSError as error:
        raise UnusableInput(f"{file} cannot be read: {error.strerror}.") from error
    if not same:
        raise NotTogether(
            f"{file.name} was changed or is of another conversion than {by}: convert the map again."
        )
    return content


def _identity(file: Path) -> tuple[int, ...]:
    status = file.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
