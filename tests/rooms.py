"""A room with a window in a wall, in the open."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from tests.blender import (
    add_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
)

MOVE = Matrix.Translation

WINDOW = np.array([2.0, 0.0, 1.5]), (1.4, 1.2)
"""Its middle, in the inner face of the wall, and its width and height."""


def room(path: Path, size: int = 32, turn: float = 0.0) -> bpy.types.Scene:
    """4 x 4 x 2.6 large, lit by a map through a window towards +X, before turned about Z; the
    camera sees no sky."""
    scene = fresh_scene()
    hdri_world(scene, path)
    around = Matrix.Rotation(turn, 4, "Z")
    build_walls(scene, diffuse("Wall", 0.7), around)
    towards = around.to_3x3() @ MOVE((-1, 0.4, -0.4)).translation
    camera = camera_towards(scene, np.array(towards), 70, size)
    camera.location = around @ MOVE((1.6, -1.2, 1.5)).translation
    scene.cycles.max_bounces = 4
    bpy.context.view_layer.update()
    return scene


def build_walls(scene: bpy.types.Scene, walls: bpy.types.Material, turn: Matrix) -> None:
    """Floor, ceiling and four walls, one of them with the window."""
    # Half sides x, y, z and where each box stands: floor, ceiling, back, sides, front in four.
    for half, place in (
        ((2.2, 2.2, 0.1), (0, 0, -0.2)),
        ((2.2, 2.2, 0.1), (0, 0, 2.6)),
        ((0.1, 2.2, 1.4), (-2.1, 0, -0.1)),
        ((2.2, 0.1, 1.4), (0, 2.1, -0.1)),
        ((2.2, 0.1, 1.4), (0, -2.1, -0.1)),
        ((0.1, 0.7, 1.4), (2.1, 1.4, -0.1)),
        ((0.1, 0.7, 1.4), (2.1, -1.4, -0.1)),
        ((0.1, 0.8, 0.5), (2.1, 0, -0.1)),
        ((0.1, 0.8, 0.25), (2.1, 0, 2.1)),
    ):
        add_mesh(scene, box_mesh(*half), walls, turn @ MOVE(place))


def close_with(scene: bpy.types.Scene, pane: bpy.types.Material) -> bpy.types.Object:
    """Put a pane into the window of a room that is not turned."""
    standing = MOVE((2.1, 0, 1.5)) @ Matrix.Rotation(np.pi / 2, 4, "Y")
    made = add_mesh(scene, plate_mesh(0.8), pane, standing)
    bpy.context.view_layer.update()
    return made


def portals(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Portals in a scene, by name."""
    found = [thing for thing in scene.objects if thing.type == "LIGHT"]
    found = [thing for thing in found if thing.data.type == "AREA" and thing.data.cycles.is_portal]
    return sorted(found, key=lambda portal: portal.name)
