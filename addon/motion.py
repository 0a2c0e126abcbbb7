"""What moves in a scene, and whether looking at single frames can tell how.

Told is what is moved as a whole: by keys, simple drivers, parents and constraints. Whatever changes
its shape, is simulated, appears or vanishes, or runs a script, is not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import chain

import bpy

DEFORMING = {
    *("ARMATURE", "BUILD", "CLOTH", "DYNAMIC_PAINT", "EXPLODE", "FLUID", "MESH_CACHE"),
    *("MESH_SEQUENCE_CACHE", "NODES", "OCEAN", "PARTICLE_SYSTEM", "SOFT_BODY", "WAVE"),
}
"""Modifiers that may move a surface without a key on it."""

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
    members = (
        thing.instance_collection.all_objects for thing in shown if thing.instance_collection
    )
    if any(_appears(thing) for thing in {*scene.objects, *chain.from_iterable(members)}):
        return None
    if any(_is_reshaped(thing) for thing in shown):
        return None
    found = frozenset(thing for thing in {*shown, *cameras} if moves(thing))
    if is_still(scene, found):
        return found
    return None if _is_untold(scene, shown, cameras, found) else found


def is_still(scene: bpy.types.Scene, found: frozenset[bpy.types.Object]) -> bool:
    """Whether all frames are the same. found: what moves."""
    cameras = cameras_of(scene)
    return not found and len(cameras) == 1 and not _is_animated(cameras[0].data)


def cameras_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """All through which a scene may be rendered, once each."""
    marked = (made.camera for made in scene.timeline_markers if made.camera)
    return list(dict.fromkeys([scene.camera, *marked]))


def moves(thing: bpy.types.Object) -> bool:
    """Whether an object may be elsewhere in another frame."""
    if _is_animated(thing) or thing.constraints or thing.rigid_body:
        return True
    return bool(thing.parent and (moves(thing.parent) or _is_reshaped(thing.parent)))


def _is_animated(thing: bpy.types.ID | None) -> bool:
    made = getattr(thing, "animation_data", None)
    return bool(made and (made.action or len(made.drivers) or len(made.nla_tracks)))


def _is_reshaped(thing: bpy.types.Object) -> bool:
    """Whether its surface may change in itself, or be made anew for each frame."""
    if any(part.type in DEFORMING for part in thing.modifiers) or len(thing.particle_systems):
        return True
    keys = getattr(thing.data, "shape_keys", None)
    if _is_animated(keys) or (thing.type == "MESH" and _is_animated(thing.data)):
        return True
    # A mirror that moves, or moving past one that does not: either makes another shape.
    others = list(_shaped_by(thing))
    return any(
        _is_animated(other) or (isinstance(other, bpy.types.Object) and moves(other))
        for other in others
    ) or bool(others and moves(thing))


def _shaped_by(thing: bpy.types.Object) -> Iterator[bpy.types.ID]:
    """Objects and textures that an object's modifiers refer to."""
    for part in thing.modifiers:
        for name, kind in part.bl_rna.properties.items():
            if kind.type != "POINTER":
                continue
            value = getattr(part, name)
            if isinstance(value, bpy.types.Collection):
                yield from value.all_objects
            elif isinstance(value, bpy.types.ID):
                yield value


def _appears(thing: bpy.types.Object) -> bool:
    return any(path.startswith("hide") for path in _paths(thing))


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
    things = [*scene.objects, *shown]
    owners = {part: None for thing in things for part in (thing, thing.data) if part}
    if any(_runs_script(owner) for owner in owners):
        return True
    if any(part.type in FROM_ELSEWHERE for thing in things for part in thing.constraints):
        return True
    if any(not MOVED.match(path) for thing in found for path in _paths(thing)):
        return True
    return any(not LENS.match(path) for camera in cameras for path in _paths(camera.data))


def _runs_script(owner: bpy.types.ID) -> bool:
    """Whether drivers do, or look at what belongs to the scene that is shown."""
    made = getattr(owner, "animation_data", None)
    drivers = [curve.driver for curve in made.drivers] if made else []
    if any(d.type == "SCRIPTED" and not d.is_simple_expression for d in drivers):
        return True
    return any(
        variable.type == "CONTEXT_PROP"
        or any(not isinstance(target.id, bpy.types.Object) for target in variable.targets)
        for driver in drivers
        for variable in driver.variables
    )


def _paths(owner: bpy.types.ID) -> Iterator[str]:
    """All properties of something that its keys, drivers and strips change."""
    made = getattr(owner, "animation_data", None)
    if not made:
        return
    yield from (curve.data_path for curve in made.drivers)
    actions = [made.action, *_actions(s for track in made.nla_tracks for s in track.strips)]
    for action in filter(None, actions):
        for layer in action.layers:
            for strip in layer.strips:
                for bag in strip.channelbags:
                    yield from (curve.data_path for curve in bag.fcurves)


def _actions(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.Action | None]:
    for strip in strips:
        yield strip.action
        yield from _actions(strip.strips)
