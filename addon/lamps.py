"""Suns become sun lamps in a collection of their own."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.suns import Sun
from .world import TAG, WorldLight

COLLECTION = "Sunsplit Suns"


def add_lamps(
    scene: bpy.types.Scene, suns: Sequence[Sun], light: WorldLight
) -> bpy.types.Collection:
    """One lamp for each sun, aimed and tinted as the world shows the map."""
    collection = bpy.data.collections.new(COLLECTION)
    collection[TAG] = True
    scene.collection.children.link(collection)
    for rank, sun in enumerate(suns, start=1):
        name = f"Sunsplit Sun {rank}"
        data = _lamp_data(name, sun.irradiance * light.gain, sun.angular_diameter)
        lamp = bpy.data.objects.new(name, data)
        lamp[TAG] = True
        _aim(lamp, light.map_from_world.T @ sun.to_light)
        _set_visibility(lamp)
        collection.objects.link(lamp)
    return collection


def _lamp_data(name: str, irradiance: NDArray[np.float64], diameter: float) -> bpy.types.Light:
    """A sun lamp of this normal irradiance, (3,), and angular diameter; nothing left to chance."""
    data = bpy.data.lights.new(name, "SUN")
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
    # Without it no glossy ray meets the disc, and a mirror shows no sun.
    data.cycles.use_multiple_importance_sampling = True
    data.cycles.max_bounces = 1024
    return data


def _aim(lamp: bpy.types.Object, to_light: NDArray[np.float64]) -> None:
    """A sun lamp shines along its local -Z, so +Z looks at the light."""
    lamp.rotation_mode = "QUATERNION"
    lamp.rotation_quaternion = Vector(to_light).to_track_quat("Z", "Y")


def _set_visibility(lamp: bpy.types.Object) -> None:
    """The camera sees the sun in the original map, every other ray in the lamp: once each."""
    lamp.visible_camera = False
    lamp.visible_diffuse = True
    lamp.visible_glossy = True
    lamp.visible_transmission = True
    lamp.visible_volume_scatter = True


def remove_lamps(scene: bpy.types.Scene, collection: bpy.types.Collection | None) -> None:
    """Remove a conversion's lamps, also those that the user has moved to other collections."""
    mine = set(scene.objects) | (set(collection.objects) if collection else set())
    for lamp in [thing for thing in mine if thing.get(TAG)]:
        data = lamp.data
        bpy.data.objects.remove(lamp)
        if data.users == 0:
            bpy.data.lights.remove(data)
    if collection is not None:
        _remove_collection(scene, collection)


def _remove_collection(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """Remove it; what the user has put into it moves to the scene."""
    for thing in collection.objects:
        if thing.name not in scene.collection.objects:
            scene.collection.objects.link(thing)
    for child in collection.children:
        if child.name not in scene.collection.children:
            scene.collection.children.link(child)
    bpy.data.collections.remove(collection)
