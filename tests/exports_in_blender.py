"""Exports as Blender's own importers of USD and glTF read them, rendered by Cycles."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from tests.blender import (
    add_mapping,
    add_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    render,
)
from tests.exporting import HEIGHT, WIDTH
from tests.plates import ALBEDO


def usd_scene(path: Path) -> bpy.types.Scene:
    """What Blender makes of a file in a scene that has nothing but a world: without one, it leaves
    the map out."""
    scene = fresh_scene()
    scene.world = bpy.data.worlds.new("World")
    assert bpy.ops.wm.usd_import(filepath=str(path)) == {"FINISHED"}
    bpy.context.view_layer.update()
    return scene


def gltf_scene(path: Path, mode: str = "SPEC") -> bpy.types.Scene:
    """What Blender's importer makes of a file, and nothing else. mode: what it takes lux for."""
    scene = fresh_scene()
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.import_scene.gltf(filepath=str(path), export_import_convert_lighting_mode=mode)
    bpy.context.view_layer.update()
    return scene


def add_gltf_world(scene: bpy.types.Scene, folder: Path) -> None:
    """The map beside a file, as the file's extras say, which the importer keeps with the scene.

    The importer turns Y up into Z up, where an environment texture lies as they say of the map.
    """
    told = scene["sunsplit"]["map"]
    mapping = add_mapping(hdri_world(scene, folder / unquote(told["uri"])))
    x, y, z, w = told["rotation"]
    # The node turns directions of the scene into those of the picture.
    back = Quaternion((w, x, -z, y)).inverted()
    mapping.inputs["Rotation"].default_value = back.to_euler()


def lamps(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """In the order of the scene."""
    return [thing for thing in scene.objects if thing.type == "LIGHT"]


def add_gltf_widths(scene: bpy.types.Scene) -> None:
    """The importer leaves every sun the width of a new lamp; what it has is kept with it."""
    for lamp in lamps(scene):
        lamp.data.angle = lamp.data["angular_diameter"]


def look_at_stage(scene: bpy.types.Scene) -> None:
    """By the camera that came with it."""
    (scene.camera,) = (thing for thing in scene.objects if thing.type == "CAMERA")
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 7


def usd_stage(folder: Path, name: str, samples: int, seed: int) -> np.ndarray:
    """The scene that comes with an export for Blender, linear (HEIGHT, WIDTH, 3)."""
    scene = usd_scene(folder / f"{name}.scene.usda")
    look_at_stage(scene)
    return render(scene, folder, samples, seed)


def gltf_stage(folder: Path, name: str, samples: int, seed: int) -> np.ndarray:
    """The same, with the map beside it and the widths that it states."""
    scene = gltf_scene(folder / f"{name}.scene.gltf")
    look_at_stage(scene)
    add_gltf_world(scene, folder)
    add_gltf_widths(scene)
    return render(scene, folder, samples, seed)


def usd_plate(folder: Path, name: str, normal: np.ndarray, samples: int) -> np.ndarray:
    """Radiance of a white plate under exported lights, (3,)."""
    return plate_in(usd_scene(folder / f"{name}.lights.usda"), folder, normal, samples)


def gltf_plate(folder: Path, name: str, normal: np.ndarray, samples: int) -> np.ndarray:
    """The same."""
    scene = gltf_scene(folder / f"{name}.lights.gltf")
    add_gltf_world(scene, folder)
    return plate_in(scene, folder, normal, samples)


def plate_in(scene: bpy.types.Scene, folder: Path, normal: np.ndarray, samples: int) -> np.ndarray:
    """Radiance of a white plate in a scene that has nothing but light, (3,); it is gone then."""
    # The tree leaves out wide suns whose middle lies behind a surface: up to a tenth of the light.
    scene.cycles.use_light_tree = False
    towards = Vector(np.asarray(normal).tolist())
    turn = towards.to_track_quat("Z", "Y").to_matrix().to_4x4()
    plate = add_mesh(scene, plate_mesh(1), diffuse("White", ALBEDO), turn)
    camera = camera_towards(scene, -np.asarray(normal), 30, 48)
    camera.location = towards * 2
    seen = render(scene, folder, samples).mean(axis=(0, 1))
    for thing in (plate, camera):
        bpy.data.objects.remove(thing)
    return seen
