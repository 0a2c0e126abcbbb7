"""What the shaders of materials do with light, node by node.

Whatever cannot be told, as an input that is linked, is the worst that it may be.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

SHARP = 0.25
"""Roughness below which a surface may show single pixels of a wide map."""

EXACT, NOT_EXACT = 0.0037, 0.004
"""Roughness up to which Cycles reflects and refracts as if there were none, and says so to the
world (Is Singular Ray), and from which it does not: where its squares along and across make more
than 2e-10."""

BENDS = 0.1
"""From how far off 1 an index of refraction spreads light that goes through rough glass; nearer, it
is as sharp as the lamp that it comes from. At 1.05 nothing of that is left to be seen."""

TRANSLUCENT = {
    *("BSDF_GLASS", "BSDF_REFRACTION", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING"),
    *("BSDF_HAIR", "BSDF_HAIR_PRINCIPLED"),
}
"""Shaders, besides those that one sees through, that light comes through."""

GLOSSY = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_GLASS", "BSDF_REFRACTION", "BSDF_METALLIC"}


def nodes_of(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """All nodes of a tree, those in its groups too."""
    for node in tree.nodes:
        yield node
        if node.type == "GROUP" and node.node_tree:
            yield from nodes_of(node.node_tree)


def is_above(node: bpy.types.Node, name: str, value: float) -> bool:
    socket = node.inputs.get(name)
    return socket is not None and (socket.is_linked or socket.default_value > value)


def shines(node: bpy.types.Node) -> bool:
    glow = ("Emission Strength", "Blackbody Intensity")
    return node.type == "EMISSION" or any(is_above(node, name, 0) for name in glow)


def is_sharp(node: bpy.types.Node) -> bool:
    return lets_straight_through(node) or any(is_smooth(node, name) for name in gloss_of(node))


def gloss_of(node: bpy.types.Node) -> list[str]:
    """The inputs that say how rough what a node reflects or refracts is, one for each layer."""
    if node.type == "BSDF_PRINCIPLED":
        return ["Roughness", *(["Coat Roughness"] if is_above(node, "Coat Weight", 0) else [])]
    return ["Roughness"] if node.type in GLOSSY else []


def is_exact(node: bpy.types.Node, name: str) -> bool:
    """Whether a layer of `gloss_of` is, to Cycles, an exact mirror or clear glass."""
    socket = node.inputs.get(name)
    if socket is None or socket.is_linked or socket.default_value > EXACT:
        return False
    return getattr(node, "distribution", "") != "ASHIKHMIN_SHIRLEY"  # never, however smooth


def may_be_exact(node: bpy.types.Node, name: str) -> bool:
    """The same where it cannot be told."""
    socket = node.inputs.get(name)
    if socket is None or socket.is_linked:
        return True
    return EXACT < socket.default_value < NOT_EXACT


def lets_straight_through(node: bpy.types.Node) -> bool:
    """Whether light goes through as if nothing were there, however rough it is."""
    if node.type == "BSDF_PRINCIPLED":
        if not is_above(node, "Transmission Weight", 0):
            return False
    elif node.type not in ("BSDF_GLASS", "BSDF_REFRACTION"):
        return False
    index = node.inputs["IOR"]
    return index.is_linked or abs(index.default_value - 1) < BENDS


def is_smooth(node: bpy.types.Node, name: str, below: float = SHARP) -> bool:
    socket = node.inputs.get(name)
    return socket is None or socket.is_linked or socket.default_value < below


def is_seen_through(node: bpy.types.Node) -> bool:
    if node.type == "BSDF_PRINCIPLED":
        alpha = node.inputs["Alpha"]
        return alpha.is_linked or alpha.default_value < 1
    if node.type == "OUTPUT_MATERIAL":  # of a volume without a surface
        return not node.inputs["Surface"].is_linked
    return node.type in ("BSDF_TRANSPARENT", "BSDF_RAY_PORTAL", "HOLDOUT")


def is_translucent(node: bpy.types.Node) -> bool:
    if node.type == "BSDF_PRINCIPLED":
        inside = ("Transmission Weight", "Subsurface Weight")
        return is_seen_through(node) or any(is_above(node, name, 0) for name in inside)
    return is_seen_through(node) or node.type in TRANSLUCENT
