"""glTF 2.0: `KHR_lights_punctual` and `EXT_lights_image_based`, and for those who do not know the
latter, or want more of it, a map beside the file that its `extras` tell of.

Either file holds all else that it needs in itself: it can be moved, dropped into a browser's
window and checked on its own, and what is inside is small.
"""

from __future__ import annotations

import os
from urllib.parse import quote

import numpy as np

from ... import sphere
from ..axes import Y_UP, Axes
from ..emitters import Emitters, Rays, emitters_of
from ..made import Made
from ..names import names_of
from ..settings import ExportSettings
from ..skylight import Skylight
from ..stage import STAGE
from .document import Document, Json, numbers_of, quaternion
from .images import ImageBasedLight, add_image_based_light, image_based_light
from .scene import add_stage

PUNCTUAL = "KHR_lights_punctual"

WIDE_SUN = np.radians(2.5)
"""Angular diameter from which a sun is painted into the map, as a lamp of glTF has no width: a
plate that is edge-on to a disc of radius a gets 2 a / (3 pi) of its light, and nothing of such a
lamp. That is half a percent at 2.7 degrees."""

LAYOUT = (
    "Equirectangular, linear Rec.709 radiance. Before it is turned by the rotation, the middle of "
    "the picture lies at +X, the middle of its left half at -Z, its upper edge at +Y."
)
"""Of the map beside a file, in the axes of glTF."""

LUX = "Lux that are written for a unit of irradiance, and of the map's radiance times steradians."

MAP_IN_VIEWERS = (
    "Viewers show the map by EXT_lights_image_based, coarsely and without its shadows, or not at "
    "all: other programs need the file beside."
)

TWICE = (
    "Babylon.js, as of version 9, lights matt surfaces with the map {:.3g} times too bright: for "
    "it, write 1 lux for a unit of irradiance."
)
"""It multiplies the map's irradiance by the light's intensity once too often."""


def made_for_gltf(sky: Skylight, settings: ExportSettings) -> Made:
    """Y up, as glTF is by its own rules."""
    axes, lux = Y_UP, settings.lux
    emitters = emitters_of(sky, "one ray", settings.discs, WIDE_SUN)
    names = names_of("gltf", sky.name)
    losses = emitters.losses + ([MAP_IN_VIEWERS] if emitters.radiance is not None else [])
    light = image_based_light(emitters, axes, lux)
    if light and light.intensity != 1:
        losses.append(TWICE.format(light.intensity))
    extras = {"lux": lux, "lux_means": LUX, "losses": losses}
    if emitters.radiance is not None:
        extras["map"] = _about_map(emitters, axes, names.map)
    lights, scene = (_with_light(emitters, axes, lux, extras, light) for _ in range(2))
    add_stage(scene, STAGE, axes)
    return Made(names, lights.text(), scene.text(), emitters.radiance, axes, tuple(losses))


def _about_map(emitters: Emitters, axes: Axes, name: str) -> Json:
    """What no part of glTF has a place for. name: of the file."""
    return {
        "uri": quote(os.fsencode(name)),
        "layout": LAYOUT,
        "rotation": quaternion(axes.rotation_of_map(emitters.turn, axes.matrix)),
        "blend_pixels": not emitters.has_cells,
    }


def _with_light(
    emitters: Emitters, axes: Axes, lux: float, extras: Json, light: ImageBasedLight | None
) -> Document:
    document = Document(emitters.name)
    document.tell({"sunsplit": extras})
    for number, rays in enumerate(emitters.rays, start=1):
        _add_lamp(document, f"sun {number}", rays, axes, lux)
    if light:
        add_image_based_light(document, light)
    return document


def _add_lamp(document: Document, name: str, rays: Rays, axes: Axes, lux: float) -> None:
    """A lamp at the origin that shines along its own -Z."""
    highest = float(rays.irradiance.max())
    light = {
        "name": name,
        "type": "directional",
        "intensity": lux * highest,
        "color": numbers_of(rays.irradiance / (highest or 1.0)),
        "extras": {"angular_diameter": rays.width, "irradiance": numbers_of(rays.irradiance)},
    }
    index = document.add_of_extension(PUNCTUAL, "lights", light)
    (to_light,) = axes.of(rays.to_light)
    frame = np.stack([*sphere.tangents(to_light), to_light], axis=-1)
    place = {"rotation": quaternion(frame), "extensions": {PUNCTUAL: {"light": index}}}
    document.add_node(name, place)
