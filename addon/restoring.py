"""Take a conversion back."""

from __future__ import annotations

import bpy

from . import eevee, passes
from .lamps import remove_lamps, unlink_lamps
from .light_groups import remove_groups
from .rig import remove_rig, rig_of
from .world import remove_converted, unconverted


def restore_scene(scene: bpy.types.Scene) -> None:
    """Bring back the original world and remove all that the conversion made.

    A world that the user has chosen meanwhile stays. What another scene uses too stays there.
    """
    state = scene.sunsplit
    converted, collection = state.converted_world, state.collection
    original = state.original_world
    lamps = [entry.lamp for entry in state.lamps if entry.lamp]
    if original is None and converted is not None:
        original = unconverted(converted)
    if converted is not None:
        if scene.world == converted:
            scene.world = original
        swap_overrides(scene, converted, original)
    passes.remove_suns_layer(scene)
    eevee.take_back(scene)
    remove_groups(scene.view_layers)
    sky = state.sky
    state.original_world = state.converted_world = state.collection = state.sky = None
    state.lamps.clear()
    state.report = state.outlines = ""
    if state.light_tree_off and hasattr(scene, "cycles"):
        scene.cycles.use_light_tree = True
    state.light_tree_off = False
    made = [*lamps, *rig_of(sky)]
    unlink_lamps(scene, collection, made)
    remove_rig(sky, lamps)
    remove_lamps(lamps)
    if converted is not None and converted != original:
        remove_converted(converted)


def swap_overrides(
    scene: bpy.types.Scene, old: bpy.types.World, new: bpy.types.World | None
) -> None:
    """View layers that override the world with the same world follow it."""
    for layer in scene.view_layers:
        if layer.world_override == old:
            layer.world_override = new
