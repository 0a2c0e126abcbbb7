"""From the direction in the world to the direction in the map: what Mapping nodes do."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector
from numpy.typing import NDArray

from .trace import Input, Place, cannot_follow, constant, ends_at

Matrix3 = NDArray[np.float64]

AXES = {"X_AXIS": (1, 0, 0), "Y_AXIS": (0, 1, 0), "Z_AXIS": (0, 0, 1)}


@dataclass(frozen=True, eq=False)
class Rotation:
    """What a node turns directions by, and where that comes from, so that others can follow.

    angles: Euler angles XYZ; or one angle about `axis`, which is an input or fixed. undone: it is
    the inverse that the node applies.
    """

    angles: Input
    axis: Input | tuple[float, float, float] | None = None
    undone: bool = False

    @property
    def matrix(self) -> Matrix3:
        """As it is now, (3, 3)."""
        if self.axis is None:
            matrix = _euler(constant(self.angles))
        else:
            axis = constant(self.axis) if isinstance(self.axis, Input) else self.axis
            angle = float(constant(self.angles)[0])
            matrix = np.array(Matrix.Rotation(angle, 3, Vector(axis)), dtype=np.float64)
        return matrix.T if self.undone else matrix


@dataclass(frozen=True, eq=False)
class Turn:
    """What one node does to directions on their way from the world to the map: `before`, (3, 3),
    then a rotation, then `after`, (3, 3)."""

    before: Matrix3 = field(default_factory=lambda: np.eye(3))
    rotation: Rotation | None = None
    after: Matrix3 = field(default_factory=lambda: np.eye(3))

    @property
    def matrix(self) -> Matrix3:
        """Of all three, as they are now, (3, 3)."""
        turned = self.rotation.matrix @ self.before if self.rotation else self.before
        return self.after @ turned


def map_from_world(texture: Place) -> Matrix3:
    """The rotation (or rotation and mirror), (3, 3), from world to map directions.

    It undoes nothing: `matrix @ world_direction = map_direction`, so a light that the map shows at
    d shines from `matrix.T @ d`. Raises UnusableInput for what bends or shifts the map.
    """
    matrix = np.eye(3)
    for turn in turns(texture):
        matrix = turn.matrix @ matrix
    return _rigid(texture.node, matrix)


def turns(texture: Place) -> list[Turn]:
    """What directions pass on their way to the map, in that order. Raises UnusableInput."""
    found = _turns(texture.input("Vector"), texture.node)
    return [*found, Turn(_legacy(texture.node))]


def _rigid(node: bpy.types.Node, matrix: Matrix3) -> Matrix3:
    """The matrix without its scale, which directions do not feel when it is uniform."""
    scale = np.cbrt(abs(np.linalg.det(matrix)))
    if scale > 1e-6:
        unit = matrix / scale
        if np.allclose(unit @ unit.T, np.eye(3), atol=1e-5):
            # The nodes' float32 leave 1e-7 of shear; the nearest rotation has none.
            left, _, right = np.linalg.svd(unit)
            return left @ right
    raise cannot_follow(node, "is stretched by its mapping")


def _turns(at: Input, texture: bpy.types.Node) -> list[Turn]:
    end = ends_at(at)
    if end.socket == texture.inputs["Vector"]:
        return []  # a texture without coordinates takes the direction of the ray
    if isinstance(end, Input):
        raise cannot_follow(end.socket.node, "has nothing linked to its Vector")
    output = end
    place, node = output.place, output.socket.node
    if node.type == "TEX_COORD":
        plain = output.socket.identifier == "Generated" or (
            output.socket.identifier == "Object" and node.object is None
        )
        if not plain or node.from_instancer:
            raise cannot_follow(node, f"gives {output.socket.name} coordinates")
        return []
    if node.type == "MAPPING":
        return [*_turns(place.input("Vector"), texture), _mapping(place)]
    if node.type == "VECTOR_ROTATE":
        return [*_turns(place.input("Vector"), texture), _vector_rotate(place)]
    if node.type == "VECT_MATH":
        return [*_turns(place.input(0), texture), _vector_math(place)]
    raise cannot_follow(node, "bends the map")


def _mapping(place: Place) -> Turn:
    node = place.node
    rotation = Rotation(place.input("Rotation"), undone=node.vector_type == "TEXTURE")
    if node.vector_type in ("POINT", "TEXTURE") and constant(place.input("Location")).any():
        raise cannot_follow(node, "shifts the map's directions by its Location")
    scale = _scale(node, node.vector_type, constant(place.input("Scale")))
    if node.vector_type == "TEXTURE":
        return Turn(rotation=rotation, after=scale)
    return Turn(scale, rotation)


def _scale(node: bpy.types.Node, kind: str, scale: NDArray[np.float64]) -> Matrix3:
    """What a mapping of a kind scales directions by, (3, 3)."""
    if kind in ("NORMAL", "TEXTURE"):
        if not scale.all():
            raise cannot_follow(node, "has a Scale of 0")
        return np.diag(1 / scale)
    return np.diag(scale)


def _legacy(node: bpy.types.Node) -> Matrix3:
    """The mapping that an image node of old files still carries in itself."""
    mapping = node.texture_mapping
    if mapping.use_min or mapping.use_max:
        raise cannot_follow(node, "clips the map's directions")
    if mapping.vector_type in ("POINT", "TEXTURE") and np.any(mapping.translation):
        raise cannot_follow(node, "shifts the map's directions")
    axes = np.zeros((3, 3))
    for row, axis in enumerate((mapping.mapping_x, mapping.mapping_y, mapping.mapping_z)):
        if axis != "NONE":
            axes[row, "XYZ".index(axis)] = 1
    scale = _scale(node, mapping.vector_type, np.array(mapping.scale, dtype=np.float64))
    rotation = _euler(np.array(mapping.rotation))
    if mapping.vector_type == "TEXTURE":
        return scale @ rotation.T @ axes
    return rotation @ scale @ axes


def _vector_rotate(place: Place) -> Turn:
    node = place.node
    if constant(place.input("Center")).any():
        raise cannot_follow(node, "turns the map about a shifted centre")
    if node.rotation_type == "EULER_XYZ":
        return Turn(rotation=Rotation(place.input("Rotation"), undone=node.invert))
    axis = AXES.get(node.rotation_type) or place.input("Axis")
    return Turn(rotation=Rotation(place.input("Angle"), axis, undone=node.invert))


def _vector_math(place: Place) -> Turn:
    operation = place.node.operation
    if operation == "NORMALIZE":
        return Turn()
    if operation == "SCALE":
        return Turn(np.eye(3) * constant(place.input("Scale"))[0])
    if operation == "MULTIPLY":
        return Turn(np.diag(constant(place.input(1))))
    raise cannot_follow(place.node, f"does {operation.title()} on the map's directions")


def _euler(angles: NDArray[np.float64]) -> Matrix3:
    return np.array(Euler(tuple(angles), "XYZ").to_matrix(), dtype=np.float64)
