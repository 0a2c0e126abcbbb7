"""Rays through a scene as it stands: what the camera sees, and from where light reaches that."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.visible import Looks
from .passes import users_layers
from .steps import Steps

PICTURE = 48, 27
"""Rays through a camera's picture that look for the world."""

PLACES = 300
"""Where paths through the picture end that tell what is visible: three looks from each meet most
of it. What is bright and was not met is asked for by itself."""

PATHS = 600
"""So many at most: some pictures show little but the world."""

MOST_PLACES = 10_000
"""If it must be known that something bright reaches none of them."""

BOUNCES = 3
"""So often does a path go on; later ones bring little light."""

LOOKS = 3
"""Rays from every place on a path, of which one goes on."""

MOST_OBJECTS = 500
"""With more, each ray takes too long: it asks every object."""

OFF = 1e-4
"""Where a ray starts, off the surface, as a part of the way that led there."""

FINER = 2
"""Pixels of a map in a picture's finest one, whose filter is narrower than the pixel."""

STEPS = 8
"""So many panes may lie behind each other."""

DEFORMING = {
    *("ARMATURE", "BUILD", "CLOTH", "DYNAMIC_PAINT", "EXPLODE", "FLUID", "MESH_CACHE"),
    *("MESH_SEQUENCE_CACHE", "NODES", "OCEAN", "PARTICLE_SYSTEM", "SOFT_BODY", "WAVE"),
}
"""Modifiers that may move a surface without a key on it."""

