"""Scenes to time and judge pictures with: each under a map, its key light turned to where it tells.

All stand on z = 0, the map's key light comes from +X of the scene after `turned`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from tests.benchmarks.table1_scene import key_azimuth, monkey_mesh
from tests.blender import (
    add_mesh,
    ball_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    plate_mesh,
)
from tests.rooms import build_walls

MOVE = Matrix.Translation


def outdoor(path: Path, size: int) -> bpy.types.Scene:
    """Columns and balls on a wide ground, and their long shadows."""
    scene, turn = _under(path)
    add_mesh(scene, plate_mesh(40), diffuse("Ground", 0.5), turn)
    for number in range(6):
        angle = number * 1.05
        place = MOVE((np.cos(angle) * 1.7, np.sin(angle) * 1.7, 0))
        add_mesh(scene, box_mesh(0.12, 0.12, 0.7), diffuse("Column", 0.7), turn @ place)
    add_mesh(scene, ball_mesh(0.5), diffuse("Ball", 0.7), turn @ MOVE((0.6, 0.4, 0.5)))
    rough = material("Rough", (0.7, 0.7, 0.7), Roughness=0.4)
    add_mesh(scene, ball_mesh(0.5), rough, turn @ MOVE((-0.5, -0.4, 0.5)))
    _camera(scene, turn, (1.5, -5.5, 3.8), 38, size)
    return scene


def product(path: Path, size: int) -> bpy.types.Scene:
    """A figurine on a plate, the map behind it."""
    scene, turn = _under(path)
    add_mesh(scene, box_mesh(1.6, 1.6, 0.04), diffuse("Plate", 0.8), turn @ MOVE((0, 0, -0.08)))
    statue = material("Statue", (0.75, 0.7, 0.62), Roughness=0.45)
    pose = MOVE((0, 0, 0.85)) @ Matrix.Rotation(0.6, 4, "Z")
    figurine = add_mesh(scene, monkey_mesh(), statue, turn @ pose)
    smooth = figurine.modifiers.new("Smooth", "SUBSURF")
    smooth.levels = smooth.render_levels = 2
    _camera(scene, turn, (1.2, -5.0, 2.4), 30, size)
    return scene


def room(path: Path, size: int) -> bpy.types.Scene:
    """A closed white room with one window towards the key light; the camera sees no sky."""
    scene, turn = _under(path)
    build_walls(scene, diffuse("Wall", 0.75), turn)
    add_mesh(scene, box_mesh(0.3, 0.3, 0.35), diffuse("Box", 0.6), turn @ MOVE((-0.3, 0.6, 0)))
    add_mesh(scene, ball_mesh(0.4), diffuse("Ball", 0.6), turn @ MOVE((0.2, -0.6, 0.4)))
    _camera(scene, turn, (1.6, -1.6, 1.6), 70, size, aim=(-0.8, 0.6, 0.7))
    scene.cycles.max_bounces = 8
    return scene


def glossy(path: Path, size: int) -> bpy.types.Scene:
    """Metal, glass and lacquer on a shining floor."""
    scene, turn = _under(path)
    floor = material("Floor", (0.4, 0.4, 0.4), Roughness=0.35)
    add_mesh(scene, plate_mesh(40), floor, turn)
    surfaces = (
        material("Mirror", (0.9, 0.9, 0.9), Metallic=1, Roughness=0.0),
        material("Brushed", (0.9, 0.7, 0.4), Metallic=1, Roughness=0.3),
        material("Glass", (1, 1, 1), Roughness=0.0, Transmission_Weight=1),
        material("Lacquer", (0.5, 0.05, 0.05), Roughness=0.5, Coat_Weight=1),
    )
    for number, surface in enumerate(surfaces):
        add_mesh(scene, ball_mesh(0.5), surface, turn @ MOVE((1.2 * number - 1.8, 0, 0.5)))
    _camera(scene, turn, (1.0, -5.5, 2.2), 46, size)
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    return scene


SCENES: dict[str, Callable[[Path, int], bpy.types.Scene]] = {
    "outdoor": outdoor,
    "product": product,
    "room": room,
    "glossy": glossy,
}


BRIGHTEST = {"glossy": 1 / 0.18}
"""Scenes whose pictures count up to so many of their medians, as on a display that shows these as
middle grey: a mirrored sun in them, a fiftieth of a pixel wide, is met by one sample in thousands
and outshines all else."""


def _under(path: Path) -> tuple[bpy.types.Scene, Matrix]:
    """A scene with the map as its world, and the turn of +X towards the key light."""
    scene = fresh_scene()
    hdri_world(scene, path)
    scene.cycles.max_bounces = 4
    # As Blender sets it up; without, a mirror's sun is all that a picture's error is made of.
    scene.cycles.sample_clamp_indirect, scene.cycles.blur_glossy = 10.0, 1.0
    return scene, Matrix.Rotation(key_azimuth(path) + np.radians(35), 4, "Z")


def _camera(
    scene: bpy.types.Scene,
    turn: Matrix,
    place: tuple[float, float, float],
    field_of_view: float,
    size: int,
    aim: tuple[float, float, float] = (0, 0, 0.45),
) -> None:
    towards = turn.to_3x3() @ (MOVE(aim).translation - MOVE(place).translation)
    camera = camera_towards(scene, np.array(towards), field_of_view, size)
    camera.location = turn @ MOVE(place).translation
