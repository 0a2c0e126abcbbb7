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
    def corners(self) -> NDArray[np.float64]:
        """Of its box, (8, 3), in the scene's axes."""
        matrix = self.matrix
        return self.box @ np.array(matrix.to_3x3()).T + np.array(matrix.translation)

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


def are_flattened(shapes: Iterable[Shape]) -> bool:
    """Whether renders show any of them as a sheet that rays do not meet, or badly: not if nothing
    is left of it."""
    matrices = [np.array(shape.matrix.to_3x3()) for shape in shapes]
    sizes = np.linalg.svd(np.array(matrices).reshape(-1, 3, 3), compute_uv=False)
    return bool(((sizes[:, 1] > LINE * sizes[:, 0]) & (sizes[:, 2] < THIN * sizes[:, 0])).any())


class Crowd:
    """Shapes, sorted by where they are."""

    def __init__(self, shapes: Iterable[Shape]) -> None:
        self.shapes = list(shapes)
        if len(self.shapes) <= FEW:
            return
        corners = np.stack([shape.corners for shape in self.shapes])
        low, high = corners.min(axis=1), corners.max(axis=1)
        margin = WIDER * (np.abs(corners).max(axis=(1, 2)) + 1)[:, None]
        groups = _groups(corners.mean(axis=1))
        self._members = groups
        self._low = [(low - margin)[group] for group in groups]
        self._high = [(high + margin)[group] for group in groups]
        self._lowest = np.stack([box.min(axis=0) for box in self._low])
        self._highest = np.stack([box.max(axis=0) for box in self._high])

    def nearest(self, start: Vector, direction: Vector, distance: float = np.inf) -> Hit | None:
        """What a ray meets first, no farther than a distance; direction: a unit vector."""
        if len(self.shapes) <= FEW:
            return _first((shape.hit(start, direction) for shape in self.shapes), distance)
        found = None
        place = np.array(start)
        slope = np.array(direction, dtype=np.float64)
        slope = 1 / np.where(np.abs(slope) < 1e-20, 1e-20, slope)
        for enters, group in _met(self._lowest, self._highest, place, slope):
            if enters > distance:
                break
            boxes = _met(self._low[group], self._high[group], place, slope)
            members = self._members[group]
            for begins, member in boxes:
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
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    place: NDArray[np.float64],
    slope: NDArray[np.float64],
) -> list[tuple[float, int]]:
    """Boxes that a ray meets, and where it enters them: in that order. slope: one over the ray's
    direction."""
    one, other = (low - place) * slope, (high - place) * slope
    enters = np.minimum(one, other).max(axis=1)
    leaves = np.maximum(one, other).min(axis=1)
    met = np.flatnonzero((enters <= leaves) & (leaves >= 0))
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
        thing = entry.instance_object if entry.is_instance else entry.object
        shown = entry.object
        if shown.type != "MESH" and shown.original.type == "MESH":
            return None
        if shown.type != "MESH" or not (entry.is_instance or entry.show_self):
            continue
        if len(found) >= MOST_SHAPES:
            return None
        mesh = shown.data
        address = mesh.as_pointer()
        if address not in made:
            made[address] = _caster(thing, mesh, graph)
        if made[address] is None:
            continue
        cast, box = made[address]
        parent = (entry.parent.original,) if entry.is_instance and entry.parent else ()
        things = (thing.original, *parent)
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