SOLID = {"MESH", "EMPTY", "LIGHT", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
"""Objects that rays meet, or renders do not show."""


@dataclass(frozen=True)
class Sight:
    """A scene to cast rays through. see_through: objects that let light through, by name.
    shadowless: those of them that let it through straight."""

    scene: bpy.types.Scene
    graph: bpy.types.Depsgraph
    see_through: frozenset[str]
    shadowless: frozenset[str] = frozenset()

    def camera_sees_world(self) -> bool:
        """Whether any ray through a grid over the picture leaves the scene."""
        camera = self.scene.camera
        near, far = camera.data.clip_start, camera.data.clip_end
        columns, rows = PICTURE
        through = _picture(self.scene)
        for ray in range(columns * rows):
            row, column = divmod(ray, columns)
            direction = through(column / (columns - 1), row / (rows - 1))
            start = camera.matrix_world.translation + direction * near
            hit, _, _, _, thing, _ = self.scene.ray_cast(self.graph, start, direction, distance=far)
            if not hit or thing.hide_render or not thing.visible_camera:
                return True
        return False

    def cast(
        self, start: Vector, direction: Vector, passed: list[Place] | None = None
    ) -> Place | None:
        """The first surface that stops light; None: the world.

        passed: gets both sides of what lets light through on the way.
        """
        for _ in range(STEPS):
            hit, point, normal, _, thing, _ = self.scene.ray_cast(self.graph, start, direction)
            if not hit:
                return None
            if normal.dot(direction) > 0:
                normal = -normal
            away = max(OFF * (point - start).length, 1e-6)
            front = Place(point + normal * away, normal)
            if thing.name not in self.see_through and not thing.hide_render:
                return front
            back = Place(point - normal * away, -normal)
            if passed is not None and not thing.hide_render:
                passed += [front, back]
            start = back.point
        return None

    def is_open(self, start: Vector, direction: Vector) -> bool:
        """Whether light comes straight from a direction."""
        for _ in range(STEPS):
            hit, point, _, _, thing, _ = self.scene.ray_cast(self.graph, start, direction)
            if not hit:
                return True
            if thing.name not in self.shadowless and not thing.hide_render:
                return False
            start = point + direction * max(OFF * (point - start).length, 1e-6)
        return False


@dataclass(frozen=True)
class Place:
    """On a surface that paths from the camera meet, just off it."""

    point: Vector
    normal: Vector


@dataclass(frozen=True)
class Reach:
    """Places that light to the camera comes from, and directions of rays from there to the world,
    in the scene's axes, with the number of the place; met: what others have met. More places are
    found when they are asked for; always the same."""

    sight: Sight
    places: list[Place] = field(default_factory=list)
    escaped: list[Vector] = field(default_factory=list)
    started: list[int] = field(default_factory=list)
    met: list[Place] = field(default_factory=list)
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    @classmethod
    def steps(cls, sight: Sight) -> Steps[Reach]:
        """Paths are followed until enough of the scene is known."""
        found = cls(sight)
        for _ in range(PATHS):
            if len(found.places) >= PLACES:
                break
            found.follow_another()
            yield
        return found

    def looks(self, to_map: NDArray[np.float64], run: Callable[[Steps], Any]) -> Looks:
        """In the axes of a map; to_map: rotation (3, 3) from the scene's. run: runs steps where
        rays may be cast, and returns their result."""
        return Looks(
            np.array(self.escaped, dtype=np.float64).reshape(-1, 3) @ to_map.T,
            LOOKS * len(self.places),
            MOST_PLACES if self.places else 0,
            lambda direction, count: run(self.is_reached(Vector(to_map.T @ direction), count)),
        )

    def is_reached(self, direction: Vector, count: int) -> Steps[bool]:
        """Whether light from a direction comes to any of so many places, or may do."""
        for _ in range(count):  # a path that meets nothing finds no place
            if len(self.places) >= count:
                break
            self.follow_another()
            yield
        if len(self.places) < count:
            return True  # it cannot be told
        for k in np.linspace(0, len(self.places), count, endpoint=False).astype(int):
            place = self.places[k]
            if place.normal.dot(direction) > 0 and self.sight.cast(place.point, direction) is None:
                return True
            yield
        return False

    def follow_another(self) -> None:
        """A path from the camera, through another point of its picture."""
        camera = self.sight.scene.camera
        direction = _through_picture(self.sight.scene, *self.random.random(2))
        start = camera.matrix_world.translation + direction * camera.data.clip_start
        passed: list[Place] = []
        place = self.sight.cast(start, direction, passed)
        for side in passed:
            self._look_around(side)
        for _ in range(BOUNCES):
            if place is None:
                return
            place = self._look_around(place)

    def _look_around(self, place: Place) -> Place | None:
        """Note a place, and the last one that some rays over its surface meet."""
        self.places.append(place)
        last = None
        for x, y, z in self.random.normal(size=(LOOKS, 3)):
            direction = Vector((x, y, z)).normalized()
            if direction.dot(place.normal) < 0:
                direction = -direction
            found = self.sight.cast(place.point, direction)
            if found is None:
                self.escaped.append(direction)
                self.started.append(len(self.places) - 1)
            else:
                self.met.append(found)
            last = found or last
        return last


def stands_still(scene: bpy.types.Scene, shown: Iterable[bpy.types.Object]) -> bool:
    """Whether rays cast now, through what the viewport shows, tell what every frame of a render
    would: with an ordinary camera and nothing that moves or looks otherwise in renders."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        return False
    if any(marker.camera for marker in scene.timeline_markers) or scene.render.use_multiview:
        return False
    if len(users_layers(scene)) > 1:
        return False
    if any(made.hide_render for made in scene.collection.children_recursive):
        return False
    shown = list(shown)
    if any(_is_otherwise_in_renders(thing) for thing in shown):
        return False
    return not any(_moves(thing) for thing in (camera, camera.data, *shown))


def _is_otherwise_in_renders(thing: bpy.types.Object) -> bool:
    """Whether rays through the viewport's scene may meet another shape than a render's."""
    return any(part.show_render != part.show_viewport for part in thing.modifiers)


def _moves(thing: bpy.types.Object | bpy.types.Camera) -> bool:
    made = thing.animation_data
    if made and (made.action or len(made.drivers) or len(made.nla_tracks)):
        return True
    if not isinstance(thing, bpy.types.Object):
        return False
    if any(part.type in DEFORMING for part in thing.modifiers):
        return True
    keys = getattr(thing.data, "shape_keys", None)
    if keys and keys.animation_data:
        return True
    return bool(thing.constraints or thing.rigid_body or (thing.parent and _moves(thing.parent)))


def is_all_met(scene: bpy.types.Scene, shown: Iterable[bpy.types.Object]) -> bool:
    """Whether rays meet every surface that renders show, and soon enough."""
    shown = list(shown)
    return len(shown) <= MOST_OBJECTS and all(
        thing.type in SOLID
        and thing.instance_type == "NONE"
        and (thing.type != "MESH" or thing.visible_get())
        for thing in shown
    )


def _through_picture(scene: bpy.types.Scene, across: float, down: float) -> Vector:
    """The direction through a point of the picture, (0, 0) its upper left, in the scene's axes."""
    return _picture(scene)(across, down)


def _picture(scene: bpy.types.Scene) -> Callable[[float, float], Vector]:
    """The same for many points."""
    camera = scene.camera
    top_right, bottom_right, bottom_left, top_left = camera.data.view_frame(scene=scene)
    turn = camera.matrix_world.to_quaternion()

    def through(across: float, down: float) -> Vector:
        left, right = top_left.lerp(bottom_left, down), top_right.lerp(bottom_right, down)
        return turn @ left.lerp(right, across).normalized()

    return through


def camera_width(scene: bpy.types.Scene) -> int | None:
    """Pixels around the whole sphere that are half as wide as the picture's finest: an ordinary
    camera's at its corners. None where that may change or is of another kind."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        return None
    if any(marker.camera for marker in scene.timeline_markers) or scene.render.use_multiview:
        return None
    if scene.animation_data or camera.data.animation_data:
        return None
    top_right, bottom_right, bottom_left, _ = (
        c / -c.z for c in camera.data.view_frame(scene=scene)
    )
    part = scene.render.resolution_percentage / 100
    wide = (bottom_right - bottom_left).length / (scene.render.resolution_x * part)
    high = (top_right - bottom_right).length / (scene.render.resolution_y * part)
    farthest = max(corner.xy.length for corner in (top_right, bottom_right, bottom_left))
    return int(np.ceil(FINER * 2 * np.pi * (1 + farthest**2) / min(wide, high)))
