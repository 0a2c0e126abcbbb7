"""Suns become sun lamps in a collection of their own."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.suns import Sun
from .trace import TAG
from .world import WorldLight

COLLECTION = "Sunsplit Suns"


def make_lamps(
    suns: Sequence[Sun], light: WorldLight, world: bpy.types.World
) -> list[bpy.types.Object]:
    """One lamp for each sun, aimed and tinted as the world shows the map; in no collection yet.

    What the world does to rays of each kind, its lamps do too.
    """
    lamps = []
    for sun in suns:
        data = _lamp_data(sun.irradiance * light.gain, sun.angular_diameter)
        lamp = bpy.data.objects.new(data.name, data)
        lamp[TAG] = True
        _aim(lamp, light.map_from_world.T @ sun.to_light)
        _set_visibility(lamp, world)
        lamps.append(lamp)
    return lamps


def link_lamps(scene: bpy.types.Scene, lamps: Sequence[bpy.types.Object]) -> bpy.types.Collection:
    """Put lamps into a new collection of a scene, named by their rank."""
    collection = bpy.data.collections.new(COLLECTION)
    collection[TAG] = True
    scene.collection.children.link(collection)
    for rank, lamp in enumerate(lamps, start=1):
        lamp.name = lamp.data.name = f"Sunsplit Sun {rank}"
        collection.objects.link(lamp)
    return collection


def _lamp_data(irradiance: NDArray[np.float64], diameter: float) -> bpy.types.Light:
    """A sun lamp of this normal irradiance, (3,), and angular diameter; nothing left to chance."""
    data = bpy.data.lights.new("Sunsplit Sun", "SUN")
    data[TAG] = True
    strength = float(irradiance.max())
    data.energy = strength
    data.color = irradiance / strength if strength > 0 else (1, 1, 1)
    data.angle = diameter
    data.exposure = 0.0
    data.normalize = True
    data.use_temperature = False
    data.use_shadow = True
    data.diffuse_factor = data.specular_factor = data.transmission_factor = 1.0
    data.volume_factor = 1.0
    return data


def _aim(lamp: bpy.types.Object, to_light: NDArray[np.float64]) -> None:
    """A sun lamp shines along its local -Z, so +Z looks at the light."""
    lamp.rotation_mode = "QUATERNION"
    lamp.rotation_quaternion = Vector(to_light).to_track_quat("Z", "Y")


def _set_visibility(lamp: bpy.types.Object, world: bpy.types.World) -> None:
    """The camera sees the sun in the original map, every other ray in the lamp: once each."""
    lamp.visible_camera = False
    lamp.lightgroup = world.lightgroup
    if not hasattr(world, "cycles"):  # Cycles is switched off
        return
    # Without it no glossy ray meets the disc, and a mirror shows no sun.
    lamp.data.cycles.use_multiple_importance_sampling = True
    lamp.data.cycles.max_bounces = world.cycles.max_bounces
    rays = world.cycles_visibility
    lamp.visible_diffuse = rays.diffuse
    lamp.visible_glossy = rays.glossy
    lamp.visible_transmission = rays.transmission
    lamp.visible_volume_scatter = rays.scatter


def remove_lamps(lamps: Sequence[bpy.types.Object]) -> None:
    """Remove lamps that no scene uses any more."""
    for lamp in lamps:
        data = lamp.data
        if lamp.users == 0:
            bpy.data.objects.remove(lamp)
            if data.users == 0:
                bpy.data.lights.remove(data)


def unlink_lamps(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection | None,
    lamps: Sequence[bpy.types.Object],
) -> None:
    """Take a conversion's lamps out of a scene, wherever the user has put them.

    What the user has put into the lamps' collection moves to the scene.
    """
    if collection is not None and collection.name in scene.collection.children:
        _move_out(scene, collection, lamps)
        scene.collection.children.unlink(collection)
    for holder in (scene.collection, *scene.collection.children_recursive):
        for lamp in lamps:
            if lamp.name in holder.objects:
                holder.objects.unlink(lamp)
    if collection is not None and collection.users == 0:
        bpy.data.collections.remove(collection)


def _move_out(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection,
    lamps: Sequence[bpy.types.Object],
) -> None:
    for thing in collection.objects:
        if thing not in lamps and thing.name not in scene.collection.objects:
            scene.collection.objects.link(thing)
    for child in collection.children:
        if child.name not in scene.collection.children:
            scene.collection.children.link(child)
