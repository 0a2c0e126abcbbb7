"""A scene at single frames for rays: as few as show all that the frames between them would."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.visible import NEAR
from .frames import Reading, read_frames
from .motion import cameras_of, is_still, moving
from .shapes import (
    Crowd,
    Hit,
    Key,
    Shape,
    WholeScene,
    are_flattened,
    corners_of,
    shapes_of,
    whole_scene,
)
from .steps import Steps
from .views import View, view_of

PICTURE = 48, 27
"""Rays through a camera's picture that look for the world."""

IN_TURN = 4
"""Frames that share these rays, as those next to each other show nearly the same: each has other
ones."""

AT_A_TIME = 32
"""Rays between two moments for the window."""

COARSE = 12, 7
"""Rays that tell how far away is what a camera shows."""

FEWEST = 5
"""Frames that are looked at where anything moves, if there are so many."""

MOST = 30
"""With more, looking takes too long."""

OWN_SIZE = 0.25
"""So far a thing may move between two of them, as a part of its own size."""

OVERLAP = 0.5
"""Of a picture, at least, is shown by that of the next frame that is looked at, too."""

STEPS = 8
"""So many panes may lie behind each other."""

OFF = 1e-4
"""Where a ray starts, off the surface, as a part of the way that led there."""


@dataclass(frozen=True)
class Place:
    """On a surface that paths from the camera meet, just off it. moment: number of the one in
    which it is there."""

    point: Vector
    normal: Vector
    moment: int = 0


