"""Lamps as suns: what Cycles makes of them at the current frame, drivers and all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.environment import LUMINANCE_WEIGHTS
from ..core.errors import UnusableInput
from ..core.suns import Sun
from .lamps import LEAST
from .trace import Place, constant, source_of

Floats = NDArray[np.float64]


def suns_of_lamps(scene: bpy.types.Scene, lamps: Sequence[bpy.types.Object]) -> list[Sun]:
    """Those of these lamps that a render of a scene has, brightest first, in the scene's axes.

    What is no sun lamp any more, or gives nothing, is left out. Raises UnusableInput for light that
    no sun gives.
    """
    shown, graph = set(_rendered(scene)), _evaluated(scene)
    suns = []
    for lamp in lamps:
        now = lamp.evaluated_get(graph)
        if lamp in shown and not now.hide_render and now.type == "LIGHT" and now.data.type == "SUN":
            suns.append(_sun(now))
    lit = [sun for sun in suns if sun.irradiance.any()]
    return sorted(lit, key=lambda sun: -float(sun.scalar_irradiance @ LUMINANCE_WEIGHTS))


def _evaluated(scene: bpy.types.Scene) -> bpy.types.Depsgraph:
    """Lamps are evaluated with each of a scene's view layers, hidden or not: the scene's settings
    point at them."""
    context = bpy.context
    layer = context.view_layer if context.scene == scene else scene.view_layers[0]
    with context.temp_override(scene=scene, view_layer=layer):
        return bpy.context.evaluated_depsgraph_get()


def _rendered(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """What stands in a collection that some view layer renders: of two passes, one has the lamps.
    Objects may be among it that are themselves hidden."""
    for layer in scene.view_layers:
        if layer.use:
            yield from _rendered_in(layer.layer_collection)


def _rendered_in(holder: bpy.types.LayerCollection) -> Iterator[bpy.types.Object]:
    if holder.collection.hide_render:
        return
    if not holder.exclude:
        yield from holder.collection.objects
    for child in holder.children:
        yield from _rendered_in(child)


def _sun(lamp: bpy.types.Object) -> Sun:
    """lamp: evaluated."""
    data = lamp.data
    factor = 2.0**data.exposure
    if factor < 1.001 * LEAST:
        factor = 0.0
    strength = data.energy * factor * np.array(data.color, np.float64)
    if data.use_temperature:
        strength = strength * np.array(data.temperature_color, np.float64)
    strength = strength * _gain_of_nodes(data)
    if (strength < 0).any():
        raise UnusableInput(f'The lamp "{lamp.name}" has a negative strength: no light has that.')
    half = data.angle / 2
    # Cycles shares a sun lamp's strength out over its disc, unless that is not to be normalised:
    # then it is the disc's radiance. A point has its strength either way.
    shared = data.normalize or not half
    irradiance = strength if shared else strength * np.pi * np.sin(half) ** 2
    to_light = np.array(lamp.matrix_world.col[2][:3], np.float64)
    if not to_light.any():
        raise UnusableInput(f'The lamp "{lamp.name}" is scaled to nothing: it has no direction.')
    # The stratum, which is a map's, is of no use to an export.
    return Sun(
        to_light / np.linalg.norm(to_light),
        irradiance,
        irradiance / ((1 + np.cos(half)) / 2),
        data.angle,
        1,
    )


def _gain_of_nodes(data: bpy.types.Light) -> Floats:
    """What a lamp's own nodes make of its strength, factors (3,)."""
    # From Blender 5 on every lamp uses nodes, and asking whether it does is deprecated.
    tree = data.node_tree if bpy.app.version >= (5, 0) or data.use_nodes else None
    output = tree.get_output_node("CYCLES") if tree else None
    if output is None:
        return np.ones(3) if tree is None else np.zeros(3)
    surface = source_of(Place(output, ()).input("Surface"))
    if surface is None:
        return np.zeros(3)
    try:
        if surface.socket.node.type == "EMISSION":
            place = surface.place
            return constant(place.input("Color")) * constant(place.input("Strength"))
    except UnusableInput:
        pass  # its sentence is about worlds
    raise UnusableInput(
        f'The nodes of the lamp "{data.name}" do more than scale its light: '
        "take them out to export it."
    )
