"""A file in an output's folder that tells its run from all others, also on other machines.

A worker that finds it sees the same folder as the one who asks, and the run still lasts.
"""

from __future__ import annotations

import secrets
import time
from contextlib import suppress
from pathlib import Path

from ..errors import CannotWrite
from .state import STATE

SIGHT = 2.0
"""Seconds until a network's file system surely shows what another machine has just written."""

PAUSE = 0.1


def set_token(output: Path) -> str:
    """A new one, which lasts until it is removed. Raises CannotWrite."""
    token = secrets.token_hex(16)
    draft = output / STATE / f".{token}"
    try:
        draft.write_text(token, encoding="utf-8")
        draft.replace(_path(output))
    except OSError as error:
        raise CannotWrite(f"Cannot write into {output}: {error.strerror or error}.") from error
    return token


def remove_token(output: Path) -> None:
    """What has not begun by now will not begin."""
    with suppress(OSError):
        _path(output).unlink(missing_ok=True)


def has_token(output: Path, token: str) -> bool:
    """Whether this is what lies in an output's folder, or comes to lie there in a moment."""
    end = time.monotonic() + SIGHT
    while _read(output) != token:
        if time.monotonic() > end:
            return False
        time.sleep(PAUSE)
    return True


def _path(output: Path) -> Path:
    return output / STATE / "run"


def _read(output: Path) -> str | None:
    try:
        return _path(output).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
