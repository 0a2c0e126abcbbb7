"""Which suns the rays that go on from surfaces need not meet.

A path tracer looks for suns, and its rays may meet them by chance besides (Cycles' "multiple
importance" of a lamp). Mirrors need that: without it they show no sun. To rough surfaces it is a
second way to the same light, which takes time, and of which suns are noisier than of the first
alone. All bounds are by docs/benchmarks/met_suns.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import bpy

from .changes import SHAPELESS, stand_still
from .moments import Sight
from .shaders import (
    GLOSSY,
    gloss_of,
    is_above,
    is_exact,
    is_smooth,
    lets_straight_through,
    nodes_of,
)
from .steps import Steps

ANY = math.pi
"""The widest sun that Blender has, in radians: none need be met."""

NARROW = math.radians(3.0)
"""Suns that wide the rays of rough surfaces meet so rarely that nobody can tell whether they do."""

ROUGH = 0.5
"""Roughness from which a lacquer, as plastics have it, is as if it were not there."""

MATT, WIDE = 0.4, math.radians(30.0)
"""Roughness from which its gloss is faint and wide: less noisy without rays that meet suns up to so
wide, but up to 1.7 times as noisy without those that meet wider ones."""

LITTLE = 0.1
"""Of a picture: so much of it may be so noisy, as all else is calmer for it under most maps."""

LACQUER = 1.5
"""Index of refraction up to which a gloss counts as faint."""

DIFFUSE = {
    *("BSDF_DIFFUSE", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING", "BSDF_TRANSPARENT"),
    *("EMISSION", "HOLDOUT", "MIX_SHADER", "ADD_SHADER", "GROUP", "GROUP_INPUT"),
    *("BACKGROUND", "REROUTE"),
}
"""Nodes with a shader that reflect evenly, or nothing themselves."""

GIVING = {"BOOLEAN", "PARTICLE_SYSTEM"}
"""Modifiers, beside nodes, that may give a thing materials of others, or show others there."""


def unmet_steps(
    nodes: Iterable[bpy.types.Node],
    shown: Sequence[bpy.types.Object],
    sight: Sight | None,
    beside: bool = False,
) -> Steps[float]:
    """Angular diameter, in radians, of the widest suns that no ray in a scene need meet. nodes: of
    all materials that its things, `shown`, may wear. sight: the scene for rays, if they tell. In an
    empty scene all are met: mirrors may come. beside: there are exact mirrors besides `shown`."""
    if not beside and not any(map(has_shape, shown)):
        return 0.0
    width = min(map(unmet_width, nodes), default=ANY)
    if width != WIDE or sight is None or not are_worn_as_told(shown):
        return width
    lacquered = {thing.name for thing in shown if any(map(_is_faint, worn_by(thing)))}
    part = yield from sight.part_of_picture(lacquered)
    return ANY if part <= LITTLE else WIDE


def has_shape(thing: bpy.types.Object) -> bool:
    if thing.type == "EMPTY":
        return thing.instance_type != "NONE"
    return thing.type not in SHAPELESS


def unmet_width(node: bpy.types.Node, but_exact: bool = False) -> float:
    """The same of a surface that is made of this node. but_exact: as if it had no layer that is an
    exact mirror or clear glass (see `singular`)."""
    gloss = [name for name in gloss_of(node) if not (but_exact and is_exact(node, name))]
    if any(is_smooth(node, name) for name in gloss) or (gloss and lets_straight_through(node)):
        return 0.0
    if node.type == "BSDF_PRINCIPLED":
        return _unmet_by_layers(node, gloss)
    if gloss:
        return NARROW
    gives_shader = any(socket.type == "SHADER" for socket in node.outputs)
    return ANY if node.type in (DIFFUSE | GLOSSY) or not gives_shader else 0.0


def _unmet_by_layers(node: bpy.types.Node, gloss: Sequence[str]) -> float:
    """Of a Principled BSDF. gloss: of its layers, those that count."""
    if "Coat Roughness" in gloss or is_above(node, "Sheen Weight", 0):
        return NARROW
    return _unmet_by_lacquer(node) if "Roughness" in gloss else ANY


def _unmet_by_lacquer(node: bpy.types.Node) -> float:
    most = {"Metallic": 0, "Transmission Weight": 0, "Anisotropic": 0}
    most |= {"Specular IOR Level": 0.5, "IOR": LACQUER}
    if any(is_above(node, name, value) for name, value in most.items()):
        return NARROW
    if not is_smooth(node, "Roughness", ROUGH):
        return ANY
    return NARROW if is_smooth(node, "Roughness", MATT) else WIDE


def _is_faint(node: bpy.types.Node) -> bool:
    return unmet_width(node) == WIDE


def are_worn_as_told(shown: Iterable[bpy.types.Object]) -> bool:
    """Whether things wear what their slots say, and nothing that modifiers give them."""
    return not any(_may_give(made) for thing in shown for made in thing.modifiers)


def _may_give(made: bpy.types.Modifier) -> bool:
    if made.type == "NODES":  # some give none, as that of Shade Auto Smooth
        return made.node_group is None or not stand_still(made.node_group)
    return made.type in GIVING


def worn_by(thing: bpy.types.Object) -> Iterable[bpy.types.Node]:
    """The nodes of a thing's materials."""
    for slot in thing.material_slots:
        if slot.material and slot.material.node_tree:
            yield from nodes_of(slot.material.node_tree)
