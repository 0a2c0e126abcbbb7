"""Files appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import CannotWrite
from ..interrupts import undisturbed


@contextmanager
def written_together(folder: Path, names: Sequence[str]) -> Iterator[list[Path]]:
    """Paths to write to, one for each name; they get their names when the block ends well.

    On any exception, Ctrl-C included, what was written goes away, folders made for it too, and
    older files of these names stay as they are. Raises CannotWrite when the folder or a file
    cannot be written. A Ctrl-C that comes too late says so: KeyboardInterrupt("the files ...").
    """
    mark = secrets.token_hex(4)
    # The ending stays: writers choose their format by it. The rest does not, lest it grow too long.
    drafts = [folder / f".{mark}.{n}{Path(name).suffix}" for n, name in enumerate(names)]
    new_folders = _missing(folder)
    done = False
    try:
        _make(folder)
        yield drafts
        for draft in drafts:
            _to_disk(draft)
        with undisturbed():
            _take_names(drafts, [folder / name for name in names])
            done = True
    except OSError as error:
        reason = error.strerror or str(error)
        raise CannotWrite(f"Cannot write into {folder}: {reason}. Nothing was changed.") from error
    except KeyboardInterrupt:
        if done:
            raise KeyboardInterrupt("the files are written") from None
        raise
    finally:
        if not done:
            with undisturbed():
                _remove(drafts, new_folders)


def _missing(folder: Path) -> list[Path]:
    """Folders on the way to this one that are not there yet, the innermost first."""
    return [path for path in (folder, *folder.parents) if not os.path.lexists(path)]


def _make(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise CannotWrite(f"Cannot write into {folder}: it is a file. Nothing was changed.")
    folder.mkdir(parents=True, exist_ok=True)


def _to_disk(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _take_names(drafts: Sequence[Path], targets: Sequence[Path]) -> None:
    """Rename all drafts, or none: older files step aside and come back when one cannot be."""
    for target in targets:
        if target.is_dir():
            raise IsADirectoryError(None, f"{target.name} is a folder")
    aside = [draft.with_name(f"{draft.name}.old") for draft in drafts]
    begun: list[tuple[Path, Path]] = []
    try:
        for draft, target, old in zip(drafts, targets, aside, strict=True):
            begun.append((target, old))
            with suppress(FileNotFoundError):
                target.replace(old)
            draft.replace(target)
    except OSError:
        for target, old in begun:
            _put_back(target, old)
        raise
    for old in aside:
        with suppress(OSError):
            old.unlink(missing_ok=True)


def _put_back(target: Path, old: Path) -> None:
    if os.path.lexists(old):
        old.replace(target)
    else:
        target.unlink(missing_ok=True)


def _remove(drafts: Sequence[Path], new_folders: Sequence[Path]) -> None:
    for draft in drafts:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
    for folder in new_folders:
        with suppress(OSError):  # someone else has put something into it, or it was never made
            folder.rmdir()
