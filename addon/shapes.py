"""The shapes that a scene shows, its instances too, and which of them a ray meets first.

`Scene.ray_cast` asks every object, each time. Here a ray asks boxes, then what is in those that it
meets: thousands of shapes cost little more than one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

MOST_SHAPES = 30_000
"""With more, to sort them takes too long."""

MOST_BY_BLENDER = 150
"""As many cost in `Scene.ray_cast` about what boxes cost."""

FEW = 24
"""So many shapes are asked without asking for their boxes: that is sooner done."""

CROWD = 32
"""Boxes that are asked at once: about as many as cost as much as asking at all."""

WIDER = 1e-5
"""Boxes are so much larger than what is in them, as a part of their size and distance: a ray that
grazes a shape meets its box."""

THIN = 1e-5
"""Of what scales one axis by so much less than another, rays in its own axes tell badly."""

LINE = 1e-7
"""The same for two axes: nothing of it is left to be seen."""

Key = tuple[Any, ...]
"""What tells a shape from all others in any of a scene's frames."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface in its place.

    things: the object whose surface it is, and what has made an instance of it. cast: start and
    direction in its own axes; gives whether it is met, point and normal, in these axes as well.
    box: the corners of its box, (8, 3), in its own axes.
    """

    things: tuple[bpy.types.Object, ...]
    cast: Callable[[Vector, Vector], Sequence[Any]]
    matrix: Matrix
    box: NDArray[np.float64]

    def at(self, matrix: Matrix) -> Shape:
        """The same shape, elsewhere."""
        return replace(self, matrix=matrix)

    @cached_property
    def inward(self) -> tuple[Matrix, Matrix] | None:
        """From the scene's axes to its own, of places and of directions; None: it is flattened to
        nothing."""
        try:
            inward = self.matrix.inverted()
        except ValueError:
            return None
        return inward, inward.to_3x3()

    def hit(self, start: Vector, direction: Vector) -> Hit | None:
        """Where a ray meets it first."""
        if self.inward is None:
            return None
        inward, turn = self.inward
        met, point, normal = self.cast(inward @ start, (turn @ direction).normalized())[:3]
        if not met:
            return None
        point = self.matrix @ point
        normal = (turn.transposed() @ normal).normalized()
        return Hit((point - start).dot(direction), point, normal, self.things)


@dataclass(frozen=True, eq=False)
class Hit:
    """A point of a surface, in the scene's axes; distance: along the ray."""

    distance: float
    point: Vector
    normal: Vector
    things: tuple[bpy.types.Object, ...]


def corners_of(shapes: Sequence[Shape]) -> NDArray[np.float64]:
    """Of their boxes, (n, 8, 3), in the scene's axes."""
    matrices = _matrices(shapes)
    boxes = np.array([shape.box for shape in shapes]).reshape(-1, 8, 3)
    return boxes @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]


def _matrices(shapes: Iterable[Shape]) -> NDArray[np.float64]:
    """Of each shape, (n, 4, 4)."""
    return np.array([np.array(shape.matrix) for shape in shapes], np.float64).reshape(-1, 4, 4)


def are_flattened(shapes: Iterable[Shape]) -> bool:
    """Whether renders show any of them as a sheet that rays do not meet, or badly: not if nothing
    is left of it."""
    axes = _matrices(shapes)[:, :3, :3]
    size = np.linalg.norm(axes, axis=1)
    longest = size.max(axis=1, initial=0)
    # Most are about as long along each axis, at right angles: these are soon told.
    askew = axes.transpose(0, 2, 1) @ axes - size[:, None] ** 2 * np.eye(3)
    upright = np.abs(askew).max(axis=(1, 2), initial=0) < 0.01 * longest**2
    even = upright & (size.min(axis=1, initial=np.inf) > 0.5 * longest)
    sizes = np.linalg.svd(axes[~even], compute_uv=False)
    return bool(((sizes[:, 1] > LINE * sizes[:, 0]) & (sizes[:, 2] < THIN * sizes[:, 0])).any())


class Crowd:
    """Shapes, sorted by where they are."""

    def __init__(self, shapes: Iterable[Shape]) -> None:
        self.shapes = list(shapes)
        if len(self.shapes) <= FEW:
            return
        corners = corners_of(self.shapes)
        low, high = corners.min(axis=1), corners.max(axis=1)
        margin = WIDER * (np.abs(corners).max(axis=(1, 2)) + 1)[:, None]
        groups = _groups(corners.mean(axis=1))
        self._members = groups
        boxes = np.stack([(low - margin).T, (high + margin).T])
        self._boxes = [np.ascontiguousarray(boxes[..., group]) for group in groups]
        around = [(some[0].min(axis=1), some[1].max(axis=1)) for some in self._boxes]
        self._around = np.ascontiguousarray(np.moveaxis(around, 0, -1))

    def nearest(self, start: Vector, direction: Vector, distance: float = np.inf) -> Hit | None:
        """What a ray meets first, no farther than a distance; direction: a unit vector."""
        if len(self.shapes) <= FEW:
            return _first((shape.hit(start, direction) for shape in self.shapes), distance)
        found = None
        place = np.array(start, np.float64)[:, None]
        slope = np.array([[1 / (along if abs(along) >= 1e-20 else 1e-20)] for along in direction])
        for enters, group in _met(self._around, place, slope):
            if enters > distance:
                break
            members = self._members[group]
            for begins, member in _met(self._boxes[group], place, slope):
                if begins > distance:
                    break
                hit = self.shapes[members[member]].hit(start, direction)
                if hit and hit.distance <= distance:
                    found, distance = hit, hit.distance
        return found


