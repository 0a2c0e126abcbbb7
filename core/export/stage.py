"""The scene that every export comes with: a ground, a ball, a box and a pole, and a camera that
sees their shadows. Metres, in Sunsplit's axes (right-handed, Z up); all surfaces are matt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Ground:
    """A square in the plane z = 0 around the origin. half: of its side. colour: albedo, linear."""

    half: float
    colour: Vector


@dataclass(frozen=True)
class Ball:
    centre: Vector
    radius: float
    colour: Vector


@dataclass(frozen=True)
class Box:
    """half: of its sides. turned: about its vertical, radians."""

    centre: Vector
    half: Vector
    turned: float
    colour: Vector

    @property
    def matrix(self) -> Floats:
        """From a cube with corners at -1 and 1 to this box, (4, 4)."""
        c, s = np.cos(self.turned), np.sin(self.turned)
        out = np.eye(4)
        out[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) * self.half
        out[:3, 3] = self.centre
        return out


Thing = Ground | Ball | Box


@dataclass(frozen=True)
class Camera:
    """field_of_view: of the picture's width, degrees. width, height: of the picture, pixels."""

    place: Vector
    target: Vector
    field_of_view: float
    width: int
    height: int

    @property
    def field_of_view_of_height(self) -> float:
        """Degrees."""
        half = np.tan(np.radians(self.field_of_view) / 2) * self.height / self.width
        return float(2 * np.degrees(np.arctan(half)))

    @property
    def frame(self) -> Floats:
        """Right, up and backwards as columns, (3, 3): how a camera that looks along its -Z, its +Y
        up, stands in the scene."""
        back = np.subtract(self.place, self.target)
        back /= np.linalg.norm(back)
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(back, right), back], axis=-1)


@dataclass(frozen=True)
class Stage:
    things: dict[str, Thing]
    camera: Camera


STAGE = Stage(
    {
        "ground": Ground(20.0, (0.5, 0.5, 0.5)),
        "ball": Ball((0.0, -1.0, 0.8), 0.8, (0.7, 0.7, 0.7)),
        "box": Box((0.2, 1.4, 0.5), (0.5, 0.5, 0.5), 0.5, (0.6, 0.3, 0.2)),
        "pole": Box((0.9, 0.15, 0.75), (0.05, 0.05, 0.75), 0.3, (0.2, 0.35, 0.6)),
    },
    Camera((8.0, -1.5, 5.2), (-0.4, 0.1, 0.35), 40.0, 640, 360),
)


@dataclass(frozen=True, eq=False)
class Mesh:
    """points and normals: (n, 3) each. triangles: indices, (m, 3), counter-clockwise seen from
    outside."""

    points: Floats
    normals: Floats
    triangles: NDArray[np.intp]


def mesh_of(thing: Thing) -> Mesh:
    """A thing as triangles; a ball as so many that their edges are not to be seen."""
    if isinstance(thing, Ground):
        corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * thing.half
        up = np.broadcast_to([0.0, 0.0, 1.0], (4, 3))
        return Mesh(corners, up, np.array([[0, 1, 2], [0, 2, 3]]))
    if isinstance(thing, Box):
        return _box(thing)
    return _ball(thing)


def _box(box: Box) -> Mesh:
    """Four points for each side, so that sides are flat."""
    points, normals = [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            # Two axes that, with the normal, are right-handed: so the sides look outwards.
            first, second = np.roll(np.eye(3)[axis], 1) * sign, np.roll(np.eye(3)[axis], 2)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                points.append(normal + a * first + b * second)
                normals.append(normal)
    matrix = box.matrix
    turned = np.array(normals) @ (matrix[:3, :3] / box.half).T
    side = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = np.concatenate([side + 4 * k for k in range(6)])
    return Mesh(np.array(points) @ matrix[:3, :3].T + matrix[:3, 3], turned, triangles)


def _ball(ball: Ball, around: int = 128) -> Mesh:
    rows = around // 2
    polar = np.pi * np.arange(rows + 1)[:, None] / rows
    azimuth = 2 * np.pi * np.arange(around + 1) / around
    ring = np.sin(polar)
    normals = np.stack(
        np.broadcast_arrays(ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar)), -1
    ).reshape(-1, 3)
    row, column = np.divmod(np.arange(rows * around), around)
    a = row * (around + 1) + column
    b = a + around + 1
    lower = np.stack([a, b, b + 1], -1)[row < rows - 1]
    upper = np.stack([a, b + 1, a + 1], -1)[row > 0]
    points = np.array(ball.centre) + ball.radius * normals
    return Mesh(points, normals, np.concatenate([lower, upper]))
