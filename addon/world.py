"""The HDRI in a world, and a world that shows the camera that HDRI and lights with the rest."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import UnusableInput
from ..core.sampling import WorldSampling
from .light_groups import take_out_of_groups
from .mapping import map_from_world, turns
from .skies import REPORT, SUNS
from .trace import TAG, Contribution, Input, Place, lighting_textures

TURNS = "sunsplit_turns"
"""Custom property of nodes that a conversion has added for the map to be turned by: these stay
when it is converted again."""


@dataclass(frozen=True, eq=False)
class WorldLight:
    """The environment texture that lights a world.

    gain: factor (3,) from the map's radiance to the scene's, strength and tints together.
    map_from_world: rotation (3, 3), see `mapping.map_from_world`. strength: the input of the
    world that is a factor in `gain`, where there is one.
    """

    texture: Place
    gain: NDArray[np.float64]
    map_from_world: NDArray[np.float64]
    strength: Input | None

    @property
    def image(self) -> bpy.types.Image:
        return self.texture.node.image


@dataclass(frozen=True)
class Shown:
    """Which rays see the map itself: the camera's, and those that come straight from exact mirrors
    and clear glass (see `singular`). False where none do."""

    to_camera: bool = True
    to_mirrors: bool = False

    def __bool__(self) -> bool:
        return self.to_camera or self.to_mirrors


TO_CAMERA = Shown()


def find_light(world: bpy.types.World, engine: str = "CYCLES") -> WorldLight:
    """The one environment texture that lights a world under an engine. Raises UnusableInput."""
    found = lighting_textures(world, engine)
    if not found:
        raise UnusableInput(
            f'No environment texture lights the world "{world.name}": '
            "add one and connect it to the background."
        )
    return _the_one(found)


def light_now(world: bpy.types.World, engine: str = "CYCLES") -> WorldLight | None:
    """The one environment texture that lights the scene as the world is: of a converted one the
    residual map, or None where that is black or no map at all. Raises UnusableInput."""
    found = lighting_textures(world, engine, undone=False)
    return _the_one(found) if found else None


def _the_one(found: list[Contribution]) -> WorldLight:
    """Of the textures that light a world. Raises UnusableInput where that is none to follow."""
    if len(found) > 1:
        names = " and ".join(f'"{part.texture.node.name}"' for part in found)
        raise UnusableInput(f"Several environment textures light the world ({names}): keep one.")
    texture, gain, strength = found[0].texture, found[0].gain, found[0].strength
    node = texture.node
    if (gain < 0).any():
        raise UnusableInput("The world's strength is negative: there is no such light.")
    if node.image is None:
        raise UnusableInput(f'The environment texture "{node.name}" has no image: open an HDRI.')
    if node.projection != "EQUIRECTANGULAR":
        raise UnusableInput(
            f'The environment texture "{node.name}" is a mirror ball: use an equirectangular map.'
        )
    return WorldLight(texture, gain, map_from_world(texture), strength)


def converted_world(
    world: bpy.types.World,
    light: WorldLight,
    images: Mapping[str, bpy.types.Image],
    sampling: WorldSampling,
    has_cells: bool = False,
    shown: Shown = TO_CAMERA,
) -> bpy.types.World:
    """A copy of a world in which all rays see the residual (or black) but those that are shown the
    map: where none are, Cycles does not load that.

    world: what `light` was found in; when it is a converted one, the copy loses what that
    conversion has put in. images: "residual"; "map", a narrower one in its place.
    sampling: Cycles' for the residual. has_cells: the residual is a Voronoi map. Nothing is left
    behind when this fails.
    """
    new = world.copy()
    if new.override_library:  # of which no new node would be saved
        new = new.make_local(clear_liboverride=True)
    new[TAG] = True
    _forget_sky(new)
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
        if not any(turn.rotation for turn in turns(light.texture)):
            _insert_rotation(tree, texture)
        # Between cells nothing is to be blended: a Voronoi map has edges.
        interpolation = "Closest" if has_cells else texture.interpolation
        mix = _insert(tree, texture, images.get("residual"), interpolation, -300)
        if shown:
            _show_map(mix, shown)
        if "map" in images:
            _insert(tree, texture, images["map"], texture.interpolation, 300)
        _set_sampling(new, sampling)
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


def _insert_rotation(tree: bpy.types.NodeTree, texture: bpy.types.Node) -> None:
    """Put a Mapping before an environment texture that has none, so that the map can be turned."""
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.name = mapping.label = "Sunsplit: Rotation"
    mapping[TURNS] = True
    mapping.vector_type = "POINT"
    mapping.location = texture.location.x - 200, texture.location.y
    vector = texture.inputs["Vector"]
    if vector.is_linked:
        source = vector.links[0].from_socket
    else:
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        coordinates[TURNS] = True
        coordinates.location = texture.location.x - 400, texture.location.y
        source = coordinates.outputs["Generated"]
    tree.links.new(source, mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], vector)


def _strip(tree: bpy.types.NodeTree) -> None:
    """Take out the nodes that a conversion has put into a tree."""
    for mix in [node for node in tree.nodes if node.get(TAG) and node.type == "MIX"]:
        source = mix.inputs[7].links[0].from_socket
        for socket in [link.to_socket for link in mix.outputs[2].links]:
            tree.links.new(source, socket)
    for node in [node for node in tree.nodes if node.get(TAG)]:
        tree.nodes.remove(node)


def _strip_rotation(tree: bpy.types.NodeTree) -> None:
    """Take out the Mapping that a conversion has added, if it turns nothing by now."""
    for mapping in [n for n in tree.nodes if n.get(TURNS) and n.type == "MAPPING"]:
        vector, rotation = mapping.inputs["Vector"], mapping.inputs["Rotation"]
        if rotation.is_linked or any(rotation.default_value) or not vector.is_linked:
            continue
        source = vector.links[0].from_socket
        for socket in [link.to_socket for link in mapping.outputs[0].links]:
            tree.links.new(source, socket)
        tree.nodes.remove(mapping)


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


def _show_map(mix: bpy.types.Node, shown: Shown) -> None:
    """Let rays see the map itself."""
    path = _node_before(mix, "ShaderNodeLightPath", "Sunsplit: Ray", 4)
    seen = path.outputs["Is Camera Ray"]
    if shown.to_mirrors:
        # EEVEE of Blender 4.5 lights with what rays see that are all at once, reflected and let
        # through: no ray of Cycles is.
        none = _math(mix, "MULTIPLY", 3, *(path.outputs[f"Is {x} Ray"] for x in _OF_SURFACES))
        mirrored = _math(mix, "SUBTRACT", 2, path.outputs["Is Singular Ray"], none)
        seen = _math(mix, "ADD", 1, seen, mirrored) if shown.to_camera else mirrored
    mix.id_data.links.new(seen, mix.inputs[0])


_OF_SURFACES = "Reflection", "Transmission"


def _math(
    mix: bpy.types.Node, operation: str, before: int, *values: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    node = _node_before(mix, "ShaderNodeMath", f"Sunsplit: {operation.title()}", before)
    node.operation = operation
    for k, value in enumerate(values):
        mix.id_data.links.new(value, node.inputs[k])
    return node.outputs[0]


def _node_before(mix: bpy.types.Node, kind: str, name: str, before: int) -> bpy.types.Node:
    """A new node, drawn so many places to the left of a mix."""
    node = mix.id_data.nodes.new(kind)
    node.name = node.label = name
    node.location = mix.location.x - 200 * before, mix.location.y + 380
    node[TAG] = True
    return node


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


def _set_sampling(world: bpy.types.World, sampling: WorldSampling) -> None:
    """Cycles' world importance sampling; nothing to do where Cycles is switched off."""
    if not hasattr(world, "cycles"):
        return
    world.cycles.sampling_method = sampling.method
    if sampling.method == "MANUAL":
        world.cycles.sample_map_resolution = sampling.resolution


