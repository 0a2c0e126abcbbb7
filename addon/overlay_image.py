"""The overlay of the Image editor: region A, cells and suns over the map that was converted."""

from __future__ import annotations

import bpy
import gpu
import numpy as np
from numpy.typing import NDArray

from ..core.errors import UnusableInput
from ..core.outlines import Outlines
from .overlay_draw import Colour, Drawing, Kept, Lines
from .overlay_layers import LETTERS, RING, sun_layers, words
from .overlay_marks import MapDiscs, Marks, discs_in_map, marks_in_map
from .overlay_suns import ShownSuns, shown_suns
from .overlay_view import free_frame, halo_of, is_shown
from .world import WorldLight, find_light

Floats = NDArray[np.float64]

REGION: Colour = (1.0, 0.25, 0.78, 1.0)
"""As in the preview."""

CELLS: Colour = (0.35, 0.9, 1.0, 0.9)
UNDER: Colour = (0.0, 0.0, 0.0, 0.45)

_borders, _kept = Kept(), Kept()
_discs: list[tuple[object, MapDiscs]] = []


def draw_image() -> None:
    """Blender calls this for each Image editor that it draws on the screen."""
    context = bpy.context
    found = seen_map(context)
    if found is None:
        return
    suns, marks, (origin, size) = found
    region, scale = context.region.as_pointer(), context.preferences.system.ui_scale
    text = context.scene.sunsplit.outlines
    with gpu.matrix.push_pop():
        gpu.matrix.translate((origin[0], origin[1] + size[1]))
        gpu.matrix.scale((size[0], -size[1]))
        _borders.draw(0, (text, scale), lambda: Drawing(border_layers(text, scale)))
    halo, frame = halo_of(context, suns), free_frame(context)

    def drawing() -> Drawing:
        labels = words(suns, marks, halo, frame, scale, ranks_only=True)
        return Drawing(sun_layers(suns, marks, halo, scale), labels, LETTERS * scale)

    _kept.draw(region, (suns.key, marks.key, frame, halo.tobytes(), scale), drawing)


def seen_map(
    context: bpy.types.Context,
) -> tuple[ShownSuns, Marks, tuple[Floats, Floats]] | None:
    """Suns, where they are in the Image editor of a context, and the rectangle that the map fills:
    lower left corner and size in pixels. None where it shows something else."""
    space = context.space_data
    image = space.image
    if image is None or space.mode == "UV" or not is_shown(context):
        return None
    light = light_shown(context.scene, image)
    if light is None:
        return None
    suns = shown_suns(context)
    origin, size = map_on_screen(context.region)
    discs = _discs_of(suns.to_light @ light.map_from_world.T, suns.half_angle)
    least = RING * context.preferences.system.ui_scale
    return suns, marks_in_map(discs, origin, size, least), (origin, size)


def light_shown(scene: bpy.types.Scene, image: bpy.types.Image) -> WorldLight | None:
    """The light of a converted scene, if an image is its map or has been made from it."""
    world = scene.sunsplit.converted_world
    if world is None:
        return None
    try:
        light = find_light(world, scene.render.engine)
    except UnusableInput:  # the user has changed the world meanwhile
        return None
    nodes = light.texture.node.id_data.nodes
    shown = any(node.type == "TEX_ENVIRONMENT" and node.image == image for node in nodes)
    return light if shown else None


def map_on_screen(region: bpy.types.Region) -> tuple[Floats, Floats]:
    """Lower left corner and size, in pixels, of the image that an Image editor's region shows."""
    # The other way round Blender rounds to whole pixels.
    low = np.array(region.view2d.region_to_view(0, 0), np.float64)
    high = np.array(region.view2d.region_to_view(region.width, region.height), np.float64)
    size = (region.width, region.height) / (high - low)
    return -low * size, size


def forget() -> None:
    """Free what the graphics card holds."""
    _borders.forget()
    _discs.clear()
    _kept.forget()


def _discs_of(to_light: Floats, half_angle: Floats) -> MapDiscs:
    """They stay the same while the map is moved and zoomed."""
    key = to_light.tobytes(), half_angle.tobytes()
    if not _discs or _discs[0][0] != key:
        _discs[:] = [(key, discs_in_map(to_light, half_angle))]
    return _discs[0][1]


def border_layers(text: str, scale: float) -> list[Lines]:
    """Lines of outlines as text; none where there are no such outlines."""
    try:
        outlines = Outlines.from_text(text)
    except ValueError:
        return []
    region, cells = outlines.region_lines(), outlines.cell_lines()
    return [
        Lines(region, UNDER, 3.0 * scale),
        Lines(cells, UNDER, 3.0 * scale),
        Lines(region, REGION, 1.5 * scale),
        Lines(cells, CELLS, 1.5 * scale),
    ]
