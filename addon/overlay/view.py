"""The overlay of the 3D view: suns on the sky, and where their light comes from."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from .draw import Drawing, Kept, Lines
from .layers import LETTERS, RING, arrow_layers, ray_layers, sun_layers, words
from .marks import Marks, circles, marks_in_view
from .screen import Frame, View, globe, ray_in_view
from .suns import ShownSuns, lit_place, shown_suns

Floats = NDArray[np.float64]

_kept = Kept()
_rims: list[tuple[object, Floats]] = []


def draw_view() -> None:
    """Blender calls this for each 3D view that it draws on the screen; renders have no overlay."""
    drawing = drawing_of(bpy.context)
    if drawing is not None:
        drawing.draw()


def drawing_of(context: bpy.types.Context) -> Drawing | None:
    """What the 3D view of a context has over it."""
    if not is_shown(context):
        return None
    suns = shown_suns(context)
    if not len(suns):
        return None
    view, pivot = view_of(context), lit_place(context, suns)
    halo, scale = halo_of(context, suns), context.preferences.system.ui_scale
    key = (suns.key, view.matrix.tobytes(), view.frame, pivot.tobytes(), halo.tobytes(), scale)
    region = context.region.as_pointer()
    return _kept.drawing(region, key, lambda: _drawing(suns, view, pivot, halo, scale))


def is_shown(context: bpy.types.Context) -> bool:
    """Whether an editor shows the overlay: a converted scene, and nothing switched off."""
    state = context.scene.sunsplit
    if not state.show_overlay or not len(state.lamps):
        return False
    return context.space_data.overlay.show_overlays


def seen_suns(context: bpy.types.Context) -> tuple[ShownSuns, Marks]:
    """Suns and where they are in the 3D view of a context."""
    suns = shown_suns(context)
    return suns, _marks(suns, view_of(context), context.preferences.system.ui_scale)


def view_of(context: bpy.types.Context) -> View:
    region, data = context.region, context.region_data
    matrix = np.array(data.perspective_matrix, np.float64)
    # A camera may be orthographic while the view says that it is a camera's.
    perspective = bool(np.any(np.array(data.window_matrix)[3, :3]))
    return View(matrix, region.width, region.height, free_frame(context), perspective)


def free_frame(context: bpy.types.Context) -> Frame:
    """The part of a region that sidebar, toolbar and header do not cover."""
    region = context.region
    left, bottom, right, top = 0, 0, region.width, region.height
    for other in context.area.regions:
        if other.type not in {"UI", "TOOLS", "HEADER", "TOOL_HEADER"}:
            continue
        x, y = other.x - region.x, other.y - region.y
        if other.width <= 1 or other.height <= 1 or not (0 <= x < right and 0 <= y < top):
            continue  # folded, or beside and not over it
        if other.alignment == "LEFT":
            left = max(left, x + other.width)
        elif other.alignment == "RIGHT":
            right = min(right, x)
        elif other.alignment == "TOP":
            top = min(top, y)
        elif other.alignment == "BOTTOM":
            bottom = max(bottom, y + other.height)
    return Frame(left, bottom, right, top)


def halo_of(context: bpy.types.Context, suns: ShownSuns) -> Floats:
    """Colours of the theme around what is selected, and the active one's, (n, 4)."""
    theme = context.preferences.themes[0].view_3d
    halo = np.ones((len(suns), 4))
    halo[:, :3] = theme.object_selected
    if suns.active is not None:
        halo[suns.active, :3] = theme.object_active
    return halo


def forget() -> None:
    """Free what the graphics card holds."""
    _kept.forget()
    _rims.clear()


def _marks(suns: ShownSuns, view: View, scale: float) -> Marks:
    return marks_in_view(suns.to_light, _rims_of(suns), view, RING * scale)


def _rims_of(suns: ShownSuns) -> Floats:
    """They stay the same while only the view turns."""
    key = suns.to_light.tobytes(), suns.half_angle.tobytes()
    if not _rims or _rims[0][0] != key:
        _rims[:] = [(key, circles(suns.to_light, suns.half_angle))]
    return _rims[0][1]


def _drawing(suns: ShownSuns, view: View, pivot: Floats, halo: Floats, scale: float) -> Drawing:
    marks = _marks(suns, view, scale)
    layers = []
    if not view.perspective:
        layers += _globe_layers(view, scale)
    layers += ray_layers(_rays(suns, marks, view, pivot), suns, scale)
    layers += sun_layers(suns, marks, halo, scale)
    layers += arrow_layers(suns, marks, view.frame, halo, scale)
    return Drawing(layers, words(suns, marks, halo, view.frame, scale, False), LETTERS * scale)


def _rays(suns: ShownSuns, marks: Marks, view: View, pivot: Floats) -> list[tuple[int, Floats]]:
    found = []
    for number in suns.pointed_at:
        if view.perspective:
            ray = ray_in_view(pivot, suns.to_light[number], view, 100)
        else:
            ray = np.array([globe(view)[0], marks.place[number]])
        if ray is not None:
            found.append((number, ray))
    return found


def _globe_layers(view: View, scale: float) -> list[Lines]:
    centre, radius = globe(view)
    turn = np.linspace(0, 2 * np.pi, 97)
    points = centre + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    return [Lines(pieces, (0, 0, 0, 0.3), 3 * scale), Lines(pieces, (1, 1, 1, 0.5), scale)]
