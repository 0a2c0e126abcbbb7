"""What moves in a scene, and whether looking at single frames can tell how.

Told is what is moved as a whole: by keys, simple drivers, parents and constraints. Whatever changes
its shape, is simulated, appears or vanishes, or runs a script, is not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain

import bpy

from .changes import PLACE, SHAPE, SHAPELESS, animated_paths, appears, changes_of, is_animated

FROM_ELSEWHERE = {"CAMERA_SOLVER", "FOLLOW_TRACK", "OBJECT_SOLVER"}
"""Constraints that ask for more of a scene than its objects."""

MOVED = re.compile(
    r"(delta_)?(location|rotation_(euler|quaternion|axis_angle)|scale)$|pose\.|constraints\[|\["
)
"""Properties of an object that may be animated: they only move it."""

LENS = re.compile(r"lens$|angle|sensor_|shift_|clip_|dof\.|\[|(display_size|passepartout_alpha)$")
"""Properties of a camera that may be animated."""


def moving(
    scene: bpy.types.Scene, shown: Iterable[bpy.types.Object]
) -> frozenset[bpy.types.Object] | None:
    """Those objects that move: of what is shown and of the scene's cameras. None: single frames
    would not tell how."""
    shown, cameras = list(shown), cameras_of(scene)
    instanced = {thing.instance_collection for thing in shown} - {None}
    members = (made.all_objects for made in instanced)
    if any(appears(thing) for thing in {*scene.objects, *chain.from_iterable(members)}):
        return None
    changed = changes_of({*shown, *cameras})
    if any((thing, SHAPE) in changed for thing in shown if thing.type not in SHAPELESS):
        return None
    found = frozenset(thing for thing in {*shown, *cameras} if (thing, PLACE) in changed)
    if is_still(scene, found):
        return found
    return None if _is_untold(scene, shown, cameras, found) else found


def is_still(scene: bpy.types.Scene, found: frozenset[bpy.types.Object]) -> bool:
    """Whether all frames are the same. found: what moves."""
    cameras = cameras_of(scene)
    return not found and len(cameras) == 1 and not is_animated(cameras[0].data)


def cameras_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """All through which a scene may be rendered, once each."""
    return list(dict.fromkeys([scene.camera, *(made.camera for made in cuts_of(scene))]))


def cuts_of(scene: bpy.types.Scene) -> list[bpy.types.TimelineMarker]:
    """Markers that choose a camera: Blender passes by those of cameras that renders do not
    show."""
    markers = scene.timeline_markers
    return [made for made in markers if made.camera and not made.camera.hide_render]


def _is_untold(
    scene: bpy.types.Scene,
    shown: list[bpy.types.Object],
    cameras: list[bpy.types.Object],
    found: frozenset[bpy.types.Object],
) -> bool:
    """Whether other frames depend on more than where things are."""
    remapped = scene.render.frame_map_old != scene.render.frame_map_new
    if remapped or scene.animation_data or scene.rigidbody_world:
        return True
    if any(camera.type != "CAMERA" or camera.hide_viewport for camera in cameras):
        return True
    things = {*scene.objects, *shown}
    data = {thing.data for thing in things} - {None}
    keys = {getattr(one, "shape_keys", None) for one in data} - {None}
    if any(map(_runs_script, (*things, *data, *keys))):
        return True
    bones = [bone for thing in things if thing.pose for bone in thing.pose.bones]
    if any(part.type in FROM_ELSEWHERE for one in (*things, *bones) for part in one.constraints):
        return True
    if any(not MOVED.match(path) for thing in found for path in animated_paths(thing)):
        return True
    return any(not LENS.match(path) for camera in cameras for path in animated_paths(camera.data))


def _runs_script(owner: bpy.types.ID) -> bool:
    """Whether drivers do, or look at what belongs to the scene that is shown."""
    made = getattr(owner, "animation_data", None)
    if not made:
        return False
    drivers = [curve.driver for curve in made.drivers]
    if any(d.type == "SCRIPTED" and not d.is_simple_expression for d in drivers):
        return True
    return any(
        variable.type == "CONTEXT_PROP"
        or any(not isinstance(target.id, bpy.types.Object) for target in variable.targets)
        for driver in drivers
        for variable in driver.variables
    )
