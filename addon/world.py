"""The HDRI in a world, and a world that shows the camera that HDRI and lights with the rest."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.conversion import Conversion
from ..core.environment import EnvironmentMap, environment_from_strips
from ..core.errors import CannotWrite, UnusableInput
from ..core.pixels import HeldPixels
from ..core.residual import LevelledPixels
from ..core.sampling import WorldSampling, choose_sampling
from .known import known_map
from .light_groups import take_out_of_groups
from .mapping import map_from_world
from .trace import TAG, Place, lighting_textures

UNCOMPRESSED = 1024
"""Pixels of a map's width up to which it is packed as it is: 6 MB at most."""

LINEAR_SPACES = ("Linear ", "Non-Color", "ACEScg", "ACES2065-1", "scene_linear")
"""How the names of colour spaces begin in which numbers are light."""


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


def find_light(world: bpy.types.World, engine: str = "CYCLES") -> WorldLight:
    """The one environment texture that lights a world under an engine. Raises UnusableInput."""
    found = lighting_textures(world, engine)
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
    if image.type == "MULTILAYER":
        raise UnusableInput(
            f'"{image.name}" is a multilayer EXR: save its combined pass as a plain EXR first.'
        )
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
    return known_map(pixels, image.name, lambda: _environment(image, pixels))


def _environment(image: bpy.types.Image, pixels: NDArray[np.float32]) -> EnvironmentMap:
    width, height = image.size
    pixels = pixels.reshape(height, width, image.channels)[::-1]
    colour = pixels[..., :3] if image.channels >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    return environment_from_strips(HeldPixels.of(colour), Path(image.name).stem, image.name)


def packed_image(radiance: NDArray[np.float32] | LevelledPixels, kind: str) -> bpy.types.Image:
    """A map as an image that travels inside the .blend file. Raises CannotWrite.

    kind: what it is; with the map's name it becomes the image's, see `name_images`.
    """
    from ..core.files import exr

    try:
        with tempfile.TemporaryDirectory(prefix="sunsplit-") as folder:
            path = Path(folder) / "map.exr"
            if isinstance(radiance, LevelledPixels):
                half = exr.halved(radiance.residual) is not None
                exr.write_strips(path, radiance, half)
            else:  # small maps are written often, and as fast as may be
                exr.write(path, radiance, compressed=radiance.shape[1] > UNCOMPRESSED)
            image = bpy.data.images.load(str(path))
            # Our own writer and Blender's packing keep the values; Image.save() would encode them.
            image.pack()
    except OSError as error:
        raise CannotWrite(
            f"Cannot write the {kind} map into a temporary folder: {error.strerror}."
        ) from error
    image.filepath_raw = ""
    image.colorspace_settings.name = _working_space()
    image[TAG] = kind
    return image


def _working_space() -> str:
    """What `Image.pixels` are in: scene linear, which Blender 5 lets the user choose."""
    settings = getattr(bpy.data, "colorspace", None)
    return settings.working_space if settings else "Linear Rec.709"


def converted_world(
    world: bpy.types.World,
    light: WorldLight,
    conversion: Conversion,
    camera_sees_it: bool = True,
    camera_width: int | None = None,
) -> bpy.types.World:
    """A copy of a world in which all rays but the camera's see the residual (or black), or all
    rays where the camera does not see it: then Cycles does not load the map.

    world: what `light` was found in; when it is a converted one, the copy loses what that
    conversion has put in. camera_width: of the map that the camera sees, None for the map's own.
    Nothing is left behind when this fails.
    """
    new = world.copy()
    new[TAG] = True
    take_out_of_groups(new)
    try:
        tree = new.node_tree
        for outer in light.texture.stack:
            group = tree.nodes[outer.name]
            group.node_tree = group.node_tree.copy()
            group.node_tree[TAG] = True
            tree = group.node_tree
        _strip(tree)
        texture = tree.nodes[light.texture.node.name]
        residual = conversion.levelled or conversion.residual
        image = packed_image(residual, "residual") if residual is not None else None
        # Between cells nothing is to be blended: a Voronoi map has edges.
        closest = conversion.settings.residual == "voronoi"
        interpolation = "Closest" if closest else texture.interpolation
        mix = _insert(tree, texture, image, interpolation, -300)
        if camera_sees_it:
            _show_camera(mix)
        if camera_sees_it and camera_width not in (None, conversion.environment.own_width):
            narrow = packed_image(conversion.environment.narrowed(camera_width), "camera")
            _insert(tree, texture, narrow, texture.interpolation, 300)
        _set_sampling(new, _sampling(conversion, closest))
    except BaseException:  # whatever it is, it goes on; only the half-made copy goes away
        remove_converted(new)
        raise
    # EEVEE would take a second sun out of the residual.
    new.sun_threshold = 0.0
    return new


def black_world() -> bpy.types.World:
    """A world without any light."""
    world = bpy.data.worlds.new("Sunsplit Black")
    world[TAG] = True
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    world.node_tree.nodes.clear()
    return world