@dataclass(frozen=True)
class Panes:
    """Objects that let light through, by name. straight: those of them that do not bend it."""

    all: frozenset[str] = frozenset()
    straight: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Moment:
    """A scene in one of its frames. number: among those that are looked at. crowds: of what stands
    still, and of what does not. panes: what light passes."""

    number: int
    view: View
    crowds: tuple[Crowd | WholeScene, ...]
    panes: Panes

    def camera_sees_world(self, in_turn: int) -> Steps[bool]:
        """Whether any ray through a grid over the picture leaves the scene. in_turn: moments that
        share the grid."""
        for ray, (start, direction) in enumerate(_rays(self.view, *PICTURE)):
            if (ray + ray // PICTURE[0] + self.number) % in_turn:
                continue
            hit = self._nearest(start, direction, self.view.far)
            if hit is None or any(thing.hide_render for thing in hit.things):
                return True
            if not all(thing.visible_camera for thing in hit.things):
                return True
            if ray % AT_A_TIME < in_turn:
                yield
        return False

    def part_of_picture(self, names: Container[str], alone: bool = False) -> float:
        """How much of it shows things of these names, by few rays; if not alone these, what one may
        see them through counts as well."""
        hits = [self._nearest(*ray, self.view.far) for ray in _rays(self.view, *COARSE)]
        met = [hit.things for hit in hits if hit]
        if alone:
            return sum(any(one.name in names for one in some) for some in met) / len(hits)
        return sum(any(self._may_show(names, one) for one in some) for some in met) / len(hits)

    def _may_show(self, names: Container[str], thing: bpy.types.Object) -> bool:
        return thing.name in names or thing.name in self.panes.all or thing.hide_render

    def pictured(
        self, columns: int, rows: int, in_turn: int
    ) -> Iterator[tuple[Vector, Hit | None]]:
        """Directions of rays through a grid over the picture, and the first surface of each that
        stops light. in_turn: moments that share the grid."""
        for ray, (start, direction) in enumerate(_rays(self.view, columns, rows)):
            if (ray + ray // columns + self.number) % in_turn == 0:
                yield direction, self._stopped(start, direction)

    def _stopped(self, start: Vector, direction: Vector) -> Hit | None:
        for _ in range(STEPS):
            hit = self._nearest(start, direction, self.view.far)
            if hit is None or not any(
                thing.hide_render or thing.name in self.panes.all for thing in hit.things
            ):
                return hit
            start = hit.point + direction * max(OFF * hit.distance, 1e-6)
        return None

    def mirrors_world(self, hit: Hit, direction: Vector, normal: Vector) -> bool:
        """Whether a ray that is mirrored where it meets a surface leaves the scene. normal: on the
        side that it comes from."""
        away = max(OFF * hit.distance, 1e-6)
        mirrored = direction - 2 * direction.dot(normal) * normal
        return self.cast(hit.point + normal * away, mirrored) is None

    def cast(
        self, start: Vector, direction: Vector, passed: list[Place] | None = None
    ) -> Place | None:
        """The first surface that stops light; None: the world.

        passed: gets both sides of what lets light through on the way.
        """
        for _ in range(STEPS):
            hit = self._nearest(start, direction)
            if hit is None:
                return None
            point, normal = hit.point, hit.normal
            if normal.dot(direction) > 0:
                normal = -normal
            away = max(OFF * hit.distance, 1e-6)
            front = Place(point + normal * away, normal, self.number)
            hidden = any(thing.hide_render for thing in hit.things)
            if not hidden and not any(thing.name in self.panes.all for thing in hit.things):
                return front
            back = Place(point - normal * away, -normal, self.number)
            if passed is not None and not hidden:
                passed += [front, back]
            start = back.point
        return None

    def is_open(self, start: Vector, direction: Vector) -> bool:
        """Whether light comes straight from a direction."""
        for _ in range(STEPS):
            hit = self._nearest(start, direction)
            if hit is None:
                return True
            if not any(t.name in self.panes.straight or t.hide_render for t in hit.things):
                return False
            start = hit.point + direction * max(OFF * hit.distance, 1e-6)
        return False

    def _nearest(self, start: Vector, direction: Vector, distance: float = np.inf) -> Hit | None:
        found = None
        for crowd in self.crowds:
            hit = crowd.nearest(start, direction, distance)
            if hit:
                found, distance = hit, hit.distance
        return found


@dataclass(frozen=True, eq=False)
class Sight:
    """A scene to cast rays through. views: of its camera in all frames that were read. frames:
    first and last of the range, where anything moves. shapes: all that rays meet."""

    moments: tuple[Moment, ...]
    views: tuple[View, ...]
    shapes: tuple[Shape, ...]
    frames: tuple[int, int] | None = None

    @property
    def stands_still(self) -> bool:
        """Whether nothing but the camera moves."""
        return not any(crowd.shapes for moment in self.moments for crowd in moment.crowds[1:])

    def camera_sees_world(self) -> Steps[bool]:
        """Whether it does in any frame that is looked at."""
        in_turn = IN_TURN if len(self.moments) > IN_TURN else 1
        for moment in self.moments:
            if (yield from moment.camera_sees_world(in_turn)):
                return True
        return False

    def part_of_picture(self, names: Container[str], alone: bool = False) -> Steps[float]:
        """How much of it shows things of these names, at most in any frame that is looked at; see
        `Moment.part_of_picture`."""
        parts = [0.0]
        for moment in self.moments:
            parts.append(moment.part_of_picture(names, alone))
            yield
        return max(parts)


def sight_of(
    scene: bpy.types.Scene, shown: Iterable[bpy.types.Object], panes: Panes
) -> Steps[Sight | None]:
    """An ordinary scene for rays; None: looking at a few frames does not tell what all show."""
    shown = list(shown)
    moved = moving(scene, shown)
    graph = bpy.context.evaluated_depsgraph_get()
    if moved is None or graph.scene != scene:
        return None
    shapes = shapes_of(graph)
    if shapes is None:
        return None
    if is_still(scene, moved):
        view = view_of(scene, cameras_of(scene)[0])
        everything = tuple(shapes.values())
        whole = whole_scene(scene, graph, everything) or Crowd(everything)
        return Sight((Moment(0, view, (whole,), panes),), (view,), everything)
    yield
    return (yield from _sight_in_motion(scene, shapes, moved, panes))


def _sight_in_motion(
    scene: bpy.types.Scene,
    shapes: Mapping[Key, Shape],
    moved: frozenset[bpy.types.Object],
    panes: Panes,
) -> Steps[Sight | None]:
    movers = _movers(scene, shapes, moved)
    makers = {thing for shape in movers.values() for thing in shape.things}
    readings = yield from read_frames(scene, cameras_of(scene), makers)
    if readings is None or any(not movers.keys() <= one.places.keys() for one in readings):
        return None
    still = Crowd(shape for key, shape in shapes.items() if key not in movers)
    choice = _Choice(readings, movers, still)
    chosen = yield from choice.frames()
    if chosen is None:
        return None
    moments = []
    for number, k in enumerate(chosen):
        moments.append(Moment(number, readings[k].view, (still, choice.crowd(k)), panes))
        yield
    if are_flattened(shape for moment in moments for shape in moment.crowds[1].shapes):
        return None
    views = tuple(reading.view for reading in readings)
    frames = scene.frame_start, scene.frame_end
    return Sight(tuple(moments), views, tuple(shapes.values()), frames)


def _movers(
    scene: bpy.types.Scene, shapes: Mapping[Key, Shape], moved: frozenset[bpy.types.Object]
) -> dict[Key, Shape]:
    """Shapes that may be elsewhere in other frames: all instances, where what makes them moves."""
    own = set(scene.objects)
    all_instances = any(thing.instance_type != "NONE" or thing not in own for thing in moved)
    return {
        key: shape
        for key, shape in shapes.items()
        if not moved.isdisjoint(shape.things) or (all_instances and len(shape.things) > 1)
    }


@dataclass(frozen=True, eq=False)
class _Choice:
    """Which of the frames that were read are looked at."""

    readings: Sequence[Reading]
    movers: Mapping[Key, Shape]
    still: Crowd

    def frames(self) -> Steps[list[int] | None]:
        """Their numbers; None: too many, or what moves is too quick for those that were read."""
        last = len(self.readings) - 1
        stride = -(-last // (FEWEST - 1))
        chosen = [0]
        while chosen[-1] < last:
            begin = chosen[-1]
            near = self._near(begin)
            end = begin + 1
            if not near(end):
                if self.readings[end].frame - self.readings[begin].frame > 1:
                    return None
            else:
                while end < min(last, begin + stride) and near(end + 1):
                    end += 1
            chosen.append(end)
            if len(chosen) > MOST:
                return None
            yield
        return chosen

    def crowd(self, number: int) -> Crowd:
        """What moves, where it is in a frame."""
        places = self.readings[number].places
        return Crowd(shape.at(places[key]) for key, shape in self.movers.items())

    def _near(self, begin: int) -> Any:  # noqa: ANN401 - a function of a frame's number
        """Whether another frame shows nearly what this one does."""
        view, crowd = self.readings[begin].view, self.crowd(begin)
        from_here = _corners(crowd)
        size = np.linalg.norm(np.ptp(from_here, axis=1), axis=-1)[:, None]
        away = np.linalg.norm(from_here - np.array(view.place), axis=-1)
        allowed = np.minimum(OWN_SIZE * size, np.tan(NEAR) * away)
        travel = np.tan(NEAR) * _depth(view, (self.still, crowd))
        turn = max(NEAR, (1 - OVERLAP) * _narrowest(view))

        def near(number: int) -> bool:
            other = self.readings[number].view
            if (other.place - view.place).length > travel or _turned(view, other) > turn:
                return False
            moved = np.linalg.norm(_corners(self.crowd(number)) - from_here, axis=-1)
            return bool((moved <= allowed).all())

        return near


def _corners(crowd: Crowd) -> NDArray[np.float64]:
    """Of the boxes of shapes, (n, 8, 3)."""
    return corners_of(crowd.shapes)


def _depth(view: View, crowds: Iterable[Crowd]) -> float:
    """How far away half of what a camera shows is, at least; endless where that is the world."""
    moment = Moment(0, view, tuple(crowds), Panes())
    hits = [moment._nearest(*ray) for ray in _rays(view, *COARSE)]
    return float(np.median([hit.distance if hit else np.inf for hit in hits]))


def _turned(one: View, other: View) -> float:
    """How far the picture's corners turn, at most, in radians."""
    return max(
        (one.turn @ here).angle(other.turn @ there)
        for here, there in zip(one.corners, other.corners, strict=True)
    )


def _narrowest(view: View) -> float:
    """Across a picture, or down, whichever is less, in radians."""
    top_right, bottom_right, _, top_left = view.corners
    return min(top_right.angle(top_left), top_right.angle(bottom_right))


def _rays(view: View, columns: int, rows: int) -> Iterable[tuple[Vector, Vector]]:
    for ray in range(columns * rows):
        row, column = divmod(ray, columns)
        yield view.ray(column / (columns - 1), row / (rows - 1))
