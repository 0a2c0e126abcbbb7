"""Write the light of a scene, as it is now, for another renderer: what the operator calls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Color

from ..core.errors import UnusableInput
from ..core.export.run import ExportedFiles, export_conversion
from ..core.export.settings import ExportSettings
from ..core.export.skylight import Floats, Skylight
from .exported import as_name
from .images import AS_IT_IS, working_space
from .lamp_light import suns_of_lamps
from .trace import lighting_textures
from .world_map import map_of_world


def export_scene(
    scene: bpy.types.Scene, folder: str, settings: ExportSettings, name: str = ""
) -> ExportedFiles:
    """Write a scene's suns and map, and a small scene to try them in.

    folder: as Blender's paths are, "//" is where the .blend lies; "" is there, too. name: of the
    files; "" is the map's. All files appear, or none. Raises UnusableInput, CannotWrite.
    """
    if not folder and not bpy.data.filepath:
        raise UnusableInput("Say into which folder: this file has none yet, as it is not saved.")
    sky = skylight_of_scene(scene)
    if name:
        sky = replace(sky, name=as_name(name))
    return export_conversion(sky, bpy.path.abspath(folder or "//"), settings)


def skylight_of_scene(scene: bpy.types.Scene) -> Skylight:
    """The light of a conversion as Cycles renders it at the current frame, whatever was changed in
    world and lamps. Raises UnusableInput, CannotWrite."""
    lamps = [entry.lamp for entry in scene.sunsplit.lamps if entry.lamp]
    # First, as it also brings what drivers and keyframes set in the world up to date.
    suns = suns_of_lamps(scene, lamps)
    world = map_of_world(scene.world, scene.render.engine) if scene.world else None
    if world is None and not suns:
        raise UnusableInput("Neither lamps nor world give any light: there is nothing to export.")
    radiance, has_cells, turn = None, False, np.eye(3)
    if world is not None:
        radiance, has_cells, turn = world.radiance, world.has_cells, world.turn
    return _in_rec709(Skylight(map_name(scene), tuple(suns), radiance, has_cells, turn))


def map_name(scene: bpy.types.Scene) -> str:
    """What to call a scene's map: as its HDRI, or else as its world."""
    if scene.world is None:
        return as_name(scene.name)
    try:
        found = lighting_textures(scene.world, scene.render.engine)
    except UnusableInput:
        found = []
    images = [part.texture.node.image for part in found if part.texture.node.image]
    return as_name(Path(images[0].name).stem if images else scene.world.name)


def _in_rec709(sky: Skylight) -> Skylight:
    """From the colours that Blender works in, which the user of Blender 5 may choose."""
    if working_space() == AS_IT_IS:
        return sky
    matrix = np.array([Color(one).from_scene_linear_to_rec709_linear() for one in np.eye(3)]).T

    def turned(colour: Floats) -> Floats:
        """What Rec.709 cannot show is as near as it can."""
        return np.maximum(colour @ matrix.T, 0)

    suns = tuple(
        replace(
            sun,
            irradiance=turned(sun.irradiance),
            scalar_irradiance=turned(sun.scalar_irradiance),
        )
        for sun in sky.suns
    )
    radiance = sky.radiance
    if radiance is not None:
        radiance = turned(radiance).astype(np.float32)
    return replace(sky, suns=suns, radiance=radiance)
