"""Who is told that a sky of an asset library comes into a file.

Blender imports both of its assets, whichever of the two was dragged into the view, and uses only
that one. The rest is done as soon as Blender is through with it. Nothing here is heavy: it is
imported when Sunsplit is enabled.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from .skies import suns_of


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
