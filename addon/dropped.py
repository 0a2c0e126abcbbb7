"""A sky of an asset library becomes a scene's conversion: world, suns, and what Restore needs."""

from __future__ import annotations

import re
from collections.abc import Sequence

import bpy

from . import eevee
from .packed_skies import as_local, is_packed
from .restoring import restore_scene, swap_overrides
from .rig import GUARD, TWIN
from .skies import REPORT, suns_of
from .trace import TAG
from .world import unconverted


def complete_imported(
    scene: bpy.types.Scene, skies: Sequence[bpy.types.World], before: bpy.types.World | None
) -> None:
    """Complete the one of these worlds that the scene uses by now, or whose suns it has, and let
    Undo know. before: the scene's world before they were imported."""
    try:
        used = [sky for sky in skies if sky == scene.world or _is_in(scene, suns_of(sky))]
    except ReferenceError:  # undone or deleted in between
        return
    if not used or scene.library is not None or _is_complete(scene, used[0]):
        return
    complete_sky(scene, used[0], before)
    window = bpy.context.window_manager.windows[:1]
    if window:
        with bpy.context.temp_override(window=window[0]):
            bpy.ops.ed.undo_push(message="Complete Sky")


def complete_sky(
    scene: bpy.types.Scene, sky: bpy.types.World, before: bpy.types.World | None
) -> None:
    """Give a scene a sky's world and suns, as if they had been made there.

    before: what Restore shall bring back; when that is a converted world, what it was made of.
    Where there is none, Restore brings back the HDRI. A linked sky stays linked, but for one that
    is packed.
    """
    state = scene.sunsplit
    scene.world = sky
    if state.converted_world == sky:  # its suns were taken out, or are here a second time
        _put_into(scene, suns_of(sky))
        return
    if before == sky:
        before = None
    if is_packed(sky):
        sky = as_local(sky)
    suns = suns_of(sky)
    if before is not None and before == state.converted_world:
        before = state.original_world
    replaces = state.is_converted
    restore_scene(scene)
    if replaces:
        _name_as_before([sky, suns, *suns.objects, *(one.data for one in suns.objects)])
    if before is None:
        before = unconverted(sky.copy())
        before.name = f"{sky.name} (HDRI)"
    swap_overrides(scene, before, sky)
    _put_into(scene, suns)
    _register(scene, sky, suns, before)
    for asset in (sky, suns):
        if asset.library is None and asset.asset_data:
            asset.asset_clear()  # it is one of the library, not of this file
    if sky.library is None and "EEVEE" in scene.render.engine:
        eevee.apply(scene, [entry.lamp for entry in state.lamps])


def _name_as_before(things: Sequence[bpy.types.ID | None]) -> None:
    """Without the numbers that they got while the sky that they replace had their names."""
    for thing in things:
        name = re.fullmatch(r"(.+)\.\d{3}", thing.name) if thing and not thing.library else None
        if name:
            thing.name = name[1]


def _is_complete(scene: bpy.types.Scene, sky: bpy.types.World) -> bool:
    suns = suns_of(sky)
    stand = suns in list(scene.collection.children) and not _instances(scene, suns)
    return stand and scene.world == sky == scene.sunsplit.converted_world


def _is_in(scene: bpy.types.Scene, suns: bpy.types.Collection) -> bool:
    return suns in list(scene.collection.children_recursive) or bool(_instances(scene, suns))


def _instances(scene: bpy.types.Scene, suns: bpy.types.Collection) -> list[bpy.types.Object]:
    return [thing for thing in scene.objects if thing.instance_collection == suns]


def _put_into(scene: bpy.types.Scene, suns: bpy.types.Collection) -> None:
    """Suns stand in the scene once: in a collection of its own, and in no instance of it."""
    for instance in _instances(scene, suns):
        bpy.data.objects.remove(instance)
    for parent in scene.collection.children_recursive:
        if suns in list(parent.children) and parent.library is None:
            parent.children.unlink(suns)
    if suns not in list(scene.collection.children):
        scene.collection.children.link(suns)
    for thing in suns.objects:
        thing.update_tag()  # in 4.5 nothing that was imported stands anywhere before


def _register(
    scene: bpy.types.Scene,
    sky: bpy.types.World,
    suns: bpy.types.Collection,
    before: bpy.types.World,
) -> None:
    state = scene.sunsplit
    state.original_world, state.converted_world = before, sky
    state.collection = suns
    made = [thing for thing in suns.objects if thing.get(TAG)]
    state.sky = next((one for one in made if one.type == "EMPTY" and one.parent is None), None)
    for lamp in made:
        if lamp.type == "LIGHT" and not (lamp.get(GUARD) or lamp.get(TWIN)):
            state.lamps.add().lamp = lamp
    state.report = sky.get(REPORT, "")
