"""What an ordinary camera shows in one frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

FINER = 2
"""Pixels of a map in a picture's finest one, whose filter is narrower than the pixel."""


@dataclass(frozen=True, eq=False)
class View:
    """place, turn: of a camera in the scene's axes, (3, 3), which may mirror as well. corners: of
    its picture, top right, bottom right, bottom left and top left, as directions in the camera's
    axes. near, far: of what it shows."""

    place: Vector
    turn: Matrix
    corners: tuple[Vector, ...]
    near: float
    far: float

    def ray(self, across: float, down: float) -> tuple[Vector, Vector]:
        """Start and direction through a point of the picture, (0, 0) its upper left."""
        top_right, bottom_right, bottom_left, top_left = self.corners
        left, right = top_left.lerp(bottom_left, down), top_right.lerp(bottom_right, down)
        direction = (self.turn @ left.lerp(right, across)).normalized()
        return self.place + direction * self.near, direction


def is_ordinary(camera: bpy.types.Object | None) -> bool:
    """Whether a view tells all that a camera shows."""
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        return False
    return camera.matrix_world.determinant() != 0


def view_of(scene: bpy.types.Scene, camera: bpy.types.Object, matrix: Matrix | None = None) -> View:
    """Of an ordinary camera as it stands or is evaluated. scene: gives the picture's shape. matrix:
    where it is, if not where it stands."""
    data = camera.data
    matrix = matrix or camera.matrix_world
    return View(
        matrix.translation.copy(),
        matrix.to_3x3().normalized(),  # its size does not matter, a mirror does
        tuple(corner.copy() for corner in data.view_frame(scene=scene)),
        data.clip_start,
        data.clip_end,
    )


def finest_width(scene: bpy.types.Scene, views: Iterable[View]) -> int:
    """Pixels around the whole sphere that are half as wide as the finest in any of some pictures:
    an ordinary camera's at its corners."""
    return max(_finest(scene, view) for view in views)


def _finest(scene: bpy.types.Scene, view: View) -> int:
    top_right, bottom_right, bottom_left, _ = (c / -c.z for c in view.corners)
    part = scene.render.resolution_percentage / 100
    wide = (bottom_right - bottom_left).length / (scene.render.resolution_x * part)
    high = (top_right - bottom_right).length / (scene.render.resolution_y * part)
    farthest = max(corner.xy.length for corner in (top_right, bottom_right, bottom_left))
    return int(np.ceil(FINER * 2 * np.pi * (1 + farthest**2) / min(wide, high)))
