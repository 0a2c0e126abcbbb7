"""Skies of an asset library that come into a file: what marks them, and who is told.

A sky is a converted world and a collection of its suns. Blender imports both, whichever of the two
was dragged into the view, and uses only that one. The rest is done as soon as Blender is through
with it. Nothing here is heavy: it is imported when Sunsplit is enabled.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

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


def register() -> None:
    bpy.app.handlers.blend_import_post.append(_imported)


def unregister() -> None:
    if _imported in bpy.app.handlers.blend_import_post:
        bpy.app.handlers.blend_import_post.remove(_imported)


@persistent
def _imported(context: bpy.types.BlendImportContext, *_: object) -> None:
    """Blender calls this for whatever was appended or linked, before it is used."""
    if bpy.app.background:
        return  # nothing is dragged, and no timer would run: 4.5 then hangs when it ends
    worlds = [item.id for item in context.import_items if item.id_type == "WORLD"]
    skies = [world for world in worlds if suns_of(world)]
    scene = bpy.context.scene
    if not skies or scene is None:
        return
    before = scene.world

    def complete() -> None:
        from .dropped import complete_imported

        complete_imported(scene, skies, before)

    # Once Blender has put what it was asked for into the scene.
    bpy.app.timers.register(complete, first_interval=0.0)
