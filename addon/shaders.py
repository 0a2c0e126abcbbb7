"""What the shaders of materials do with light, node by node.

Whatever cannot be told, as an input that is linked, is the worst that it may be.
"""

from __future__ import annotations

import math

import bpy

SHARP = 0.25
"""Roughness below which a surface may show single pixels of a wide map."""

MATT, WIDE = 0.4, math.radians(30.0)
"""Roughness from which a lacquer, as plastics have it, gives a faint and wide gloss, which is less
noisy where rays do not meet suns up to so wide; this and the next by docs/benchmarks/met_suns.md.
"""

ROUGH = 0.5
"""And so for all suns: it is nearly as if there were no lacquer."""

LACQUER = 1.5
"""Index of refraction up to which it is one."""

NARROW = math.radians(3.0)
"""Suns that wide the rays of rough surfaces meet so rarely that nobody can tell whether they do."""

ANY = math.pi
"""The widest that Blender has: suns need not be met at all."""

TRANSLUCENT = {
    *("BSDF_GLASS", "BSDF_REFRACTION", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING"),
    *("BSDF_HAIR", "BSDF_HAIR_PRINCIPLED"),
}
"""Shaders, besides those that one sees through, that light comes through."""

DIFFUSE = {
    *("BSDF_DIFFUSE", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING", "BSDF_TRANSPARENT"),
    *("EMISSION", "HOLDOUT", "MIX_SHADER", "ADD_SHADER", "GROUP", "GROUP_INPUT"),
    *("BACKGROUND", "REROUTE"),
}
"""Nodes with a shader that reflect evenly, or nothing themselves."""

GLOSSY = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_GLASS", "BSDF_REFRACTION", "BSDF_METALLIC"}


def is_above(node: bpy.types.Node, name: str, value: float) -> bool:
    socket = node.inputs.get(name)
    return socket is not None and (socket.is_linked or socket.default_value > value)


def shines(node: bpy.types.Node) -> bool:
    glow = ("Emission Strength", "Blackbody Intensity")
    return node.type == "EMISSION" or any(is_above(node, name, 0) for name in glow)


def is_sharp(node: bpy.types.Node) -> bool:
    if node.type == "BSDF_PRINCIPLED":
        coated = is_above(node, "Coat Weight", 0) and _is_smooth(node, "Coat Roughness")
        return coated or _is_smooth(node, "Roughness")
    return node.type in GLOSSY and _is_smooth(node, "Roughness")


def _is_smooth(node: bpy.types.Node, name: str, below: float = SHARP) -> bool:
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


def unmet_width(node: bpy.types.Node) -> float:
    """Angular diameter, in radians, of the widest suns that a path tracer need not meet by the rays
    that go on from such a surface, as looking for them serves as well or better."""
    if is_sharp(node):
        return 0.0
    if node.type == "BSDF_PRINCIPLED":
        return _unmet_by_lacquer(node)
    if node.type in GLOSSY:
        return NARROW
    gives_shader = any(socket.type == "SHADER" for socket in node.outputs)
    return ANY if node.type in DIFFUSE or not gives_shader else 0.0


def _unmet_by_lacquer(node: bpy.types.Node) -> float:
    most = {"Metallic": 0, "Transmission Weight": 0, "Coat Weight": 0, "Sheen Weight": 0}
    most |= {"Specular IOR Level": 0.5, "IOR": LACQUER, "Anisotropic": 0}
    if any(is_above(node, name, value) for name, value in most.items()):
        return NARROW
    if not _is_smooth(node, "Roughness", ROUGH):
        return ANY
    return NARROW if _is_smooth(node, "Roughness", MATT) else WIDE
