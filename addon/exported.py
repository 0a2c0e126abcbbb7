"""What the last export of each scene has said: for the panel, as long as this Blender runs.

Not with the scene, as an export changes nothing in it and is no step to undo.
"""

from __future__ import annotations

import bpy

_said: dict[int, list[str]] = {}


def remember(scene: bpy.types.Scene, sentences: list[str]) -> None:
    _said[scene.session_uid] = sentences


def said_of(scene: bpy.types.Scene) -> list[str]:
    """Nothing where the scene was not exported."""
    return _said.get(scene.session_uid, [])
