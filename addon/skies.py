"""Skies of an asset library: a converted world and a collection of its suns; what marks them."""

from __future__ import annotations

import bpy

SUNS = "sunsplit_suns"
"""Custom property of a converted world in an asset library: the collection of its suns, which so
comes along wherever the world goes."""

REPORT = "sunsplit_report"
"""Custom property of such a world: what its conversion did, a sentence a line."""


def suns_of(world: bpy.types.World | None) -> bpy.types.Collection | None:
    """The suns of a world that comes from an asset library; None for other worlds."""
    suns = world.get(SUNS) if world else None
    return suns if isinstance(suns, bpy.types.Collection) else None


def lacks_suns(scene: bpy.types.Scene) -> bool:
    """Whether a scene shows a sky of an asset library without having taken its suns."""
    return suns_of(scene.world) is not None and scene.sunsplit.converted_world != scene.world
