"""A conversion's files become a world and a collection of its suns, as a conversion in a scene
would have made them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.environment import LUMINANCE_WEIGHTS
from ...core.errors import UnusableInput
from ...core.files.belonging import sha256
from ...core.files.written import WrittenConversion, read_written
from ...core.sampling import choose_sampling
from ..images import AS_IT_IS
from ..lamps import collection_of, make_lamps, name_lamps
from ..light_tree import make_guards, overflows
from ..report import headline, predicted
from ..rig import make_rig
from ..skies import REPORT, SUNS
from ..trace import TAG
from ..world import converted_world, find_light, name_images
from .job import AssetJob


@dataclass(frozen=True, eq=False)
class Sky:
    """images: what it is made of, and the file of each."""

    world: bpy.types.World
    collection: bpy.types.Collection
    conversion: WrittenConversion
    images: dict[bpy.types.Image, Path]


def make_sky(job: AssetJob) -> Sky:
    """A world that the camera sees the map in and that lights with the residual, and suns that
    follow it. Raises UnusableInput."""
    conversion = read_written(job.lights)
    _check_map(job.map, conversion)
    images = {_image(job.map): job.map}
    shown = {}
    if conversion.residual is not None:
        shown["residual"] = residual = _image(conversion.residual)
        residual[TAG] = "residual"
        images[residual] = conversion.residual
    plain = _plain_world(next(iter(images)))
    given = float(conversion.account.suns @ LUMINANCE_WEIGHTS)
    whole = float(conversion.account.source @ LUMINANCE_WEIGHTS)
    cells = conversion.has_cells
    sampling = choose_sampling(conversion.radiance, given / whole if whole else 0.0, cells)
    world = converted_world(plain, find_light(plain), shown, sampling, cells)
    bpy.data.worlds.remove(plain)
    world.name = job.name
    name_images(world, job.map.stem)
    light = find_light(world)
    rig = make_rig(light.texture)
    lamps = make_lamps(conversion.suns, light, rig, world)
    guards = make_guards(rig, lamps) if overflows(len(lamps)) else []
    collection = collection_of(rig, [*lamps, *guards], f"{job.name} Suns")
    name_lamps(conversion.suns, lamps, rig, whole)
    world[SUNS], world[REPORT] = collection, _report(conversion)
    return Sky(world, collection, conversion, images)


def _check_map(file: Path, conversion: WrittenConversion) -> None:
    try:
        same = sha256(file) == conversion.source_sha256
    except OSError as error:
        raise UnusableInput(f"{file} cannot be read: {error.strerror}.") from error
    if not same:
        raise UnusableInput(f"{file.name} has changed since then: convert the map again.")


def _image(file: Path) -> bpy.types.Image:
    """A file as an image whose numbers are light. Raises UnusableInput."""
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = AS_IT_IS
    width, height = image.size  # which loads it, and only then is its type known
    if image.type == "MULTILAYER":
        raise UnusableInput(
            f"{file.name} is a multilayer EXR, which a world does not show: save its combined "
            "pass as a plain EXR first."
        )
    if not width * height:
        raise UnusableInput(f"{file.name} is an image that Blender cannot read: save it as EXR.")
    return image


def _plain_world(image: bpy.types.Image) -> bpy.types.World:
    """A world lit by a map."""
    world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    texture.image = image
    texture.location, background.location, output.location = (-300, 0), (200, 0), (400, 0)
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    return world


def _report(conversion: WrittenConversion) -> str:
    """For the panel of a scene that uses it."""
    lines = [headline(len(conversion.suns), conversion.account.share)]
    if conversion.suns:
        lines.append(predicted(conversion))
    return "\n".join(lines)
