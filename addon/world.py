"""The HDRI in a world, and a world that shows the camera that HDRI and lights with the rest."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.environment import EnvironmentMap, environment_from_pixels
from ..core.errors import UnusableInput
from .mapping import map_from_world
from .trace import Place, lighting_textures

TAG = "sunsplit"
"""Custom property on every data-block that a conversion makes, so that restore finds it again."""

CALM_ENOUGH = 2.5
"""Second moment of a residual, mean(L^2) / mean(L)^2 over the sphere, up to which sampling by
surfaces alone (world importance sampling NONE) costs no more than a table; this and the next
bounds by docs/benchmarks/region_a.md."""

LINEAR_SPACES = ("Linear ", "Non-Color", "ACEScg", "ACES2065-1", "scene_linear")
"""How the names of colour spaces begin in which numbers are light."""

SMALL_TABLE = 512
"""Width of the sampling table for a residual that is calm, but not calm enough to do without."""

CALM_PEAK = 1000.0
"""Brightest pixel in means of the residual up to which a small table misses nothing that counts."""


@dataclass(frozen=True, eq=False)
class WorldLight:
    """The environment texture that lights a world.

    gain: factor (3,) from the map's radiance to the scene's, strength and tints together.
    map_from_world: rotation (3, 3), see `mapping.map_from_world`.
    """

    texture: Place
    gain: NDArray[np.float64]
    map_from_world: NDArray[np.float64]

    @property
    def image(self) -> bpy.types.Image:
        return self.texture.node.image


def find_light(world: bpy.types.World) -> WorldLight:
    """The one environment texture that lights a world. Raises UnusableInput."""
    found = lighting_textures(world)
    if not found:
        raise UnusableInput(
            f'No environment texture lights the world "{world.name}": '
            "add one and connect it to the background."
        )
    if len(found) > 1:
        names = " and ".join(f'"{part.texture.node.name}"' for part in found)
        raise UnusableInput(f"Several environment textures light the world ({names}): keep one.")
    texture, gain = found[0].texture, found[0].gain
    node = texture.node
    if (gain < 0).any():
        raise UnusableInput("The world's strength is negative: there is no such light.")
    if node.image is None:
        raise UnusableInput(f'The environment texture "{node.name}" has no image: open an HDRI.')
    if node.projection != "EQUIRECTANGULAR":
        raise UnusableInput(
            f'The environment texture "{node.name}" is a mirror ball: use an equirectangular map.'
        )
    return WorldLight(texture, gain, map_from_world(texture))


def read_image(image: bpy.types.Image) -> EnvironmentMap:
    """What a renderer sees of an image, whether it is a file, packed or generated.

    Raises UnusableInput.
    """
    if image.source in ("SEQUENCE", "MOVIE", "TILED"):
        raise UnusableInput(f'"{image.name}" is a {image.source.lower()}: use a single image.')
    width, height = image.size
    if not image.has_data and not width * height:
        raise UnusableInput(
            f'The image "{image.name}" cannot be loaded from {image.filepath or "anywhere"}: '
            "find the missing file first (File > External Data)."
        )
    if not image.is_float:
        raise UnusableInput(
            f'"{image.name}" is an LDR image without linear light: use the HDR version of the map.'
        )
    space = image.colorspace_settings.name
    if not space.startswith(LINEAR_SPACES):
        raise UnusableInput(
            f'"{image.name}" is read as {space}, in which numbers are not light: '
            "set its colour space to Linear Rec.709 (or what the file was made in)."
        )
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)[::-1]
    colour = pixels[..., :3] if image.channels >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    return environment_from_pixels(colour, Path(image.name).stem, image.name)


def residual_image(residual: NDArray[np.float32], name: str) -> bpy.types.Image:
    """A residual map as an image that travels inside the .blend file."""
    from ..core.files import exr

    with tempfile.TemporaryDirectory(prefix="sunsplit-") as folder:
        path = Path(folder) / f"{name}.residual.exr"
        exr.write(path, residual)
        image = bpy.data.images.load(str(path))
        # Our own writer and Blender's packing keep the values; Image.save() would encode them.
        image.pack()
    image.name = f"{name} residual"
    image.filepath_raw = ""
    image.colorspace_settings.name = _working_space()
    image[TAG] = True
    return image


def _working_space() -> str:
    """What `Image.pixels` are in: scene linear, which Blender 5 lets the user choose."""
    settings = getattr(bpy.data, "colorspace", None)
    return settings.working_space if settings else "Linear Rec.709"


def converted_world(
    world: bpy.types.World, light: WorldLight, residual: NDArray[np.float32] | None
) -> bpy.types.World:
    """A copy of a world in which all rays but the camera's see the residual (None: black)."""
    new = world.copy()
    new.name = f"{world.name} (Sunsplit)"
    new[TAG] = True
    tree = new.node_tree
    for outer in light.texture.stack:
        group = tree.nodes[outer.name]
        group.node_tree = group.node_tree.copy()
        group.node_tree[TAG] = True
        tree = group.node_tree
    image = None
    if residual is not None:
        image = residual_image(residual, Path(light.image.name).stem)
    _insert_residual(tree, tree.nodes[light.texture.node.name], image)
    _set_sampling(new, residual)
    # EEVEE would take a second sun out of the residual.
    new.sun_threshold = 0.0
    return new


