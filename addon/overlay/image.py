"""The overlay of the Image editor: region A, cells and suns over the map that was converted."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from numpy.typing import NDArray

from ...core.errors import UnusableInput
from ...core.outlines import Outlines
from ..world import WorldLight, find_light
from .draw import Colour, Drawing, Kept, Lines
from .layers import LETTERS, RING, sun_layers, words
from .marks import MapDiscs, Marks, discs_in_map, marks_in_map
from .suns import ShownSuns, shown_suns
from .view import free_frame, halo_of, is_shown

Floats = NDArray[np.float64]

REGION: Colour = (1.0, 0.25, 0.78, 1.0)
"""As in the preview."""

CELLS: Colour = (0.35, 0.9, 1.0, 0.9)
UNDER: Colour = (0.0, 0.0, 0.0, 0.45)

_borders, _kept = Kept(), Kept()
_discs: list[tuple[object, MapDiscs]] = []


def draw_image() -> None:
    """Blender calls this for each Image editor that it draws on the screen."""
    found = drawings_of(bpy.context)
    if found is None:
        return
    (origin, size), borders, suns = found
    with gpu.matrix.push_pop():
        gpu.matrix.translate((origin[0], origin[1] + size[1]))
        gpu.matrix.scale((size[0], -size[1]))
        borders.draw()
    suns.draw()


def drawings_of(
    context: bpy.types.Context,
) -> tuple[tuple[Floats, Floats], Drawing, Drawing] | None:
    """Where the map is, see `SeenMap`; borders in its u, v, and suns in pixels over it."""
    seen = seen_map(context)
    if seen is None:
        return None
    scale, suns, text = seen.scale, seen.suns, context.scene.sunsplit.outlines
    borders = _borders.drawing(0, (text, scale), lambda: Drawing(border_layers(text, scale)))
    halo, frame = halo_of(context, suns), free_frame(context)

    def drawing() -> Drawing:
        marks = seen.marks()
        labels = words(suns, marks, halo, frame, scale, ranks_only=True)
        return Drawing(sun_layers(suns, marks, halo, scale), labels, LETTERS * scale)

    key = suns.key, seen.key, frame, halo.tobytes()
    region = context.region.as_pointer()
    return (seen.origin, seen.size), borders, _kept.drawing(region, key, drawing)


@dataclass(frozen=True, eq=False)
class SeenMap:
    """Suns over a map in an Image editor.

    to_light: in the map's directions, (n, 3). origin, size: of the rectangle that the map fills,
    pixels: its lower left corner, width and height. scale: of the interface.
    """

    suns: ShownSuns
    to_light: Floats
    origin: Floats
    size: Floats
    scale: float

    @property
    def key(self) -> tuple[object, ...]:
        """Tells apart what would be drawn differently."""
        return (*(one.tobytes() for one in (self.to_light, self.origin, self.size)), self.scale)

    def marks(self) -> Marks:
        discs = _discs_of(self.to_light, self.suns.half_angle)
        return marks_in_map(discs, self.origin, self.size, RING * self.scale)


def seen_map(context: bpy.types.Context) -> SeenMap | None:
    """What the Image editor of a context shows; None where that is no converted map."""
    space = context.space_data
    image = space.image
    if image is None or space.mode == "UV" or not is_shown(context):
        return None
    light = light_shown(context.scene, image)
    if light is None:
        return None
    suns = shown_suns(context)
    to_light = suns.to_light @ light.map_from_world.T
    scale = context.preferences.system.ui_scale
    return SeenMap(suns, to_light, *map_on_screen(context.region), scale)


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
