"""A click on a sun of the overlay selects its lamp."""

from __future__ import annotations

import bpy

from .marks import Marks
from .suns import ShownSuns
from .view import is_shown

REACH = 10.0
"""Pixels at scale 1 that a click may be off a sun's outline or centre."""


def can_pick(context: bpy.types.Context) -> bool:
    """Whether there is a sun to click on, and nothing else that the mouse is for."""
    space = context.space_data
    if space is None or context.mode != "OBJECT" or not is_shown(context):
        return False
    if space.type == "IMAGE_EDITOR":
        return space.mode == "VIEW"
    return space.type == "VIEW_3D" and context.region_data is not None


def selects(context: bpy.types.Context, button: str) -> bool:
    """Whether a mouse button is the one that the user selects with."""
    preferences = context.window_manager.keyconfigs.active.preferences
    chosen = getattr(preferences, "select_mouse", "LEFT")
    return button == f"{chosen}MOUSE"


def pick(context: bpy.types.Context, x: float, y: float, extend: bool) -> bpy.types.Object | None:
    """Select the lamp of the sun at a place in the region, pixels, and make it the active object.

    extend: what is selected stays so, and the active lamp becomes deselected, as Blender does it.
    None, and nothing changed, where there is no sun.
    """
    found = suns_on_screen(context)
    if found is None:
        return None
    suns, marks = found
    number = marks.hit(x, y, REACH * context.preferences.system.ui_scale)
    if number is None:
        return None
    select(context.view_layer, suns.lamps[number], extend)
    return suns.lamps[number]


def select(layer: bpy.types.ViewLayer, lamp: bpy.types.Object, extend: bool) -> None:
    """Select a lamp as Blender selects an object."""
    if extend and lamp.select_get(view_layer=layer) and layer.objects.active == lamp:
        lamp.select_set(False, view_layer=layer)
        return
    if not extend:
        for other in list(layer.objects.selected):
            other.select_set(False, view_layer=layer)
    lamp.select_set(True, view_layer=layer)
    layer.objects.active = lamp


def suns_on_screen(context: bpy.types.Context) -> tuple[ShownSuns, Marks] | None:
    """Suns and where they are in the editor of a context; None where it shows none."""
    if context.space_data.type == "IMAGE_EDITOR":
        from .image import seen_map

        seen = seen_map(context)
        return (seen.suns, seen.marks()) if seen else None
    from .view import seen_suns

    return seen_suns(context)
