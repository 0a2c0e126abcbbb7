"""What a picture shows in rough gloss: where its surfaces mirror the world, and how blurred."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.environment import LUMINANCE_WEIGHTS
from ..core.gloss import Gloss
from .moments import Sight
from .shaders import SHARP, gloss_of, nodes_of
from .steps import Steps

PICTURE = 20, 11
"""Rays through a camera's picture that look for gloss; frames that are looked at share them."""

MATT = 0.8
"""Roughness from which gloss is as even as if it were none."""

UNTOLD = 0.4
"""What a roughness counts as that is not one value."""

DIELECTRIC = 0.04
"""What a surface of an index of refraction of 1.5 reflects of light that it faces."""


@dataclass(frozen=True)
class Layer:
    """Of a surface: how rough, and how much it reflects of light that it faces."""

    roughness: float
    facing: float


def gloss_steps(sight: Sight, to_map: NDArray[np.float64]) -> Steps[Gloss | None]:
    """What is seen in all frames that are looked at; None: nothing, or nothing rough. to_map:
    rotation (3, 3) from the scene's axes."""
    layers: dict[bpy.types.Object, list[Layer]] = {}
    found: list[tuple[Vector, Vector, Layer]] = []
    rays = 0
    for moment in sight.moments:
        for direction, hit in moment.pictured(*PICTURE, len(sight.moments)):
            rays += 1
            if hit is None:
                continue
            thing = hit.things[0]
            if thing not in layers:
                layers[thing] = list(layers_of(thing))
            if layers[thing]:
                normal = hit.normal if hit.normal.dot(direction) < 0 else -hit.normal
                if moment.mirrors_world(hit, direction, normal):
                    found += [(-direction, normal, layer) for layer in layers[thing]]
        yield
    if not found:
        return None
    viewers, normals, kinds = zip(*found, strict=True)
    return Gloss(
        np.array([tuple(one) for one in viewers]) @ to_map.T,
        np.array([tuple(one) for one in normals]) @ to_map.T,
        np.array([one.roughness for one in kinds]),
        np.array([one.facing for one in kinds]),
        rays,
    )


def layers_of(thing: bpy.types.Object) -> Iterator[Layer]:
    """Of a thing's materials, those that are rough, but not too rough to mirror anything. What is
    sharp shows lamps as they are, however many there are."""
    for slot in thing.material_slots:
        if slot.material and slot.material.node_tree:
            for node in nodes_of(slot.material.node_tree):
                for name in gloss_of(node):
                    layer = Layer(_value(node, name, UNTOLD), _facing(node, name))
                    if SHARP <= layer.roughness <= MATT and layer.facing > 0:
                        yield layer


def _facing(node: bpy.types.Node, name: str) -> float:
    if name == "Coat Roughness":
        return DIELECTRIC * min(_value(node, "Coat Weight", 1.0), 1.0)
    if node.type != "BSDF_PRINCIPLED":
        kinds = {"BSDF_GLASS": DIELECTRIC, "BSDF_REFRACTION": 0.0}
        return kinds[node.type] if node.type in kinds else _colour(node)
    metal = min(_value(node, "Metallic", 1.0), 1.0)
    level = 2 * _value(node, "Specular IOR Level", 0.5)
    return metal * _colour(node) + (1 - metal) * DIELECTRIC * level


def _colour(node: bpy.types.Node) -> float:
    """Luminance of the first colour among its inputs."""
    socket = next((one for one in node.inputs if one.type == "RGBA"), None)
    if socket is None or socket.is_linked:
        return 0.5
    return float(np.array(socket.default_value[:3]) @ LUMINANCE_WEIGHTS)


def _value(node: bpy.types.Node, name: str, untold: float) -> float:
    socket = node.inputs.get(name)
    return untold if socket is None or socket.is_linked else socket.default_value
