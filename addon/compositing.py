"""The compositor shows the sum of two view layers wherever it showed one."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .trace import TAG

PLAIN = {"R_LAYERS", "COMPOSITE", "GROUP_INPUT", "GROUP_OUTPUT", "VIEWER", "REROUTE", "FRAME"}
"""Nodes that hand on a picture as it is."""

KEPT_IN, ADDED_IN, SUM = 6, 7, 2
"""A Mix node's colours. It keeps the alpha of the first, which is that of both layers."""


def can_add_up(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bool:
    """Whether a scene's compositor shows a layer's picture, or nothing yet, and does no more."""
    tree = compositor_of(scene)
    return tree is None or _is_plain(tree, scene, layer)


def add_up(
    scene: bpy.types.Scene, kept: bpy.types.ViewLayer, added: bpy.types.ViewLayer, light: str
) -> bpy.types.NodeTree:
    """Add a pass of another layer to what is shown of one; the compositor that does it."""
    tree = compositor_of(scene) or _new_compositor(scene, kept)
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
    shown = _shown(tree)
    handed_to = [link.to_socket for link in shown.links]
    layer = _layer_node(tree, scene, added)
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
    tree.links.new(shown, both.inputs[KEPT_IN])
    tree.links.new(layer.outputs[light], both.inputs[ADDED_IN])
    for socket in handed_to:
        tree.links.new(both.outputs[SUM], socket)
    return tree


def compositor_of(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """Before Blender 5 a scene has one of its own, which its data do not list."""
    if bpy.app.version < (5, 0):
        return scene.node_tree
    return scene.compositing_node_group


def _is_plain(tree: bpy.types.NodeTree, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bool:
    """Whether a compositor of one's own shows a layer's picture, and does nothing else."""
    shown = _shown(tree)
    return (
        tree.library is None
        and not has_nodes_of_users(tree)
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
            at = shown.node.inputs[KEPT_IN]
        else:
            return shown
    return None


def _new_compositor(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bpy.types.NodeTree:
    """A compositor that shows the layer's picture."""
    if bpy.app.version < (5, 0):
        _use_nodes_without_viewer(scene)
        _shown(scene.node_tree).node.layer = layer.name
        return scene.node_tree
    tree = bpy.data.node_groups.new("Sunsplit Compositor", "CompositorNodeTree")
    tree[TAG] = True
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    result = tree.nodes.new("NodeGroupOutput")
    result.location = 700, 0
    tree.links.new(_layer_node(tree, scene, layer).outputs["Image"], result.inputs[0])
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


def take_out(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    """Let a compositor show one layer again; nodes for another scene, which may share it, stay."""
    own = [node for node in tree.nodes if node.get(TAG)]
    layers = [node for node in own if node.type == "R_LAYERS" and node.scene == scene]
    sums = [node for node in own if node.type == "MIX" and _adds_any(node, layers)]
    for both in sums:
        shown = [link.from_socket for link in both.inputs[KEPT_IN].links]
        for socket in [link.to_socket for link in both.outputs[SUM].links if shown]:
            tree.links.new(shown[0], socket)
    for node in (*layers, *sums):
        tree.nodes.remove(node)


def _adds_any(both: bpy.types.Node, layers: Sequence[bpy.types.Node]) -> bool:
    return any(link.from_node in layers for link in both.inputs[ADDED_IN].links)


def remove_if_made(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    """Take away a compositor of our own, unless the user has added to it."""
    if not tree.get(TAG):
        return
    if has_nodes_of_users(tree):
        del tree[TAG]
        return
    if scene.compositing_node_group == tree:
        scene.compositing_node_group = None
    if tree.users == 0:
        bpy.data.node_groups.remove(tree)


def has_nodes_of_users(tree: bpy.types.NodeTree) -> bool:
    """Whether a compositor does anything to a picture."""
    return any(node.type not in PLAIN and not node.get(TAG) for node in tree.nodes)
