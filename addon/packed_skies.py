"""Skies that Blender keeps linked and yet inside the file, as it does from 5.0 on with whatever is
dragged from an asset library: nobody can turn or dim these, so a scene gets a copy of its own."""

from __future__ import annotations

import bpy

from .skies import suns_of


def is_packed(sky: bpy.types.World) -> bool:
    """Whether a sky is linked and packed. One that is linked only is meant to stay so."""
    return getattr(sky, "is_linked_packed", False)


def as_local(sky: bpy.types.World) -> bpy.types.World:
    """A local copy of a packed sky, in its place wherever it was used; the packed one goes.

    sky: one that a scene uses already: Blender makes nothing local that only linked data use.
    """
    library = sky.library
    parts = _parts(sky)
    copies = [part.make_local() for part in parts]
    for part, copy in zip(parts, copies, strict=True):
        part.user_remap(copy)
    bpy.data.batch_remove(parts)
    for empty in (library, library.archive_parent_library):
        if empty is not None and not empty.users_id:
            bpy.data.libraries.remove(empty)
    return copies[0]


def _parts(sky: bpy.types.World) -> list[bpy.types.ID]:
    """A sky and what it is made of."""
    suns = suns_of(sky)
    things = list(suns.objects) if suns else []
    data = [thing.data for thing in things if thing.data]
    images = [n.image for n in sky.node_tree.nodes if n.type == "TEX_ENVIRONMENT" and n.image]
    parts = [sky, suns, *things, *data, *images]
    return [part for part in dict.fromkeys(parts) if part is not None and part.library]
