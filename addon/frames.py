"""Where things are in other frames, without going there.

A scratch scene of its own, with what moves in it, is evaluated instead: the user's scene keeps its
frame, what was moved and not keyed stays, and no handler of any add-on hears of it. It is gone
before the next step, so neither the window nor undo ever see it.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from .shapes import Key, key_of
from .views import View, view_of

MOST_FRAMES = 250
"""Frames that are read, evenly spread over the range if there are more, and cuts between cameras
besides."""

MOST_READ = 20_000
"""Places of things in all frames together."""

PATIENCE = 1.0
"""Seconds for all frames: what takes longer to evaluate is not told."""

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
) -> list[Reading] | None:
    """Frames of a scene's range, first and last among them, and the one that it shows; None: that
    takes too long."""
    found: list[Reading] = []
    until = time.perf_counter() + PATIENCE
    with _scratch(scene, {*cameras, *moving}) as (scratch, graph):
        frames = [scene.frame_start]
        while frames:
            frame = frames.pop(0)
            scratch.frame_current = frame
            graph.update()
            found.append(_read(scene, frame, graph))
            if len(found) == 1:
                frames = _frames_after_first(scene, len(found[0].places))
            if time.perf_counter() > until:
                return None
    return sorted(found, key=lambda reading: reading.frame)


def _read(scene: bpy.types.Scene, frame: int, graph: bpy.types.Depsgraph) -> Reading:
    places = {
        key_of(entry): entry.matrix_world.copy()
        for entry in graph.object_instances
        if entry.object.type == "MESH" and (entry.is_instance or entry.show_self)
    }
    camera = _camera_at(scene, frame).evaluated_get(graph)
    return Reading(frame, view_of(scene, camera), places)


def _frames_after_first(scene: bpy.types.Scene, things: int) -> list[int]:
    first, last = scene.frame_start, scene.frame_end
    count = min(last - first + 1, MOST_FRAMES, max(2, MOST_READ // max(things, 1)))
    spread = {int(frame) for frame in np.linspace(first, last, count).round()}
    cuts = {made.frame - before for made in scene.timeline_markers for before in (0, 1)}
    spread |= {frame for frame in cuts if first <= frame <= last}
    return sorted((spread | {scene.frame_current}) - {first})


def _camera_at(scene: bpy.types.Scene, frame: int) -> bpy.types.Object:
    """The last one that a marker has chosen by then; before the first marker that one's."""
    marked = [made for made in scene.timeline_markers if made.camera]
    if not marked:
        return scene.camera
    past = [made for made in marked if made.frame <= frame]
    if past:
        return max(past, key=lambda made: made.frame).camera
    return min(marked, key=lambda made: made.frame).camera


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