def _strip(tree: bpy.types.NodeTree) -> None:
    """Take out the nodes that a conversion has put into a tree."""
    for mix in [node for node in tree.nodes if node.get(TAG) and node.type == "MIX"]:
        source = mix.inputs[7].links[0].from_socket
        for socket in [link.to_socket for link in mix.outputs[2].links]:
            tree.links.new(source, socket)
    for node in [node for node in tree.nodes if node.get(TAG)]:
        tree.nodes.remove(node)


def _insert(
    tree: bpy.types.NodeTree,
    texture: bpy.types.Node,
    image: bpy.types.Image | None,
    interpolation: str,
    higher: int,
) -> bpy.types.Node:
    """Put a mix of an environment texture and another image, or black, behind that texture: the
    mix, which shows the other; Cycles then does not load the first.

    higher: than the texture, by so much the other is drawn."""
    outgoing = [link.to_socket for link in texture.outputs["Color"].links]
    mix = tree.nodes.new("ShaderNodeMix")
    mix.name = mix.label = f"Sunsplit: Use {image[TAG].title() if image else 'Black'}"
    mix.data_type, mix.blend_type = "RGBA", "MIX"
    mix.clamp_result = False
    mix.location = texture.location.x + 280, texture.location.y + higher / 5
    mix[TAG] = True
    mix.inputs[0].default_value = 0.0
    tree.links.new(texture.outputs["Color"], mix.inputs[7])
    mix.inputs[6].default_value = (0, 0, 0, 1)
    if image is not None:
        other = _texture_like(tree, texture, image)
        other.interpolation = interpolation
        other.location = texture.location.x, texture.location.y + higher
        tree.links.new(other.outputs["Color"], mix.inputs[6])
    for socket in outgoing:
        tree.links.new(mix.outputs[2], socket)
    return mix


def _show_camera(mix: bpy.types.Node) -> None:
    """Let the camera see the map itself."""
    tree = mix.id_data
    path = tree.nodes.new("ShaderNodeLightPath")
    path.name = path.label = "Sunsplit: Ray"
    path.location = mix.location.x - 280, mix.location.y + 380
    path[TAG] = True
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])


def _texture_like(
    tree: bpy.types.NodeTree, texture: bpy.types.Node, image: bpy.types.Image
) -> bpy.types.Node:
    """An environment texture with another image and the same mapping."""
    rest = tree.nodes.new("ShaderNodeTexEnvironment")
    rest.name = rest.label = f"Sunsplit: {image[TAG].title()}"
    rest[TAG] = True
    rest.image = image
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


def _sampling(conversion: Conversion, cells: bool) -> WorldSampling:
    return choose_sampling(conversion.residual, conversion.visible_share, cells, conversion.visible)


def _set_sampling(world: bpy.types.World, sampling: WorldSampling) -> None:
    """Cycles' world importance sampling; nothing to do where Cycles is switched off."""
    if not hasattr(world, "cycles"):
        return
    world.cycles.sampling_method = sampling.method
    if sampling.method == "MANUAL":
        world.cycles.sample_map_resolution = sampling.resolution


def is_animated(world: bpy.types.World, light: WorldLight) -> bool:
    """Whether keyframes or drivers may change what was read from the world's nodes."""
    trees = [world.node_tree, *(outer.node_tree for outer in light.texture.stack)]
    data = [thing.animation_data for thing in (world, *trees) if thing.animation_data]
    return any(one.action or len(one.drivers) for one in data)


def remove_converted(world: bpy.types.World) -> None:
    """Take a converted world away, with the groups and images that were made for it.

    What another scene still uses stays.
    """
    if world.users:
        return
    trees, images = _made_for(world)
    bpy.data.worlds.remove(world)
    for tree in trees:
        if tree.users == 0:
            bpy.data.node_groups.remove(tree)
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)


def name_images(world: bpy.types.World, map_name: str) -> None:
    """Name the images of a conversion after the map; once older ones of that name are gone."""
    for image in _made_for(world)[1]:
        image.name = f"{map_name} {image[TAG]}"


def _made_for(
    world: bpy.types.World,
) -> tuple[list[bpy.types.NodeTree], list[bpy.types.Image]]:
    """Groups and images that a conversion has made for a world."""
    trees, images = [world.node_tree], []
    for tree in trees:
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree and node.node_tree.get(TAG):
                trees.append(node.node_tree)
            elif node.type == "TEX_ENVIRONMENT" and node.image and node.image.get(TAG):
                images.append(node.image)
    return list(dict.fromkeys(trees[1:])), list(dict.fromkeys(images))


def unconverted(world: bpy.types.World) -> bpy.types.World:
    """A converted world whose original is lost, turned back into an ordinary one, in place."""
    trees = [world.node_tree]
    for tree in trees:
        _strip(tree)
        trees += [n.node_tree for n in tree.nodes if n.type == "GROUP" and n.node_tree]
    take_out_of_groups(world)
    del world[TAG]
    return world
