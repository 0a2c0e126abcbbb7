"""What a panel needs of exports: names, and what the last export of each scene has said."""

from __future__ import annotations

import re

import bpy

from ..core.export.names import ENDINGS

UNSAFE = re.compile(r'[\x00-\x1f/\\:*?"<>|]')
"""Characters that some system does not have in the names of files."""

# Not with the scene, as an export is no step to undo.
_said: dict[int, list[str]] = {}


def remember(scene: bpy.types.Scene, sentences: list[str]) -> None:
    _said[scene.session_uid] = sentences


def said_of(scene: bpy.types.Scene) -> list[str]:
    """Nothing where the scene was not exported."""
    return _said.get(scene.session_uid, [])


def as_name(text: str) -> str:
    """What the names of an export's files begin with: a text without what no file is called, and
    without the rest of the name of an older export's file."""
    name = UNSAFE.sub("_", text).strip()
    for kind in ENDINGS.values():
        for ending in (kind.lights, kind.scene, kind.map):
            name = name.removesuffix(f".{ending}")
    return name or "world"
