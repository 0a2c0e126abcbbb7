"""Where things are in other frames, without going there.

Cameras that only keys move are where these say. For all else a scratch scene of its own, with what
moves in it, is evaluated: the user's scene keeps its frame, what was moved and not keyed stays, and
no handler of any add-on hears of it. It is gone before the next step, so neither the window nor
undo ever see it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from .changes import SHAPE, changes_of
from .keyed import KeyedCamera, keyed_camera
from .motion import cuts_of
from .shapes import Key, key_of
from .steps import Steps
from .views import View, is_ordinary, view_of

MOST_FRAMES = 250
"""Frames that are read, evenly spread over the range if there are more, and cuts between cameras
besides."""

MOST_READ = 20_000
"""Places of things in all frames together."""

MOST_THINGS = 4_000
"""More take longer than about a second to be evaluated for the first time."""

MOST_WORK = 60_000
"""In all frames together, in things that move: each takes about ten microseconds a frame."""

BONE, POINT = 0.3, 0.03
"""What a bone, and a point of a mesh that is bent anew in each frame, take of that."""

BEGIN, TOLD_AGAIN = 25, 10
"""What a thing that moves takes when it is evaluated for the first time, and each object of the
user's scene when another scene has come and gone: so many times as much."""

LEAST_AT_ONCE = 10_000
"""A tenth of a second: more moments for the window would not make it livelier."""

AT_A_TIME = 32
"""Frames by keys alone between two moments for the window."""

HANDLERS = (
    "frame_change_pre",
    "frame_change_post",
    "depsgraph_update_pre",
    "depsgraph_update_post",
)


@dataclass(frozen=True, eq=False)
class Reading:
    """One frame. view: its camera's. places: matrices of shapes that move, by `shapes.key_of`."""

    frame: int
    view: View
    places: dict[Key, Matrix]


def read_frames(
    scene: bpy.types.Scene,
    cameras: Iterable[bpy.types.Object],
    moving: Iterable[bpy.types.Object],
) -> Steps[list[Reading] | None]:
    """Frames of a scene's range, first and last among them, and the one that it shows if it is of
    the range; None: that is too much work, or the camera does not stay an ordinary one."""
    cameras = list(cameras)
    things = {*cameras, *moving}
    if len(things) > MOST_THINGS:
        return None
    keyed = [keyed_camera(camera) for camera in cameras]
    if len(things) == len(cameras) and all(keyed):
        return (yield from _by_keys(scene, {one.camera: one for one in keyed}))
    return (yield from _evaluated(scene, things))


def _by_keys(
    scene: bpy.types.Scene, keyed: Mapping[bpy.types.Object, KeyedCamera]
) -> Steps[list[Reading] | None]:
    """Where nothing moves but cameras, each by its own keys."""
    found = []
    first = scene.frame_start
    for number, frame in enumerate([first, *_frames_after_first(scene, 0, len(keyed))]):
        camera = _camera_at(scene, frame)
        matrix = keyed[camera].matrix_at(frame)
        if not is_ordinary(camera) or matrix.determinant() == 0:
            return None
        found.append(Reading(frame, view_of(scene, camera, matrix), {}))
        if number % AT_A_TIME == 0:
            yield
    return sorted(found, key=lambda reading: reading.frame)


def _evaluated(
    scene: bpy.types.Scene, things: set[bpy.types.Object]
) -> Steps[list[Reading] | None]:
    """Whatever moves. The window has a moment whenever as long was read as it takes to begin."""
    found: list[Reading] = []
    frames, work = [scene.frame_start], 0.0
    begin = BEGIN * len(things) + TOLD_AGAIN * len(scene.objects)
    while frames:
        with _scratch(scene, things) as (scratch, graph):
            done = 0.0
            while frames and done <= max(begin, LEAST_AT_ONCE):
                frame = frames.pop(0)
                scratch.frame_current = frame
                graph.update()
                camera = _camera_at(scene, frame).evaluated_get(graph)
                if not is_ordinary(camera):
                    return None
                found.append(Reading(frame, view_of(scene, camera), _places(graph)))
                if len(found) == 1:
                    work = _work(graph) + len(found[0].places)
                    frames = _frames_after_first(scene, len(found[0].places), work)
                    if (1 + len(frames)) * work > MOST_WORK:
                        return None
                done += work
        yield
    return sorted(found, key=lambda reading: reading.frame)


def _places(graph: bpy.types.Depsgraph) -> dict[Key, Matrix]:
    return {
        key_of(entry): entry.matrix_world.copy()
        for entry in graph.object_instances
        if entry.object.type == "MESH" and (entry.is_instance or entry.show_self)
    }


def _work(graph: bpy.types.Depsgraph) -> float:
    """To evaluate another frame, in things that move; by what it is about, as the same scene must
    be told the same on any machine."""
    things = [one for one in graph.ids if isinstance(one, bpy.types.Object)]
    changed = changes_of(thing.original for thing in things)
    bones = sum(len(thing.pose.bones) for thing in things if thing.pose)
    bent = [t for t in things if t.type == "MESH" and (t.original, SHAPE) in changed]
    return len(things) + BONE * bones + POINT * sum(len(thing.data.vertices) for thing in bent)


def _frames_after_first(scene: bpy.types.Scene, things: int, work: float) -> list[int]:
    first, last = scene.frame_start, scene.frame_end
    others = {made.frame - before for made in cuts_of(scene) for before in (0, 1)}
    others = {frame for frame in (*others, scene.frame_current) if first <= frame <= last}
    affordable = min(MOST_READ // max(things, 1), int(MOST_WORK // work) - len(others))
    count = min(last - first + 1, MOST_FRAMES, max(2, affordable))
    spread = {int(frame) for frame in np.linspace(first, last, count).round()}
    return sorted((spread | others) - {first})


def _camera_at(scene: bpy.types.Scene, frame: int) -> bpy.types.Object:
    """The last one that a marker has chosen by then; before the first marker that one's."""
    cuts = cuts_of(scene)
    if not cuts:
        return scene.camera
    past = [made for made in cuts if made.frame <= frame]
    if past:
        return max(past, key=lambda made: made.frame).camera
    return min(cuts, key=lambda made: made.frame).camera


@contextmanager
def _scratch(
    scene: bpy.types.Scene, things: Iterable[bpy.types.Object]
) -> Iterator[tuple[bpy.types.Scene, bpy.types.Depsgraph]]:
    """A scene with some things of another, and what it is evaluated in.

    Its dependency graph is never the active one, so nothing is written back to the things.
    """
    heard = {name: list(getattr(bpy.app.handlers, name)) for name in HANDLERS}
    made = bpy.data.scenes.new("Sunsplit")
    try:
        for name in HANDLERS:
            getattr(bpy.app.handlers, name).clear()
        made.render.fps, made.render.fps_base = scene.render.fps, scene.render.fps_base
        made.frame_set(scene.frame_current)  # while it is empty: this makes the graph
        for thing in things:
            made.collection.objects.link(thing)
        yield made, made.view_layers[0].depsgraph
    finally:
        bpy.data.scenes.remove(made)
        for name, those in heard.items():
            getattr(bpy.app.handlers, name).extend(those)
