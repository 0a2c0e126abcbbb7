"""Take a conversion back."""

from __future__ import annotations

import bpy

from . import eevee, passes
from .lamps import remove_lamps, unlink_lamps
from .light_groups import remove_groups
from .portals import remove_portals
from .rig import GUARD, TWIN, guards_of, remove_rig, rig_of, twins_of
from .singular import links_of, remove_links
from .skies import SUNS
from .world import remove_converted, unconverted


def restore_scene(scene: bpy.types.Scene) -> None:
    """Bring back the original world and remove all that the conversion made.

    A world that the user has chosen meanwhile stays. What another scene uses too stays there.
    """
    state = scene.sunsplit
    converted, collection = state.converted_world, state.collection
    original = state.original_world
    lamps = [entry.lamp for entry in state.lamps if entry.lamp]
    linked = converted is not None and converted.library is not None
    if original is None and converted is not None and not linked:
        original = unconverted(converted)
    if converted is not None:
        if scene.world == converted:
            scene.world = original
        swap_overrides(scene, converted, original)
    passes.remove_suns_layer(scene)
    eevee.take_back(scene)
    remove_groups(scene.view_layers)
    sky = state.sky
    lamps += [*guards_of(sky), *twins_of(sky)]
    if collection is not None:  # of a rig that the user has deleted
        lamps += [t for t in collection.objects if (t.get(GUARD) or t.get(TWIN)) and t not in lamps]
    links = links_of(lamps)
    _forget(state)
    remove_portals(scene)
    if state.light_tree_off and hasattr(scene, "cycles"):
        scene.cycles.use_light_tree = True
    state.light_tree_off = False
    if linked:
        _unlink_sky(scene, collection)
        return
    if converted is not None and not converted.users and SUNS in converted:
        del converted[SUNS]  # else it would keep them
    unlink_lamps(scene, collection, [*lamps, *rig_of(sky)])
    remove_rig(sky, lamps)
    remove_lamps(lamps)
    remove_links(links)
    if converted is not None and converted != original:
        remove_converted(converted)


def _forget(state: bpy.types.PropertyGroup) -> None:
    """What a scene knows of its conversion."""
    state.original_world = state.converted_world = state.collection = state.sky = None
    state.lamps.clear()
    state.report = state.outlines = ""


def _unlink_sky(scene: bpy.types.Scene, collection: bpy.types.Collection | None) -> None:
    """Of a sky that is linked from an asset library, nothing is removed but from the scene."""
    if collection is not None and collection in list(scene.collection.children):
        scene.collection.children.unlink(collection)


def swap_overrides(
    scene: bpy.types.Scene, old: bpy.types.World, new: bpy.types.World | None
) -> None:
    """View layers that override the world with the same world follow it."""
    for layer in scene.view_layers:
        if layer.world_override == old:
            layer.world_override = new
