"""Files appear whole or not at all, whoever else writes and whatever is killed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import CannotWrite
from ..interrupts import undisturbed
from . import journal


@contextmanager
def written_together(
    folder: Path, names: Sequence[str], outdated: Callable[[], Iterable[str]] = tuple
) -> Iterator[list[Path]]:
    """Paths to write to, one for each name; they get their names when the block ends well.

    On any exception, Ctrl-C included, what was written goes away, folders made for it too, and
    older files of these names stay as they are. A process that is killed leaves drafts in a hidden
    folder, and if it was about to give them their names, the next one that writes or reads here
    finishes that. Where several write the same names, one after the other gets them all.

    outdated: says, when nobody else can write, which other names go together with this.
    Raises CannotWrite when the folder or a file cannot be written. A Ctrl-C that comes too late
    says so: KeyboardInterrupt("the files ...").
    """
    new_folders = _missing(folder)
    writer, done = None, False
    try:
        _make(folder)
        with journal.alone(folder), undisturbed():
            journal.finish_others(folder)
            writer = journal.begin(folder)
        # The ending stays: writers choose their format by it. The rest does not, lest it grow long.
        drafts = [writer.own / f"{n}{Path(name).suffix}" for n, name in enumerate(names)]
        yield drafts
        for draft in drafts:
            journal.file_to_disk(draft)
        with journal.alone(folder), undisturbed():
            journal.finish_others(folder)
            journal.take_names(writer, dict(zip(names, drafts, strict=True)), outdated())
            done = True
    except OSError as error:
        raise _cannot_write(folder, error, writer) from error
    except KeyboardInterrupt:
        if done:
            raise KeyboardInterrupt("the files are written") from None
        raise
    finally:
        with undisturbed():
            if writer:
                writer.close()
            if not done:
                _remove(new_folders)


def finish_interrupted(folder: Path) -> None:
    """What killed writers had begun in a folder is done, as far as one may write there."""
    if (folder / journal.HIDDEN).is_dir():
        with suppress(OSError), journal.alone(folder, patience=1), undisturbed():
            journal.finish_others(folder)


def _cannot_write(folder: Path, error: OSError, writer: journal.Writer | None) -> CannotWrite:
    reason = error.strerror or str(error)
    if writer and journal.is_pending(writer.own):
        after = "Some files are new and some old: the next conversion into it puts that right."
    else:
        after = "Nothing was changed."
    return CannotWrite(f"Cannot write into {folder}: {reason}. {after}")


def _missing(folder: Path) -> list[Path]:
    """Folders on the way to this one that are not there yet, the innermost first."""
    return [path for path in (folder, *folder.parents) if not os.path.lexists(path)]


def _make(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise CannotWrite(f"Cannot write into {folder}: it is a file. Nothing was changed.")
    folder.mkdir(parents=True, exist_ok=True)


def _remove(new_folders: Sequence[Path]) -> None:
    for folder in new_folders:
        with suppress(OSError):  # someone else has put something into it, or it was never made
            folder.rmdir()
