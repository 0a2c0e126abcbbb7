"""What a scene needs of a conversion."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .trace import TAG


def has_other_lights(scene: bpy.types.Scene) -> bool:
    """Whether anything but the world and lamps of conversions gives light in a scene's renders."""
    materials = set()
    for thing in scene.objects:
        if thing.hide_render:
            continue
        if thing.type == "LIGHT" and not thing.get(TAG):
            return True
        materials |= {slot.material for slot in thing.material_slots if slot.material}
    return any(_shines(made.node_tree) for made in materials if made.node_tree)


def _shines(tree: bpy.types.NodeTree) -> bool:
    """Whether a material may give light; what cannot be told does."""
    return any(
        node.type == "EMISSION"
        or ("Emission Strength" in node.inputs and not _is_off(node.inputs["Emission Strength"]))
        for node in _nodes(tree)
    )


def _is_off(socket: bpy.types.NodeSocket) -> bool:
    return not socket.is_linked and socket.default_value == 0


def _nodes(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """All nodes of a tree, those in its groups too."""
    for node in tree.nodes:
        yield node
        if node.type == "GROUP" and node.node_tree:
            yield from _nodes(node.node_tree)
