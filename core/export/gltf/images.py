"""`EXT_lights_image_based`: a map as nine harmonics of its irradiance, and as a cube of pictures
whose levels are what rougher and rougher surfaces mirror.

As Babylon.js reads it, whose makers wrote the extension: where its text leaves something open, or
Babylon.js does otherwise, this follows Babylon.js.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...environment import whole_part
from ...pixels import HeldPixels
from ...reduction import narrowed
from ..axes import Axes
from ..emitters import Emitters
from ..lookup import look_up, narrower
from .cube import averaged, cube_directions
from .document import Document, data_uri
from .glossy import blurred
from .harmonics import irradiance_harmonics
from .rgbd import HIGHEST, packed, png

Floats = NDArray[np.float64]

EXTENSION = "EXT_lights_image_based"

SIDES = (256, 128, 64, 32, 16)
"""Pixels of the faces of each level; the extension's text proposes to stop at 16."""

WIDEST = 1024
"""Pixels of the width of the map that a cube of such faces is made of: its own are no smaller."""

TO_CUBE = np.diag([-1.0, 1.0, 1.0])
"""From glTF's axes to those of the cube and of the harmonics. Babylon.js is left-handed and mirrors
in X what it loads; a cube it takes as it is. (Its right-handed scenes have the same cube half a
turn about Y from there.)"""

DIM = 0.02
"""A mean that 8 bits say less well than one nearer to 1."""


@dataclass(frozen=True, eq=False)
class ImageBasedLight:
    """intensity: what coefficients and pictures are to be multiplied by. coefficients: (9, 3).
    pictures: of each level and its faces, PNG files."""

    intensity: float
    coefficients: Floats
    pictures: tuple[tuple[bytes, ...], ...]


def image_based_light(emitters: Emitters, axes: Axes, lux: float) -> ImageBasedLight | None:
    """The map of a sky, turned as the sky is, or None where there is none."""
    if emitters.radiance is None:
        return None
    part = whole_part(emitters.radiance.shape[1], WIDEST)
    radiance = narrower(narrowed(HeldPixels.of(emitters.radiance), part), WIDEST)
    to_cube = TO_CUBE @ axes.matrix @ emitters.turn
    levels = [_mirror(radiance, to_cube, emitters.has_cells)]
    levels += [_level(radiance, to_cube, level) for level in range(1, len(SIDES))]
    highest = lux * max(float(level.max()) for level in levels)
    intensity = _intensity(lux * float(levels[0].mean()), highest)
    scale = lux / intensity
    return ImageBasedLight(
        intensity,
        irradiance_harmonics(radiance, to_cube) * scale,
        tuple(tuple(_picture(face * scale) for face in level) for level in levels),
    )


def _intensity(mean: float, highest: float) -> float:
    """1 where pictures can say all in lux, as Babylon.js 9 multiplies irradiance by it twice."""
    if mean >= DIM and highest <= HIGHEST:
        return 1.0
    return max(mean, highest / HIGHEST) or 1.0


def _picture(face: Floats) -> bytes:
    """Of a face, (side, side, 3), as Babylon.js takes it: its lowest row first."""
    return png(packed(face[::-1]))


def _roughness(level: int) -> float:
    """The alpha of GGX, a roughness squared, that Babylon.js looks a level up for.

    It takes the level in which a pixel is as wide as the blur, and of these numbers makes ones
    that end with the last level (the text of the extension would have equal steps of roughness).
    """
    return float(SIDES[0]) ** (level / (len(SIDES) - 1) - 1)


def _mirror(radiance: Floats, to_cube: Floats, has_cells: bool) -> Floats:
    """What a perfect mirror shows, (6, side, side, 3)."""
    directions = cube_directions(2 * SIDES[0])
    light = look_up(radiance, directions.reshape(-1, 3) @ to_cube, has_cells)
    return averaged(light.reshape(directions.shape), 2)


def _level(radiance: Floats, to_cube: Floats, level: int) -> Floats:
    """What a rougher surface mirrors, (6, side, side, 3)."""
    mirrored = blurred(narrower(radiance, 4 * SIDES[level]), _roughness(level))
    directions = cube_directions(SIDES[level])
    light = look_up(mirrored, directions.reshape(-1, 3) @ to_cube, has_cells=False)
    return light.reshape(directions.shape)


def add_image_based_light(document: Document, light: ImageBasedLight) -> None:
    """The light, and that the scene has it."""
    images = []
    for level in light.pictures:
        faces = [{"uri": data_uri("image/png", picture)} for picture in level]
        images.append([document.add("images", face) for face in faces])
    part = {
        # Babylon.js has no default for it.
        "intensity": light.intensity,
        "irradianceCoefficients": light.coefficients.tolist(),
        "specularImageSize": SIDES[0],
        "specularImages": images,
    }
    index = document.add_of_extension(EXTENSION, "lights", part)
    document.extend_scene(EXTENSION, {"light": index})
