"""Two passes: a view layer for the suns beside the user's, which keeps the sky; the compositor adds
them.

The user's layer loses nothing but the lamps. The new one shows the same things under the lamps and
a black world, and hands out its picture only. Whatever the compositor showed of the user's layer,
it then shows of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy

from ..core.errors import UnusableInput
from .compositing import (
    add_up,
    can_add_up,
    compositor_of,
    has_nodes_of_users,
    remove_if_made,
    take_out,
)
from .light_groups import SKY, SUNS
from .trace import TAG
from .world import black_world, remove_converted

LAYER = "Sunsplit Suns"

LOOK = (
    *("material_override", "use_solid", "use_sky", "use_ao", "use_strand", "use_volumes"),
    "use_motion_blur",
)
"""What makes a layer's picture; of lines over it, see `_is_more_than_light`."""

RENDER = ("use_compositing", "use_single_layer")
"""Settings without which a render would not show both layers."""


@dataclass(frozen=True)
class PassSamples:
    """Of each of the two layers."""

    suns: int
    sky: int


def users_layers(scene: bpy.types.Scene) -> list[bpy.types.ViewLayer]:
    """View layers but for the one that a conversion has made; a copy of that is the user's."""
    ours = _layer(scene, SUNS)
    return [layer for layer in scene.view_layers if layer != ours]


def check(scene: bpy.types.Scene) -> None:
    """Raise UnusableInput where two passes cannot be set up, or would not show what one does."""
    if scene.render.engine != "CYCLES":
        raise UnusableInput("Two Passes are for Cycles: choose it, or switch Two Passes off.")
    rendered = _rendered(scene)
    if len(rendered) != 1:
        raise UnusableInput(
            f"Two Passes need one view layer in use, not {len(rendered)}: "
            "change that in the View Layer properties, or switch Two Passes off."
        )
    if _is_more_than_light(scene, rendered[0]):
        raise UnusableInput(
            "Shadow catchers, Grease Pencil and Freestyle's lines cannot be added up: "
            "switch Two Passes off."
        )
    if not can_add_up(scene, rendered[0]):
        raise UnusableInput(
            "The compositor does more than show the view layer: "
            "take its other nodes out, or switch Two Passes off."
        )


