"""What files beside a map say of it: who made it, and what one may do with it.

Read are, the nearest first: `<file>.json` and `<stem>.json` beside the map, the same without the
size in its name (`sky.json` for `sky_4k.hdr`), then `library.json` in its folder and in those
around it. Each fact is taken from the nearest file that states it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .sizes import name_without_size

OF_FOLDER = "library.json"

LARGEST = 2**20
"""Bytes of a side file: more is something else."""

_KEYS = {
    "author": ("author", "authors"),
    "licence": ("licence", "license"),
    "copyright": ("copyright",),
    "description": ("description",),
}

_TAGS = ("tags", "categories")

_OURS = "sunsplit."
"""How the formats of files begin that a conversion writes."""


@dataclass(frozen=True)
class SideFacts:
    """What is said of a map; "" where nothing is. Several authors are parted by commas.

    warnings: a sentence for each file, or each fact in it, that cannot be understood.
    """

    author: str = ""
    licence: str = ""
    copyright: str = ""
    tags: tuple[str, ...] = ()
    description: str = ""
    warnings: tuple[str, ...] = ()


def facts_beside(file: Path, root: Path, width: int) -> SideFacts:
    """What is said of a map. root: the library's folder, the last one that is looked into. width:
    of the map in pixels, which its name may have and its side file's not; 0: unknown."""
    found: dict[str, Any] = {}
    warnings: list[str] = []
    for side in _side_files(file, root, width):
        document = _read(side, root, warnings)
        for name, value in _facts(document, _shown(side, root), warnings).items():
            found.setdefault(name, value)
    return SideFacts(**found, warnings=tuple(warnings))


def _side_files(file: Path, root: Path, width: int) -> Iterator[Path]:
    names = [
        f"{file.name}.json",
        f"{file.stem}.json",
        f"{name_without_size(file.stem, width)}.json",
    ]
    for name in dict.fromkeys(names):
        if name != OF_FOLDER:
            yield file.with_name(name)
    folders = [file.parent, *file.parent.parents]
    within = folders[: folders.index(root) + 1] if root in folders else folders[:1]
    yield from (folder / OF_FOLDER for folder in within)


def _read(side: Path, root: Path, warnings: list[str]) -> dict[str, Any]:
    """The document of a side file, an empty one where it is missing or none that can be read."""
    shown = _shown(side, root)
    try:
        if not side.is_file():
            return {}
        if side.stat().st_size > LARGEST:
            warnings.append(f"{shown} is too long for a side file and was not read.")
            return {}
        document = json.loads(side.read_text(encoding="utf-8-sig"))
    except OSError as error:
        warnings.append(f"{shown} cannot be read: {error.strerror}.")
        return {}
    except (ValueError, RecursionError) as error:
        warnings.append(f"{shown} is not readable JSON ({error}) and says nothing of the map.")
        return {}
    if not isinstance(document, dict):
        warnings.append(f"{shown} holds no JSON object and says nothing of the map.")
        return {}
    return {} if str(document.get("format", "")).startswith(_OURS) else document


def _facts(document: dict[str, Any], shown: str, warnings: list[str]) -> dict[str, Any]:
    """The facts that a document states."""
    found: dict[str, Any] = {}
    for name, keys in _KEYS.items():
        for value in _stated(document, keys):
            text = _text(value)
            if text is None:
                warnings.append(f"{shown}: its {name} is neither text nor a list of it.")
            elif text:
                found.setdefault(name, text)
    tags: dict[str, str] = {}
    for value in _stated(document, _TAGS):
        names = value.split(",") if isinstance(value, str) else value
        if not isinstance(names, list) or not all(isinstance(one, str) for one in names):
            warnings.append(f"{shown}: its tags are neither text nor a list of it.")
            continue
        for name in filter(None, map(_clean, names)):
            tags.setdefault(name.casefold(), name)
    return found | ({"tags": tuple(tags.values())} if tags else {})


def _stated(document: dict[str, Any], keys: tuple[str, ...]) -> list[Any]:
    return [document[key] for key in keys if document.get(key) is not None]


def _text(value: object) -> str | None:
    """A fact as text: of a list its parts, of names with a role each the names, with the role
    where it is not all of the work."""
    if isinstance(value, str):
        return _clean(value)
    if isinstance(value, dict):
        value = [
            f"{name} ({role})" if isinstance(role, str) and role.casefold() != "all" else name
            for name, role in value.items()
        ]
    if isinstance(value, list) and all(isinstance(part, str) for part in value):
        return ", ".join(filter(None, map(_clean, value)))
    return None


def _clean(text: str) -> str:
    """Without what no line of text should hold, lone halves of characters too."""
    text = text.encode("utf-8", "ignore").decode("utf-8")
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f]", "", text).strip()


def _shown(side: Path, root: Path) -> str:
    return side.relative_to(root).as_posix() if side.is_relative_to(root) else side.name
