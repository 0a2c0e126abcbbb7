"""The maps in a folder and the folders in it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

from ..errors import UnusableInput
from ..export.names import ENDINGS as EXPORTS
from ..files.conversion import ENDINGS
from ..files.maps import size_of
from .options import LibraryOptions

OURS = (
    *((f".{ENDINGS[kind]}", f".{ENDINGS['lights']}") for kind in ("residual", "preview")),
    *((f".{names.map}", f".{names.lights}") for names in EXPORTS.values()),
    *((".scene.exr", f".{names.scene}") for names in EXPORTS.values()),  # a render of that scene
)
"""How images end that conversions and exports have written, and what then lies beside them."""


@dataclass(frozen=True)
class MapFile:
    """A file that may be a map. path: from the library's folder, with slashes. width, height: by
    its header, 0 where that cannot be read. held: its pixels can only be read all at once. size:
    in bytes."""

    path: str
    width: int
    height: int
    held: bool
    size: int


@dataclass(frozen=True)
class Scan:
    """files: by path. unread: folders that could not be looked into, and why, as sentences."""

    files: tuple[MapFile, ...]
    unread: tuple[str, ...]


def scan(library: Path, output: Path, options: LibraryOptions) -> Scan:
    """Find maps in a folder. What lies in the output's folder is none, nor what is hidden, nor
    what a conversion or an export has written. Raises UnusableInput where there is no such
    folder."""
    if not library.is_dir():
        raise UnusableInput(f"{library} is not a folder: give the folder that holds the maps.")
    unread: list[str] = []
    paths = sorted(_paths(library, output, unread))
    if unread and not paths and not os.access(library, os.R_OK | os.X_OK):
        raise UnusableInput(unread[0])
    files = [_map_file(library, path, options) for path in paths if _is_wanted(path, options)]
    return Scan(tuple(files), tuple(unread))


def _paths(library: Path, output: Path, unread: list[str]) -> Iterator[str]:
    """Of all files, from the library's folder, with slashes. Linked folders are followed, each
    place once."""

    def failed(error: OSError) -> None:
        unread.append(f"The folder {error.filename} cannot be read: {error.strerror}.")

    seen = {_place(library)}
    left_out = None if output.resolve() == library.resolve() else _place(output)
    for folder, inner, names in os.walk(library, onerror=failed, followlinks=True):
        inner[:] = [name for name in sorted(inner) if not name.startswith((".", "__MACOSX"))]
        for name in list(inner):
            place = _place(Path(folder, name))
            if place is None or place in seen or place == left_out:
                inner.remove(name)
            seen.add(place)
        within = Path(folder).relative_to(library).as_posix()
        for name in _without_ours(names):
            yield name if within == "." else f"{within}/{name}"


def _place(folder: Path) -> tuple[int, int] | None:
    """What tells a folder from all others, by whatever name; None where there is none."""
    try:
        status = folder.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _without_ours(names: Sequence[str]) -> list[str]:
    there = set(names)
    return [name for name in names if not name.startswith(".") and not _is_ours(name, there)]


def _is_ours(name: str, there: set[str]) -> bool:
    return any(
        name.endswith(ending) and name.removesuffix(ending) + beside in there
        for ending, beside in OURS
    )


def _is_wanted(path: str, options: LibraryOptions) -> bool:
    return _matches(path, options.included) and not _matches(path, options.exclude)


def _matches(path: str, patterns: Sequence[str]) -> bool:
    path = path.lower()
    name = PurePath(path).name
    return any(fnmatchcase(path if "/" in p else name, p.lower()) for p in patterns)


def _map_file(library: Path, path: str, options: LibraryOptions) -> MapFile:
    file = library / path
    try:
        size, bytes_ = size_of(file, options.allow_ldr), file.stat().st_size
    except (UnusableInput, OSError):  # converting it says what is wrong
        return MapFile(path, 0, 0, True, 0)
    return MapFile(path, size.width, size.height, size.held, bytes_)