def _is_more_than_light(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bool:
    """Whether a layer's picture has what two pictures with a part of the light each do not add up
    to: shadows as alpha, or lines over what is lit."""
    if scene.render.use_freestyle and layer.use_freestyle:
        return True
    shown = [thing for thing in scene.objects if not thing.hide_render]
    if layer.use_grease_pencil and any(thing.type == "GREASEPENCIL" for thing in shown):
        return True
    # Lamps have that mark, too: it says that a catcher shows their shadows.
    return any(thing.is_shadow_catcher and thing.type != "LIGHT" for thing in shown)


def samples_of_scene(scene: bpy.types.Scene) -> int:
    """What one pass of the user's layer takes, while no conversion is in the scene."""
    (layer,) = _rendered(scene)
    whole, way = scene.cycles.samples, scene.cycles.use_layer_samples
    if layer.samples == 0 or way == "IGNORE":
        return whole
    return min(layer.samples, whole) if way == "BOUNDED" else layer.samples


def add_suns_layer(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection,
    samples: PassSamples,
    other_lights: bool,
) -> bpy.types.ViewLayer:
    """Give a scene that `check` has found good its second layer, and that the lamps' collection.

    other_lights: something else shines too. It does so in both layers, so of the second one only
    the lamps' light group is added.
    """
    (sky,) = _rendered(scene)
    _remember(scene, sky)
    suns = _layer_like(scene, sky)
    suns.world_override = scene.sunsplit.before_passes.black_world
    sky.layer_collection.children[collection.name].exclude = True
    suns.samples, sky.samples = samples.suns, samples.sky
    scene.cycles.use_layer_samples = "USE"
    scene.render.use_compositing, scene.render.use_single_layer = True, False
    if other_lights:
        _give_group(suns, collection.objects)
    tree = add_up(scene, sky, suns, f"Combined_{SUNS}" if other_lights else "Image")
    if bpy.app.version >= (5, 0):
        scene.sunsplit.before_passes.compositor = tree
    return suns


def remove_suns_layer(scene: bpy.types.Scene) -> None:
    """Take two passes back, if there are any."""
    before = scene.sunsplit.before_passes
    if not before.use_layer_samples:
        return
    group, world = before.compositor, before.black_world
    tree = compositor_of(scene) if bpy.app.version < (5, 0) else group
    if tree is not None:
        take_out(scene, tree)
    suns = _layer(scene, SUNS)
    if suns is not None:
        _remove_layer(scene, suns)
    _put_back(scene)
    before.black_world = before.compositor = None
    for known in before.bl_rna.properties:
        if not known.is_readonly:
            before.property_unset(known.identifier)
    if group is not None:
        remove_if_made(scene, group)
    if world is not None:
        remove_converted(world)


def _remove_layer(scene: bpy.types.Scene, suns: bpy.types.ViewLayer) -> None:
    suns.world_override = None  # a layer that goes does not let go of its world
    if len(scene.view_layers) > 1:
        scene.view_layers.remove(suns)
    else:  # the user has removed the other, and a scene needs one
        del suns[TAG]


def _remember(scene: bpy.types.Scene, sky: bpy.types.ViewLayer) -> None:
    """Note what Restore puts back."""
    before = scene.sunsplit.before_passes
    before.black_world = black_world()
    sky[TAG] = SKY
    before.samples = sky.samples
    before.use_layer_samples = scene.cycles.use_layer_samples
    for name in RENDER:
        setattr(before, name, getattr(scene.render, name))
    if bpy.app.version < (5, 0):
        before.use_nodes = scene.use_nodes


def _put_back(scene: bpy.types.Scene) -> None:
    before, sky = scene.sunsplit.before_passes, _layer(scene, SKY)
    if sky is not None:
        sky.samples = before.samples
        del sky[TAG]
    if hasattr(scene, "cycles"):
        scene.cycles.use_layer_samples = before.use_layer_samples
    for name in RENDER:
        setattr(scene.render, name, getattr(before, name))
    if bpy.app.version < (5, 0) and not has_nodes_of_users(compositor_of(scene)):
        scene.use_nodes = before.use_nodes


def _layer(scene: bpy.types.Scene, part: str) -> bpy.types.ViewLayer | None:
    """The layer that a conversion has made for the suns, or marked as that of the sky."""
    return next((layer for layer in scene.view_layers if layer.get(TAG) == part), None)


def _rendered(scene: bpy.types.Scene) -> list[bpy.types.ViewLayer]:
    return [layer for layer in users_layers(scene) if layer.use]


def _layer_like(scene: bpy.types.Scene, sky: bpy.types.ViewLayer) -> bpy.types.ViewLayer:
    """A new layer that shows the same things in the same way, with the same light groups."""
    suns = scene.view_layers.new(LAYER)
    suns[TAG] = SUNS
    for name in LOOK:
        setattr(suns, name, getattr(sky, name))
    suns.use_freestyle = suns.use_grease_pencil = False
    for known in sky.cycles.bl_rna.properties:
        if known.identifier.startswith(("use_denoising", "denoising_pass")):
            setattr(suns.cycles, known.identifier, getattr(sky.cycles, known.identifier))
    for group in sky.lightgroups:
        suns.lightgroups.add(name=group.name)
    _show_alike(suns.layer_collection, sky.layer_collection)
    return suns


def _show_alike(mine: bpy.types.LayerCollection, theirs: bpy.types.LayerCollection) -> None:
    """Collections of a layer as another layer has them."""
    for child, model in zip(mine.children, theirs.children, strict=True):
        for name in ("exclude", "holdout", "indirect_only", "hide_viewport"):
            setattr(child, name, getattr(model, name))
        _show_alike(child, model)


def _give_group(suns: bpy.types.ViewLayer, lamps: Sequence[bpy.types.Object]) -> None:
    if SUNS not in suns.lightgroups:
        suns.lightgroups.add(name=SUNS)
    for lamp in lamps:
        lamp.lightgroup = SUNS