@dataclass(frozen=True, eq=False)
class WholeScene:
    """All shapes of a scene without instances, asked by Blender."""

    scene: bpy.types.Scene
    graph: bpy.types.Depsgraph
    shapes: tuple[Shape, ...]

    def nearest(self, start: Vector, direction: Vector, distance: float = np.inf) -> Hit | None:
        """See `Crowd.nearest`."""
        limit = {"distance": distance} if np.isfinite(distance) else {}
        met, point, normal, _, thing, _ = self.scene.ray_cast(self.graph, start, direction, **limit)
        return Hit((point - start).length, point, normal, (thing.original,)) if met else None


def whole_scene(
    scene: bpy.types.Scene, graph: bpy.types.Depsgraph, shapes: Sequence[Shape]
) -> WholeScene | None:
    """These shapes of a scene, where Blender tells what a ray meets, and sooner."""
    if len(shapes) > MOST_BY_BLENDER or any(len(shape.things) > 1 for shape in shapes):
        return None
    if bpy.app.version < (5, 0) and not all(_is_even(shape.matrix) for shape in shapes):
        return None  # its normals are wrong there
    return WholeScene(scene, graph, tuple(shapes))


def _is_even(matrix: Matrix) -> bool:
    """Whether it scales alike along all axes."""
    scale = matrix.to_scale()
    return max(scale) - min(scale) <= 1e-4 * max(abs(one) for one in scale)


def _first(hits: Iterable[Hit | None], distance: float) -> Hit | None:
    near = [hit for hit in hits if hit and hit.distance <= distance]
    return min(near, key=lambda hit: hit.distance, default=None)


def _met(
    boxes: NDArray[np.float64], place: NDArray[np.float64], slope: NDArray[np.float64]
) -> list[tuple[float, int]]:
    """Boxes that a ray meets, and where it enters them: in that order. boxes: least and greatest
    coordinates of each, (2, 3, n). place: the ray's start, (3, 1). slope: one over its direction,
    (3, 1)."""
    one, other = (boxes - place) * slope
    enters = np.maximum.reduce(np.minimum(one, other))
    leaves = np.minimum.reduce(np.maximum(one, other))
    met = ((enters <= leaves) & (leaves >= 0)).nonzero()[0]
    if not len(met):
        return []
    return sorted(zip(enters[met].tolist(), met.tolist(), strict=True))


def _groups(centres: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Points that are near to each other: halved where they lie widest until few are left; the
    groups number about as many as are in one."""
    largest = max(CROWD, int(np.sqrt(len(centres))))
    waiting, groups = [np.arange(len(centres))], []
    while waiting:
        group = waiting.pop()
        if len(group) <= largest:
            groups.append(group)
            continue
        axis = np.argmax(np.ptp(centres[group], axis=0))
        order = group[np.argsort(centres[group, axis], kind="stable")]
        waiting += [order[: len(order) // 2], order[len(order) // 2 :]]
    return groups


def shapes_of(graph: bpy.types.Depsgraph) -> dict[Key, Shape] | None:
    """All shapes that a scene shows, as it is evaluated; None: too many to be looked at, or
    geometry nodes make points, curves or volumes, which rays do not meet."""
    found: dict[Key, Shape] = {}
    made: dict[int, tuple[Callable, Matrix] | None] = {}
    for entry in graph.object_instances:
        shown, is_instance = entry.object, entry.is_instance
        if shown.type != "MESH":
            if shown.original.type == "MESH":
                return None
            continue
        if not (is_instance or entry.show_self):
            continue
        if len(found) >= MOST_SHAPES:
            return None
        mesh = shown.data
        address = mesh.as_pointer()
        thing = entry.instance_object if is_instance else shown
        if address not in made:
            made[address] = _caster(thing, mesh, graph)
        if made[address] is None:
            continue
        cast, box = made[address]
        parent = entry.parent if is_instance else None
        things = (thing.original, parent.original) if parent else (thing.original,)
        found[key_of(entry)] = Shape(things, cast, entry.matrix_world.copy(), box)
    return found


def key_of(entry: bpy.types.DepsgraphObjectInstance) -> Key:
    """The same for the same instance in any frame."""
    if not entry.is_instance:
        return (entry.object.original.as_pointer(),)
    parent = entry.parent.original.as_pointer() if entry.parent else 0
    return parent, entry.instance_object.original.as_pointer(), *entry.persistent_id


def _caster(
    thing: bpy.types.Object, mesh: bpy.types.Mesh, graph: bpy.types.Depsgraph
) -> tuple[Callable[[Vector, Vector], Sequence[Any]], NDArray[np.float64]] | None:
    """How to ask a surface, and the corners of its box, (8, 3), in its own axes; None: it has no
    faces."""
    if not len(mesh.polygons):
        return None
    original = thing.original
    if original.type == "MESH" and thing.data == mesh:
        box = np.array([tuple(corner) for corner in thing.bound_box])

        def cast(start: Vector, direction: Vector) -> Sequence[Any]:
            return original.ray_cast(start, direction, depsgraph=graph)

        return cast, box
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    tree = BVHTree.FromPolygons(points.tolist(), corners.reshape(-1, 3).tolist())

    def cast_into(start: Vector, direction: Vector) -> Sequence[Any]:
        point, normal, *_ = tree.ray_cast(start, direction)
        return point is not None, point, normal

    low, high = points.min(axis=0), points.max(axis=0)
    box = np.array([[(low, high)[(k >> axis) & 1][axis] for axis in range(3)] for k in range(8)])
    return cast_into, box.astype(np.float64)
