"""Files appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import CannotWrite


@contextmanager
def written_together(folder: Path, names: list[str]) -> Iterator[list[Path]]:
    """Paths to write to, one for each name; they get their names when the block ends well.

    On any exception, Ctrl-C included, what was written goes away and older files of these names
    stay as they are. Raises CannotWrite when the folder or a file cannot be written.
    """
    mark = secrets.token_hex(4)
    # The ending stays last: writers choose their format by it.
    drafts = [folder / f".{mark}.{name}" for name in names]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield drafts
        for draft in drafts:
            _to_disk(draft)
        for draft, name in zip(drafts, names, strict=True):
            draft.replace(folder / name)
    except OSError as error:
        reason = error.strerror or str(error)
        raise CannotWrite(f"Cannot write into {folder}: {reason}. Nothing was changed.") from error
    finally:
        for draft in drafts:
            draft.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
