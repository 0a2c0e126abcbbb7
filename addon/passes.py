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
from .light_groups import SKY, SUNS
from .trace import TAG
from .world import black_world, remove_converted

LAYER = "Sunsplit Suns"

PLAIN = {"R_LAYERS", "COMPOSITE", "GROUP_INPUT", "GROUP_OUTPUT", "VIEWER", "REROUTE", "FRAME"}
"""Nodes of the compositor that hand on a picture as it is."""

LOOK = (
    *("material_override", "use_solid", "use_sky", "use_ao", "use_strand", "use_volumes"),
    "use_motion_blur",
)
"""What makes a layer's picture; of lines over it, see `_is_more_than_light`."""

RENDER = ("use_compositing", "use_single_layer")
"""Settings without which a render would not show both layers."""

SKY_IN, SUNS_IN, SUM = 6, 7, 2
"""A Mix node's colours. It keeps the alpha of the first, which is that of both layers."""


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
    tree = _compositor(scene)
    if tree is not None and not _is_plain(tree, scene, rendered[0]):
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
) -> None:
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
    _add_up(scene, sky, suns, f"Combined_{SUNS}" if other_lights else "Image")


def remove_suns_layer(scene: bpy.types.Scene) -> None:
    """Take two passes back, if there are any."""
    before = scene.sunsplit.before_passes
    if not before.use_layer_samples:
        return
    group, world = before.compositor, before.black_world
    tree = scene.node_tree if bpy.app.version < (5, 0) else group
    if tree is not None:
        _take_out(tree, scene)
    suns = _layer(scene, SUNS)
    if suns is not None:
        suns.world_override = None  # a layer that goes does not let go of its world
        scene.view_layers.remove(suns)
    _put_back(scene)
    before.black_world = before.compositor = None
    for known in before.bl_rna.properties:
        if not known.is_readonly:
            before.property_unset(known.identifier)
    if group is not None:
        _remove_if_made(group, scene)
    if world is not None:
        remove_converted(world)


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
    if bpy.app.version < (5, 0):
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


def _compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    if bpy.app.version < (5, 0):
        return scene.node_tree
    return scene.compositing_node_group


def _is_plain(tree: bpy.types.NodeTree, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bool:
    """Whether a compositor of one's own shows a layer's picture, and does nothing else."""
    shown = _shown(tree)
    return (
        tree.library is None
        and all(node.type in PLAIN or node.get(TAG) for node in tree.nodes)
        and shown is not None
        and (shown.node.type, shown.name) == ("R_LAYERS", "Image")
        and (shown.node.scene, shown.node.layer) == (scene, layer.name)
    )


def _shown(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket | None:
    """The output that a compositor's result comes from, past reroutes and what we have put in."""
    results = (node for node in tree.nodes if node.type in ("COMPOSITE", "GROUP_OUTPUT"))
    result = next(results, None)
    at = result.inputs[0] if result and len(result.inputs) else None
    while at is not None and at.is_linked:
        shown = at.links[0].from_socket
        if shown.node.type == "REROUTE":
            at = shown.node.inputs[0]
        elif shown.node.get(TAG) and shown.node.type == "MIX":
            at = shown.node.inputs[SKY_IN]
        else:
            return shown
    return None


def _add_up(
    scene: bpy.types.Scene, sky: bpy.types.ViewLayer, suns: bpy.types.ViewLayer, light: str
) -> None:
    """Show the sum of both layers wherever the compositor shows the sky's."""
    tree = _compositor(scene) or _new_compositor(scene, sky)
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
    else:
        scene.sunsplit.before_passes.compositor = tree
    shown = _shown(tree)
    handed_to = [link.to_socket for link in shown.links]
    layer = _layer_node(tree, scene, suns)
    layer.name = layer.label = "Sunsplit: Suns"
    layer.location = shown.node.location.x, shown.node.location.y - 420
    layer[TAG] = True
    both = tree.nodes.new("ShaderNodeMix")
    both.name = both.label = "Sunsplit: Sky and Suns"
    both.data_type, both.blend_type = "RGBA", "ADD"
    both.clamp_factor = both.clamp_result = False
    both.inputs[0].default_value = 1.0
    both.location = shown.node.location.x + 300, shown.node.location.y - 200
    both[TAG] = True
    tree.links.new(shown, both.inputs[SKY_IN])
    tree.links.new(layer.outputs[light], both.inputs[SUNS_IN])
    for socket in handed_to:
        tree.links.new(both.outputs[SUM], socket)


def _new_compositor(scene: bpy.types.Scene, sky: bpy.types.ViewLayer) -> bpy.types.NodeTree:
    """A compositor that shows the layer's picture."""
    if bpy.app.version < (5, 0):
        _use_nodes_without_viewer(scene)
        _shown(scene.node_tree).node.layer = sky.name
        return scene.node_tree
    tree = bpy.data.node_groups.new("Sunsplit Compositor", "CompositorNodeTree")
    tree[TAG] = True
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    result = tree.nodes.new("NodeGroupOutput")
    result.location = 700, 0
    tree.links.new(_layer_node(tree, scene, sky).outputs["Image"], result.inputs[0])
    scene.compositing_node_group = tree
    return tree


def _use_nodes_without_viewer(scene: bpy.types.Scene) -> None:
    """Let Blender make a compositor, but not the viewer in it: its image would outlast Restore."""
    known = set(bpy.data.images)
    scene.use_nodes = True
    for viewer in [node for node in scene.node_tree.nodes if node.type == "VIEWER"]:
        scene.node_tree.nodes.remove(viewer)
    for image in set(bpy.data.images) - known:
        bpy.data.images.remove(image)


def _layer_node(
    tree: bpy.types.NodeTree, scene: bpy.types.Scene, layer: bpy.types.ViewLayer
) -> bpy.types.Node:
    node = tree.nodes.new("CompositorNodeRLayers")
    node.scene, node.layer = scene, layer.name
    return node


def _take_out(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> None:
    """Let a compositor show the sky's layer alone again: a scene's copy may share it."""
    own = [node for node in tree.nodes if node.get(TAG)]
    layers = [node for node in own if node.type == "R_LAYERS" and node.scene == scene]
    sums = [node for node in own if node.type == "MIX" and _adds_any(node, layers)]
    for both in sums:
        shown = [link.from_socket for link in both.inputs[SKY_IN].links]
        for socket in [link.to_socket for link in both.outputs[SUM].links if shown]:
            tree.links.new(shown[0], socket)
    for node in (*layers, *sums):
        tree.nodes.remove(node)


def _adds_any(both: bpy.types.Node, layers: Sequence[bpy.types.Node]) -> bool:
    return any(link.from_node in layers for link in both.inputs[SUNS_IN].links)


def _remove_if_made(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> None:
    """Take away a compositor that we made, unless the user has added to it."""
    if not tree.get(TAG):
        return
    if any(node.type not in PLAIN for node in tree.nodes):
        del tree[TAG]
        return
    if scene.compositing_node_group == tree:
        scene.compositing_node_group = None
    if tree.users == 0:
        bpy.data.node_groups.remove(tree)
