"""Locks between processes, lifted by the system when their holder dies, however it dies.

On the standard library alone: the extension ships no package for it. Where a file system knows no
locks, as some network drives do, all get them: writing is then as safe as one program alone is.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

PATIENCE = 60.0
"""Seconds to wait for others, who hold a lock for some milliseconds each."""

PAUSE = 0.01

_HELD = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}
"""What systems say of a lock that another one holds."""

_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL}

if os.name == "nt":
    import msvcrt

    def _lock(file: BinaryIO) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: BinaryIO) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def take(path: Path, without: bool = True) -> BinaryIO | None:
    """Lock a file, made where there is none; None where another one holds it.

    The lock lasts until the file is closed or its process ends. without: go on where there are no
    locks; else None. Raises OSError where the file cannot be made.
    """
    file = path.open("ab")
    try:
        _lock(file)
    except OSError as error:
        if without and error.errno in _NO_LOCKS:
            return file
        file.close()
        if error.errno in _HELD | _NO_LOCKS:
            return None
        raise
    if _is_at(path, file):
        return file
    file.close()  # its last holder has removed it meanwhile: another one may lock a new file
    return None


def _is_at(path: Path, file: BinaryIO) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def release(path: Path, file: BinaryIO) -> None:
    """Remove a locked file, and its folder if it is empty, then lift the lock.

    In this order, so that the file is one's own. Windows removes no open file: there it is tried
    again afterwards, and stays where another one has it open.
    """
    _remove(path)
    file.close()
    if os.name == "nt":
        _remove(path)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
        path.parent.rmdir()


@contextmanager
def locked(path: Path, patience: float = PATIENCE) -> Iterator[None]:
    """Nobody else is in a block with the same path. Its folder is made and goes when it is empty.

    Raises TimeoutError when others keep it for too long, OSError where it cannot be made.
    """
    end = time.monotonic() + patience
    while (file := _taken(path)) is None:
        if time.monotonic() > end:
            raise TimeoutError(None, "another program does not come to an end of writing there")
        time.sleep(PAUSE)
    try:
        yield
    finally:
        release(path, file)


def _taken(path: Path) -> BinaryIO | None:
    folder = path.parent
    try:
        folder.mkdir(exist_ok=True)
    except FileExistsError:
        if folder.is_file() or folder.is_symlink():
            raise
        return None  # another one has removed the folder since
    try:
        return take(path)
    except FileNotFoundError:
        if folder.is_symlink() or not folder.parent.is_dir():
            raise
        return None  # the same