def is_animated(light: WorldLight, followed: Container[tuple[bpy.types.ID, str]]) -> bool:
    """Whether keyframes or drivers may change what was read from the world's nodes, but for inputs
    that are followed: see `driven.followed`."""
    tree = light.texture.node.id_data
    trees = {tree, *(outer.id_data for outer in light.texture.stack)}
    worlds = {world for world in bpy.data.worlds if world.node_tree in trees}
    return any(
        path is None or (thing, path) not in followed
        for thing in (*trees, *worlds)
        for path in _animated_paths(thing)
    )


def _animated_paths(thing: bpy.types.ID) -> Iterator[str | None]:
    """Of a data-block's properties that change by themselves; None: some, it cannot be told
    which."""
    made = thing.animation_data
    if made is None:
        return
    yield from (curve.data_path for curve in made.drivers)
    if len(made.nla_tracks):
        yield None
    if made.action:
        for layer in made.action.layers:
            for strip in layer.strips:
                bag = strip.channelbag(made.action_slot)
                yield from (curve.data_path for curve in bag.fcurves) if bag else ()


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
        _strip_rotation(tree)
        trees += [n.node_tree for n in tree.nodes if n.type == "GROUP" and n.node_tree]
    take_out_of_groups(world)
    del world[TAG]
    _forget_sky(world)
    return world


def _forget_sky(world: bpy.types.World) -> None:
    """What a world has from an asset library, its suns above all, is not its copy's."""
    for mark in (SUNS, REPORT):
        if mark in world:
            del world[mark]
