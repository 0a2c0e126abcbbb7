"""`blender_assets.cats.txt`: the catalogues of an asset library, which follow its folders.

A catalogue of a path has the same ID wherever and whenever it is written, so that assets of two
runs meet in it. What others have in the file stays: where they have a catalogue of that path, its
ID counts; where they have moved one of ours, it stays where they want it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from uuid import UUID, uuid5

from ..errors import CannotWrite
from ..files.atomic import written_together

FILE = "blender_assets.cats.txt"

OURS = UUID("0b7f5a52-6f0c-4f3e-9d53-6d2f6c1c8a11")
"""What IDs of catalogues are made in."""

VERSION = 1

LONGEST_NAME = 63
"""Bytes of a catalogue's simple name, which Blender only shows where the file is missing."""

HEADER = f"""\
# An asset catalogue definition file for Blender.
# Lines are: ID:path:simple name

VERSION {VERSION}

"""


def catalogue_path(folder: str) -> str:
    """A folder, with slashes, as Blender writes the path of a catalogue: without what it cannot
    hold."""
    parts = (re.sub(r"[:\\\x00-\x1f]", "-", part).strip() for part in folder.split("/"))
    return "/".join(part for part in parts if part not in ("", "."))


def catalogue_id(path: str, known: dict[str, str] | None = None) -> str:
    """The ID of a catalogue. known: those of the library, from `read_catalogues`."""
    return (known or {}).get(path) or str(uuid5(OURS, path))


def read_catalogues(root: Path) -> dict[str, str]:
    """IDs of the catalogues in an asset library's folder, by their paths; none where there is no
    file. Raises CannotWrite for a file that cannot be added to, as it is of another kind."""
    return {path: name for name, path in _entries(_text_of(root / FILE))}


def write_catalogues(root: Path, paths: Iterable[str]) -> dict[str, str]:
    """Add catalogues, and those that they lie in, to an asset library; the IDs of all, by path.

    All are written or none, and none that is there already. Raises CannotWrite.
    """
    text = _text_of(root / FILE)
    entries = _entries(text)
    known = {path: name for name, path in entries}
    taken = {name for name, _ in entries}
    new = {
        path: catalogue_id(path)
        for path in sorted(_with_parents(paths) - known.keys())
        if catalogue_id(path) not in taken
    }
    if new or not text:
        lines = [f"{name}:{path}:{_simple_name(path)}\n" for path, name in new.items()]
        text = text or HEADER
        with written_together(root, [FILE]) as (draft,):
            whole = text + ("" if text.endswith("\n") else "\n") + "".join(lines)
            draft.write_text(whole, encoding="utf-8", newline="\n")
    return known | new


def _with_parents(paths: Iterable[str]) -> set[str]:
    found = set()
    for path in paths:
        parts = path.split("/") if path else []
        found |= {"/".join(parts[:n]) for n in range(1, len(parts) + 1)}
    return found


def _simple_name(path: str) -> str:
    return path.replace("/", "-").encode()[-LONGEST_NAME:].decode(errors="ignore")


def _text_of(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise CannotWrite(f"{file} cannot be read: {error.strerror}.") from error
    except ValueError as error:
        raise CannotWrite(
            f"{file} is no text, so no catalogues can be added to it: move it away."
        ) from error


def _entries(text: str) -> list[tuple[str, str]]:
    """ID and path of each catalogue; lines that Blender would not read either are passed over."""
    found = []
    for line in text.splitlines():
        line = line.strip()
        if version := re.fullmatch(r"VERSION\s+(\S+)", line):
            if version[1] != str(VERSION):
                raise CannotWrite(
                    f"{FILE} has version {version[1]}; this Sunsplit adds catalogues to files of "
                    f"version {VERSION}."
                )
            continue
        parts = line.split(":")
        if not line.startswith("#") and len(parts) >= 2 and _is_id(parts[0]):
            found.append((str(UUID(parts[0])), parts[1].strip()))
    return found


def _is_id(text: str) -> bool:
    try:
        UUID(text)
    except ValueError:
        return False
    return True
