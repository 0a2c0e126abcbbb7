"""The overlay: suns where they are, in the 3D view and over the map; a click selects a lamp.

Enabling the add-on adds two handlers and some keys; all else is loaded when a converted scene is
shown. Blender calls handlers for what is on the screen, never for renders, of the viewport neither.
"""

from __future__ import annotations

import sys
from typing import Any

import bpy

_handlers: list[tuple[Any, Any]] = []
_keys: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []

KEYS = (
    ("3D View", "VIEW_3D", False, "LEFTMOUSE", "CLICK"),
    ("3D View", "VIEW_3D", False, "RIGHTMOUSE", "PRESS"),
    ("3D View Tool: Tweak", "VIEW_3D", True, "LEFTMOUSE", "PRESS"),
    ("Image", "IMAGE_EDITOR", False, "LEFTMOUSE", "CLICK"),
    ("Image", "IMAGE_EDITOR", False, "RIGHTMOUSE", "PRESS"),
    ("Image Editor Tool: Sample", "IMAGE_EDITOR", True, "LEFTMOUSE", "PRESS"),
)
"""Key map, its space, whether it is a tool's, mouse button and what it does: as Blender selects.
Tools that do something on PRESS come before the rest."""


class SUNSPLIT_OT_pick_sun(bpy.types.Operator):
    """Select the lamp of the sun under the mouse"""

    bl_idname = "sunsplit.pick_sun"
    bl_label = "Select Sun"
    bl_options = {"UNDO", "INTERNAL"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        from .pick import can_pick

        return can_pick(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from .pick import pick, selects

        if not selects(context, event.type):
            return {"PASS_THROUGH"}
        extend = event.shift or event.ctrl
        lamp = pick(context, event.mouse_region_x, event.mouse_region_y, extend)
        return {"FINISHED"} if lamp else {"PASS_THROUGH"}


def draw_switch(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """A row for a panel: the overlay on and off."""
    layout.prop(context.scene.sunsplit, "show_overlay")


def register() -> None:
    view, image = bpy.types.SpaceView3D, bpy.types.SpaceImageEditor
    for space, draw in ((view, _draw_view), (image, _draw_image)):
        _handlers.append((space, space.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL")))
    addon_keys = bpy.context.window_manager.keyconfigs.addon
    if addon_keys is None:  # in background mode
        return
    for name, space, tool, button, value in KEYS:
        keymap = addon_keys.keymaps.new(name, space_type=space, region_type="WINDOW", tool=tool)
        # With any of Shift and Ctrl.
        item = keymap.keymap_items.new("sunsplit.pick_sun", button, value, shift=-1, ctrl=-1)
        _keys.append((keymap, item))


def unregister() -> None:
    for space, handler in _handlers:
        space.draw_handler_remove(handler, "WINDOW")
    for keymap, item in _keys:
        keymap.keymap_items.remove(item)
    _handlers.clear()
    _keys.clear()
    for name in ("view", "image"):
        used = sys.modules.get(f"{__name__}.{name}")
        if used is not None:
            used.forget()


def _draw_view() -> None:
    if bpy.context.scene.sunsplit.is_converted:
        from .view import draw_view

        draw_view()


def _draw_image() -> None:
    if bpy.context.scene.sunsplit.is_converted:
        from .image import draw_image

        draw_image()