def _insert_residual(
    tree: bpy.types.NodeTree, texture: bpy.types.Node, image: bpy.types.Image | None
) -> None:
    """Put a mix behind an environment texture: the camera sees it, all else the residual."""
    outgoing = [link.to_socket for link in texture.outputs["Color"].links]
    mix = tree.nodes.new("ShaderNodeMix")
    mix.name = mix.label = "Sunsplit: Camera or Residual"
    mix.data_type, mix.blend_type = "RGBA", "MIX"
    mix.clamp_result = False
    mix.location = texture.location.x + 280, texture.location.y - 60
    path = tree.nodes.new("ShaderNodeLightPath")
    path.name = path.label = "Sunsplit: Ray"
    path.location = texture.location.x, texture.location.y + 320
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(texture.outputs["Color"], mix.inputs[7])
    mix.inputs[6].default_value = (0, 0, 0, 1)
    if image is not None:
        rest = _texture_like(tree, texture, image)
        tree.links.new(rest.outputs["Color"], mix.inputs[6])
    for socket in outgoing:
        tree.links.new(mix.outputs[2], socket)


def _texture_like(
    tree: bpy.types.NodeTree, texture: bpy.types.Node, image: bpy.types.Image
) -> bpy.types.Node:
    """An environment texture with another image and the same mapping."""
    rest = tree.nodes.new("ShaderNodeTexEnvironment")
    rest.name = rest.label = "Sunsplit: Residual"
    rest.location = texture.location.x, texture.location.y - 300
    rest.image = image
    rest.interpolation = texture.interpolation
    rest.projection = texture.projection
    old, new = texture.texture_mapping, rest.texture_mapping
    for name in ("vector_type", "translation", "rotation", "scale"):
        setattr(new, name, getattr(old, name))
    for name in ("mapping_x", "mapping_y", "mapping_z"):
        setattr(new, name, getattr(old, name))
    incoming = texture.inputs["Vector"].links
    if incoming:
        tree.links.new(incoming[0].from_socket, rest.inputs["Vector"])
    return rest


def _set_sampling(world: bpy.types.World, residual: NDArray[np.float32] | None) -> None:
    """Cycles' world importance sampling: none or a small table where the residual is calm."""
    if residual is None:
        world.cycles.sampling_method = "NONE"
        return
    moment, peak = contrast(residual)
    if moment <= CALM_ENOUGH and peak <= CALM_PEAK:
        world.cycles.sampling_method = "NONE"
    elif peak <= CALM_PEAK:
        world.cycles.sampling_method = "MANUAL"
        world.cycles.sample_map_resolution = SMALL_TABLE
    else:
        world.cycles.sampling_method = "AUTOMATIC"


def contrast(radiance: NDArray[np.float32]) -> tuple[float, float]:
    """(mean(L^2) / mean(L)^2, max(L) / mean(L)) of a map's luminance over the sphere."""
    from ..core.environment import luminance
    from ..core.sphere import row_solid_angles

    lum = luminance(radiance)
    solid = row_solid_angles(lum.shape[1], lum.shape[0]) / (4 * np.pi)
    mean = float(lum.sum(axis=1) @ solid)
    if mean == 0:
        return 1.0, 1.0
    return float((lum**2).sum(axis=1) @ solid) / mean**2, float(lum.max()) / mean


def remove_converted(world: bpy.types.World) -> None:
    """Take a converted world away, with the groups and the image that were made for it."""
    trees, images = [world.node_tree], []
    for tree in trees:
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree and node.node_tree.get(TAG):
                trees.append(node.node_tree)
            elif node.type == "TEX_ENVIRONMENT" and node.image and node.image.get(TAG):
                images.append(node.image)
    # Groups before images: a data-block that still has a user is not ours to remove.
    bpy.data.worlds.remove(world)
    for tree in trees[1:]:
        if tree.users == 0:
            bpy.data.node_groups.remove(tree)
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)
