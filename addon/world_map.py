"""The map that lights a scene as its world is now, converted or not: what an export writes."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.environment import whole_part
from ..core.errors import UnusableInput
from ..core.export.skylight import WIDEST
from ..core.reduction import narrowed
from .images import folder_for_maps, unrepaired_pixels
from .trace import plain_light
from .world import WorldLight, light_now

Floats = NDArray[np.float64]

PLAIN = 32
"""Pixels of the width of a map that is the same in all directions."""

MIRROR = np.diag([1.0, -1.0, 1.0])
"""What directions become when a map's columns are turned round."""


@dataclass(frozen=True, eq=False)
class WorldMap:
    """radiance: as the scene gets it, strength and tints in it, float32 (height, width, 3) in the
    layout of `sphere`. has_cells: nothing is to be blended between its pixels. turn: rotation,
    (3, 3), from directions in the map to directions in the scene."""

    radiance: NDArray[np.float32]
    has_cells: bool
    turn: Floats


def map_of_world(world: bpy.types.World, engine: str) -> WorldMap | None:
    """What a world sends to all rays but the camera's; None where that is nothing.

    engine: of the scene. Raises UnusableInput, CannotWrite.
    """
    light, plain = light_now(world, engine), plain_light(world, engine)
    if (plain < 0).any():
        raise UnusableInput("The world's light is negative: there is no such light.")
    if light is None:
        if not plain.any():
            return None
        radiance = np.broadcast_to(plain, (PLAIN // 2, PLAIN, 3)).astype(np.float32)
        return WorldMap(radiance, False, np.eye(3))
    radiance = _radiance(light.image)
    # In place and in single precision: of a map 8192 wide each copy takes 400 MB.
    radiance *= light.gain.astype(np.float32)
    radiance += plain.astype(np.float32)
    return _turned(radiance, light)


def _radiance(image: bpy.types.Image) -> NDArray[np.float32]:
    with folder_for_maps() as folder:
        pixels = unrepaired_pixels(image, folder)
        if pixels.width != 2 * pixels.height:
            raise UnusableInput(
                f'"{image.name}" is {pixels.width} x {pixels.height}, not 2:1: '
                "use an equirectangular map."
            )
        radiance = narrowed(pixels, whole_part(pixels.width, WIDEST))
    if not (np.isfinite(radiance).all() and (radiance >= 0).all()):
        raise UnusableInput(
            f'"{image.name}" holds what is no light, below 0 or without end: convert the world, '
            "which repairs it."
        )
    return radiance


def _turned(radiance: NDArray[np.float32], light: WorldLight) -> WorldMap:
    """A map whose mapping is a rotation: of a mirrored one the pixels are turned round."""
    turn = light.map_from_world.T
    if np.linalg.det(turn) < 0:
        radiance, turn = np.ascontiguousarray(radiance[:, ::-1]), turn @ MIRROR
    return WorldMap(radiance, light.texture.node.interpolation == "Closest", turn)
