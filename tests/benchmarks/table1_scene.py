"""The scene of Table 1: a figurine on a ground, direct light only, lit from beside the camera."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from sunsplit.core import sphere
from sunsplit.core.environment import luminance
from sunsplit.core.files.maps import load
from tests.blender import (
    add_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    timed_render,
)
from tests.blender import material as principled

KEY_ANGLE = np.radians(60)
"""Between the directions to the key light and to the camera, seen from above."""


def key_azimuth(path: Path) -> float:
    """Where most of the light of a map's brightest tenth of a percent comes from, radians."""
    radiance = load(path).radiance
    height, width = radiance.shape[:2]
    light = luminance(radiance)
    row, column = np.nonzero(light >= np.quantile(light, 0.999))
    weight = light[row, column] * sphere.row_solid_angles(width, height)[row]
    x, y, _ = weight @ sphere.to_directions((column + 0.5) / width, (row + 0.5) / height)
    return float(np.arctan2(y, x))


def figurine_scene(path: Path, size: int, azimuth: float) -> bpy.types.Scene:
    """The scene under a map whose key light comes from this azimuth."""
    scene = fresh_scene()
    hdri_world(scene, path)
    facing = azimuth + KEY_ANGLE
    add_mesh(scene, plate_mesh(5), diffuse("Ground", 0.5), Matrix.Rotation(facing, 4, "Z"))
    statue = principled("Statue", (0.75, 0.7, 0.62), Roughness=0.45)
    # The monkey looks along -Y; turned so that it looks past the camera, towards the light.
    turn = Matrix.Rotation(facing + np.pi / 2 - 0.35, 4, "Z") @ Matrix.Rotation(-0.4, 4, "X")
    figurine = add_mesh(scene, monkey_mesh(), statue, Matrix.Translation((0, 0, 0.75)) @ turn)
    smooth = figurine.modifiers.new("Smooth", "SUBSURF")
    smooth.levels = smooth.render_levels = 2
    towards = np.array([np.cos(facing), np.sin(facing), 0.45])
    camera = camera_towards(scene, -towards, 30, size)
    camera.location = 6.2 * towards + (0, 0, 0.4)
    # Direct light only, as in the paper, and nothing that trades noise for bias.
    scene.cycles.max_bounces = 0
    scene.cycles.light_sampling_threshold = 0
    scene.cycles.sample_clamp_direct = 0
    scene.render.use_persistent_data = False
    return scene


def monkey_mesh() -> bpy.types.Mesh:
    """Blender's Suzanne."""
    import bmesh  # it is there once bpy is

    mesh = bpy.data.meshes.new("Figurine")
    shape = bmesh.new()
    bmesh.ops.create_monkey(shape)
    shape.to_mesh(mesh)
    shape.free()
    mesh.shade_smooth()
    return mesh


def surfaces(scene: bpy.types.Scene, folder: Path) -> np.ndarray:
    """The pixels that show surfaces only, bool (height, width)."""
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = "RGBA"
    alpha = timed_render(scene, folder, 64, 0)[0][..., 3]
    scene.render.film_transparent = False
    scene.render.image_settings.color_mode = "RGB"
    return alpha > 0.9999
