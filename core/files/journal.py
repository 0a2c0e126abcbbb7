"""Many files take their names as one: what a killed process has begun, the next one finishes.

Beside the files lies a hidden folder, and in it a folder for each writer. That holds its drafts, a
lock that tells whether it lives and, while names are taken, a journal: as soon as that is on disk
the new files are the valid ones. It gets another name when names are to be given back: renaming
works on a full disk too. All of it goes away with the last writer.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO

from . import lock

HIDDEN = ".sunsplit-drafts"

LOCK, ALIVE = "lock", "alive"
ONWARDS, BACK = "journal.json", "undo.json"


@dataclass(frozen=True)
class Writer:
    """A writer's own folder, and the lock that tells others that it lives."""

    own: Path
    alive: BinaryIO

    def close(self) -> None:
        """Drafts that got no name go away, unless the next one has to finish with them."""
        if is_pending(self.own):
            self.alive.close()
        else:
            lock.release(self.own / ALIVE, self.alive)
            _remove(self.own)


@dataclass(frozen=True)
class _Step:
    """A draft takes a name, or without a draft the name goes; whether an older file had it."""

    name: str
    draft: str | None
    had_older: bool


def alone(folder: Path, patience: float = lock.PATIENCE) -> AbstractContextManager[None]:
    """In this block nobody else takes names in a folder. Raises OSError, TimeoutError too."""
    return lock.locked(folder / HIDDEN / LOCK, patience)


def begin(folder: Path) -> Writer:
    """A new writer. To be called `alone`: others would take it for a dead one. Raises OSError."""
    own = folder / HIDDEN / secrets.token_hex(8)
    own.mkdir()
    try:
        alive = lock.take(own / ALIVE)
    except OSError:
        _remove(own)
        raise
    if alive is None:
        raise RuntimeError(f"{own} is new, and yet another one's")
    return Writer(own, alive)


def take_names(writer: Writer, drafts: dict[str, Path], gone: Iterable[str]) -> None:
    """Drafts by name get these names and the names `gone` go: all or none. Call it `alone`.

    Drafts lie on disk in the writer's folder. Raises OSError; `is_pending` says whether then not
    even the older files could be put back.
    """
    folder = _names_of(writer.own)
    for path in (folder / name for name in drafts):
        if path.is_dir():
            raise IsADirectoryError(None, f"{path.name} is a folder")
    wanted = {name: draft.name for name, draft in drafts.items()} | dict.fromkeys(gone)
    steps = [_Step(n, draft, os.path.lexists(folder / n)) for n, draft in wanted.items()]
    _write(writer.own, steps)
    _carry_out(writer.own)


def finish_others(folder: Path) -> None:
    """What dead writers had begun is done and what they left is removed. Call it `alone`.

    Raises OSError where their names can be neither taken nor given back.
    """
    for own in _folders(folder / HIDDEN):
        try:
            alive = lock.take(own / ALIVE, without=False)
        except OSError:  # it has just gone, or is another user's
            continue
        if alive is not None:
            _finish(Writer(own, alive))


def _finish(dead: Writer) -> None:
    try:
        # If the new files cannot have the names, the older ones have them again.
        with suppress(OSError):
            _carry_out(dead.own)
        if is_pending(dead.own):
            raise OSError(None, f"what was begun in {dead.own} cannot be finished")
    finally:
        dead.close()


def is_pending(own: Path) -> bool:
    """Whether names of a writer are partly taken."""
    return any((own / journal).exists() for journal in (ONWARDS, BACK))


def _carry_out(own: Path) -> None:
    """Take all names, or give them back; go on with whatever was begun. Raises OSError."""
    onwards, back = own / ONWARDS, own / BACK
    try:
        for number, step in enumerate(_read(onwards)):
            _onwards(own, number, step)
    except OSError:
        onwards.replace(back)
        _give_back(own)
        raise
    _give_back(own)
    _folder_to_disk(_names_of(own))
    onwards.unlink(missing_ok=True)


def _onwards(own: Path, number: int, step: _Step) -> None:
    path, older = _names_of(own) / step.name, own / f"{number}.old"
    draft = own / step.draft if step.draft else None
    if draft and not os.path.lexists(draft):
        return  # it has its name already
    if step.had_older and not os.path.lexists(older):
        _keep(path, older)
    if draft:
        draft.replace(path)
    else:
        path.unlink(missing_ok=True)


def _keep(path: Path, older: Path) -> None:
    """Give a file a second name; only where that cannot be, it has none for a moment."""
    if path.is_symlink():
        path.replace(older)
        return
    try:
        os.link(path, older)
    except FileNotFoundError:
        return
    except OSError:
        path.replace(older)


def _give_back(own: Path) -> None:
    for number, step in reversed(list(enumerate(_read(own / BACK)))):
        path, older = _names_of(own) / step.name, own / f"{number}.old"
        if os.path.lexists(older):
            older.replace(path)
        elif not step.had_older and step.draft and not os.path.lexists(own / step.draft):
            path.unlink(missing_ok=True)
    _folder_to_disk(_names_of(own))
    (own / BACK).unlink(missing_ok=True)


def _names_of(own: Path) -> Path:
    """The folder in which a writer's files get their names."""
    return own.parent.parent


def _folders(hidden: Path) -> list[Path]:
    if hidden.is_symlink() or not hidden.is_dir():
        return []
    return [path for path in hidden.iterdir() if path.is_dir() and not path.is_symlink()]


def _remove(own: Path) -> None:
    shutil.rmtree(own, ignore_errors=True)
    with suppress(OSError):
        own.parent.rmdir()


def _write(own: Path, steps: Sequence[_Step]) -> None:
    draft = own / "journal.new"
    draft.write_text(json.dumps([asdict(step) for step in steps]), encoding="utf-8")
    file_to_disk(draft)
    for folder in (own, own.parent, own.parent.parent):
        _folder_to_disk(folder)
    draft.replace(own / ONWARDS)
    _folder_to_disk(own)


def _read(journal: Path) -> list[_Step]:
    """No steps where there is no journal, nor where it is none of ours: it names no other place."""
    try:
        steps = [_Step(**entry) for entry in json.loads(journal.read_text(encoding="utf-8"))]
        names = [name for step in steps for name in (step.name, step.draft) if name is not None]
    except (FileNotFoundError, ValueError, TypeError):
        return []
    return steps if all(Path(name).name == name for name in names) else []


def file_to_disk(path: Path) -> None:
    """A file's bytes. Raises OSError."""
    with path.open("r+b") as file:  # Windows wants to be able to write
        os.fsync(file.fileno())


def _folder_to_disk(folder: Path) -> None:
    """A folder's names. Windows does that by itself, and some drives refuse to be asked."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
