"""The suns of a scene as the overlay shows them: what its lamps are now."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST_BRIGHT = 0.25
"""Of a colour on the screen, how bright its brightest channel's companions are at least: a pure
blue could not be seen on a dark sky."""


@dataclass(frozen=True, eq=False)
class ShownSuns:
    """Lamps that shine in a view layer, the brightest first.

    to_light: in world axes, (n, 3). half_angle: radians, (n,). colour: sRGB, (n, 3). rank: in the
    conversion, from 1. selected, active: as Blender marks them.
    """

    lamps: tuple[bpy.types.Object, ...]
    to_light: Floats
    half_angle: Floats
    colour: Floats
    rank: tuple[int, ...]
    selected: NDArray[np.bool_]
    active: int | None

    def __len__(self) -> int:
        return len(self.lamps)

    @property
    def key(self) -> tuple[object, ...]:
        """Tells apart what would be drawn differently."""
        names = tuple(lamp.name for lamp in self.lamps)
        arrays = (self.to_light, self.half_angle, self.colour, self.selected)
        return (*(array.tobytes() for array in arrays), self.rank, self.active, names)

    @property
    def pointed_at(self) -> list[int]:
        """Those whose way to the scene is shown: the selected ones, or else the brightest."""
        chosen = np.flatnonzero(self.selected).tolist()
        return chosen or [0][: len(self)]


def shown_suns(context: bpy.types.Context) -> ShownSuns:
    """The lamps of the scene's conversion that can be seen; none without a conversion."""
    layer, space = context.view_layer, context.space_data
    # In a local view only what belongs to it is there.
    view = space if space is not None and space.type == "VIEW_3D" else None
    lamps, rank, values, selected = [], [], [], []
    for number, entry in enumerate(context.scene.sunsplit.lamps, start=1):
        lamp = entry.lamp
        if lamp is None or lamp.type != "LIGHT":  # the user has removed it, or changed it
            continue
        if not lamp.visible_get(view_layer=layer, viewport=view):
            continue
        data = lamp.data
        lamps.append(lamp)
        rank.append(number)
        values.append((*lamp.matrix_world.col[2].xyz, getattr(data, "angle", 0.0), *data.color))
        selected.append(lamp.select_get(view_layer=layer))
    numbers = np.array(values, np.float64).reshape(-1, 7)
    length = np.linalg.norm(numbers[:, :3], axis=1, keepdims=True)
    active = layer.objects.active
    return ShownSuns(
        tuple(lamps),
        numbers[:, :3] / np.maximum(length, 1e-300),
        numbers[:, 3] / 2,
        on_screen(numbers[:, 4:]),
        tuple(rank),
        np.array(selected, bool),
        lamps.index(active) if active in lamps else None,
    )


def on_screen(colour: Floats) -> Floats:
    """Linear colours, (n, 3), as sRGB at full brightness that can be seen on any sky."""
    brightest = colour.max(axis=1, keepdims=True, initial=0)
    linear = np.where(brightest > 0, colour / np.maximum(brightest, 1e-300), 1.0)
    high = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    shown = np.where(linear <= 0.0031308, 12.92 * linear, high)
    return LEAST_BRIGHT + (1 - LEAST_BRIGHT) * shown


def label_of(lamp: bpy.types.Object, rank: int, full: bool) -> str:
    """What stands beside a sun."""
    return lamp.name if full else str(rank)


def lit_place(context: bpy.types.Context, suns: ShownSuns) -> Floats:
    """Where the light is looked at, (3,): the middle of what is selected besides suns, or else the
    3D cursor."""
    places = [
        thing.matrix_world.translation
        for thing in context.view_layer.objects.selected
        if thing not in suns.lamps
    ]
    if not places:
        return np.array(context.scene.cursor.location, np.float64)
    return np.array(places, np.float64).mean(axis=0)
