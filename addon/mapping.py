"""From the direction in the world to the direction in the map: what Mapping nodes do."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector
from numpy.typing import NDArray

from .trace import Input, Place, cannot_follow, constant, ends_at

Matrix3 = NDArray[np.float64]


def map_from_world(texture: Place) -> Matrix3:
    """The rotation (or rotation and mirror), (3, 3), from world to map directions.

    It undoes nothing: `matrix @ world_direction = map_direction`, so a light that the map shows at
    d shines from `matrix.T @ d`. Raises UnusableInput for what bends or shifts the map.
    """
    legacy = _legacy(texture.node)
    return _rigid(texture.node, legacy @ _vector(texture.input("Vector"), texture.node))


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


def _vector(at: Input, texture: bpy.types.Node) -> Matrix3:
    end = ends_at(at)
    if end.socket == texture.inputs["Vector"]:
        return np.eye(3)  # a texture without coordinates takes the direction of the ray
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
        return np.eye(3)
    if node.type == "MAPPING":
        return _mapping(place) @ _vector(place.input("Vector"), texture)
    if node.type == "VECTOR_ROTATE":
        return _vector_rotate(place) @ _vector(place.input("Vector"), texture)
    if node.type == "VECT_MATH":
        return _vector_math(place) @ _vector(place.input(0), texture)
    raise cannot_follow(node, "bends the map")


def _mapping(place: Place) -> Matrix3:
    node = place.node
    rotation = _euler(constant(place.input("Rotation")))
    scale = constant(place.input("Scale"))
    if node.vector_type in ("POINT", "TEXTURE") and constant(place.input("Location")).any():
        raise cannot_follow(node, "shifts the map's directions by its Location")
    return _transform(node, node.vector_type, rotation, scale)


def _transform(
    node: bpy.types.Node, kind: str, rotation: Matrix3, scale: NDArray[np.float64]
) -> Matrix3:
    if kind in ("NORMAL", "TEXTURE") and not scale.all():
        raise cannot_follow(node, "has a Scale of 0")
    if kind == "TEXTURE":
        return np.diag(1 / scale) @ rotation.T
    if kind == "NORMAL":
        return rotation @ np.diag(1 / scale)
    return rotation @ np.diag(scale)


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
    scale = np.array(mapping.scale, dtype=np.float64)
    rotation = _euler(np.array(mapping.rotation))
    return _transform(node, mapping.vector_type, rotation, scale) @ axes


def _vector_rotate(place: Place) -> Matrix3:
    node = place.node
    if constant(place.input("Center")).any():
        raise cannot_follow(node, "turns the map about a shifted centre")
    kind = node.rotation_type
    if kind == "EULER_XYZ":
        matrix = _euler(constant(place.input("Rotation")))
    else:
        axes = {"X_AXIS": (1, 0, 0), "Y_AXIS": (0, 1, 0), "Z_AXIS": (0, 0, 1)}
        axis = axes.get(kind) or tuple(constant(place.input("Axis")))
        angle = float(constant(place.input("Angle"))[0])
        matrix = np.array(Matrix.Rotation(angle, 3, Vector(axis)))
    return matrix.T if node.invert else matrix


def _vector_math(place: Place) -> Matrix3:
    operation = place.node.operation
    if operation == "NORMALIZE":
        return np.eye(3)
    if operation == "SCALE":
        return np.eye(3) * constant(place.input("Scale"))[0]
    if operation == "MULTIPLY":
        return np.diag(constant(place.input(1)))
    raise cannot_follow(place.node, f"does {operation.title()} on the map's directions")


def _euler(angles: NDArray[np.float64]) -> Matrix3:
    return np.array(Euler(tuple(angles), "XYZ").to_matrix(), dtype=np.float64)
