"""What the worker is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class AssetJob:
    """A converted map to make assets of.

    map: the file that was converted. lights: its `<stem>.lights.json`, the residual beside it.
    blend: the file to write; of several jobs for one file, that one's. root: the asset library's
    folder, where its catalogues are stated; catalogue: the path of one, or "". pack: images go into
    the .blend file. preview: its width and height in pixels, 0 for none.
    """

    map: Path
    lights: Path
    blend: Path
    name: str
    root: Path
    catalogue: str = ""
    tags: tuple[str, ...] = ()
    author: str = ""
    licence: str = ""
    copyright: str = ""
    description: str = ""
    pack: bool = False
    preview: int = 256

    @classmethod
    def of(cls, entries: dict[str, Any]) -> AssetJob:
        """A job as it comes in. What is none is a bug of the sender, and raises TypeError."""
        paths = {name: Path(entries[name]) for name in ("map", "lights", "blend", "root")}
        return cls(**entries | paths | {"tags": tuple(entries.get("tags", ()))})
