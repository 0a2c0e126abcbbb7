"""Direction and size of lamps against what Cycles itself shows of the map in the sky.

The camera sees the original map, also in a converted world, so it is pointed along a lamp: the
light must stand in the middle of the picture and be as large as the lamp.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender import (
    add_mapping,
    camera_towards,
    fresh_scene,
    hdri_world,
    render,
    suns,
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky

SIZE = 96
BACKGROUND = 0.05


def seen(scene, folder, lamp, field_of_view):
    """(offset from the middle, diameter of the disc with the same moment), both in degrees."""
    camera_towards(scene, to_light(lamp), field_of_view, SIZE)
    # The background is constant: what is above it is the light.
    picture = render(scene, folder, samples=64).mean(axis=-1) - BACKGROUND
    picture[picture < 1e-3 * picture.max()] = 0
    assert picture.max() > 1, "the lamp's direction shows no light"
    half = np.tan(np.radians(field_of_view) / 2)
    axis = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * half
    x, y = np.meshgrid(axis, -axis)
    rays = np.dstack([x, y, -np.ones_like(x)])
    length = np.linalg.norm(rays, axis=-1, keepdims=True)
    light = picture / length[..., 0] ** 3
    mean = np.einsum("ij,ijk->k", light, rays / length) / light.sum()
    offset = np.degrees(np.arctan2(np.hypot(*mean[:2]), -mean[2]))
    middle = mean / np.linalg.norm(mean)
    spread = (light * ((rays / length - middle) ** 2).sum(axis=-1)).sum() / light.sum() / 2
    return offset, np.degrees(4 * np.arcsin(np.sqrt(spread)))


def one_light(folder, place, radius, width=1024):
    pixels = sky(width, BACKGROUND)
    paint_disc(pixels, place, radius, (2000, 2000, 2000))
    return write_map(folder / "map.exr", pixels)


PLACES = {
    "side": direction(40, 20),
    "seam": direction(180, -35),
    "zenith": direction(0, 90),
    "near the nadir": direction(123, -87),
}


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES.keys())
def test_a_disc(tmp_path, place):
    scene = fresh_scene()
    texture = hdri_world(scene, one_light(tmp_path, place, 3))
    texture.interpolation = "Closest"
    bpy.ops.sunsplit.convert()
    (lamp,) = suns(scene)
    offset, diameter = seen(scene, tmp_path, lamp, 16)
    print(f"offset {offset:.4f}, diameter {diameter:.3f}, lamp {np.degrees(lamp.data.angle):.3f}")
    assert offset < 0.03
    assert np.degrees(lamp.data.angle) == pytest.approx(diameter, rel=0.01)


@pytest.mark.parametrize(("row", "column"), [(250, 300), (200, 1023), (3, 17), (511, 512)])
def test_one_pixel(tmp_path, row, column):
    pixels = sky(1024, BACKGROUND)
    pixels[row, column] = 50_000
    scene = fresh_scene()
    texture = hdri_world(scene, write_map(tmp_path / "map.exr", pixels))
    texture.interpolation = "Closest"
    bpy.ops.sunsplit.convert()
    (lamp,) = suns(scene)
    # Close enough that many rays meet even the needle that a pixel is at a pole.
    offset, diameter = seen(scene, tmp_path, lamp, 0.6 if row in (0, 511) else 1.5)
    print(f"offset {offset:.4f}, diameter {diameter:.3f}, lamp {np.degrees(lamp.data.angle):.3f}")
    assert offset < 0.01
    assert np.degrees(lamp.data.angle) == pytest.approx(diameter, rel=0.03)


ANGLES = (0.3, -0.5, 0.8)


def by_mapping(kind):
    def apply(texture):
        mapping = add_mapping(texture)
        mapping.vector_type = kind
        mapping.inputs["Rotation"].default_value = ANGLES

    return apply


def by_legacy(kind):
    def apply(texture):
        texture.texture_mapping.vector_type = kind
        texture.texture_mapping.rotation = ANGLES

    return apply


def by_mirror(texture):
    mapping = add_mapping(texture)
    mapping.inputs["Rotation"].default_value = ANGLES
    mapping.inputs["Scale"].default_value = (-1.5, 1.5, 1.5)


def by_legacy_axes(texture):
    texture.texture_mapping.mapping_x = "Y"
    texture.texture_mapping.mapping_y = "X"
    texture.texture_mapping.rotation = ANGLES


def by_two_mappings(texture):
    mapping = add_mapping(texture)
    mapping.inputs["Rotation"].default_value = ANGLES
    tree = texture.id_data
    second = tree.nodes.new("ShaderNodeMapping")
    second.vector_type = "TEXTURE"
    second.inputs["Rotation"].default_value = (-0.2, 0.9, 0.1)
    tree.links.new(mapping.outputs[0], second.inputs["Vector"])
    tree.links.new(second.outputs[0], texture.inputs["Vector"])
    texture.texture_mapping.rotation = (0.1, 0.2, -0.4)


def by_vector_rotate(kind, invert):
    def apply(texture):
        mapping = add_mapping(texture)
        tree = texture.id_data
        turn = tree.nodes.new("ShaderNodeVectorRotate")
        turn.rotation_type = kind
        turn.invert = invert
        # A Vector Rotate node only has the inputs that its type needs.
        for name, value in (("Angle", 0.7), ("Axis", (1, 2, 3)), ("Rotation", ANGLES)):
            if name in turn.inputs:
                turn.inputs[name].default_value = value
        tree.links.new(mapping.outputs[0], turn.inputs["Vector"])
        tree.links.new(turn.outputs[0], texture.inputs["Vector"])

    return apply


def by_group(texture):
    """Mapping inside a group that takes its rotation from outside."""
    tree = texture.id_data
    group = bpy.data.node_groups.new("Turn", "ShaderNodeTree")
    group.interface.new_socket("Turn", in_out="INPUT", socket_type="NodeSocketVector")
    group.interface.new_socket("Vector", in_out="OUTPUT", socket_type="NodeSocketVector")
    given, result = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    mapping, coordinates = (
        group.nodes.new("ShaderNodeMapping"),
        group.nodes.new("ShaderNodeTexCoord"),
    )
    group.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    group.links.new(given.outputs["Turn"], mapping.inputs["Rotation"])
    group.links.new(mapping.outputs[0], result.inputs["Vector"])
    outer = tree.nodes.new("ShaderNodeGroup")
    outer.node_tree = group
    outer.inputs["Turn"].default_value = ANGLES
    tree.links.new(outer.outputs["Vector"], texture.inputs["Vector"])


def by_object_coordinates(texture):
    mapping = add_mapping(texture)
    coordinates = mapping.inputs["Vector"].links[0].from_node
    texture.id_data.links.new(coordinates.outputs["Object"], mapping.inputs["Vector"])
    mapping.inputs["Rotation"].default_value = ANGLES


def by_muted(texture):
    by_mapping("POINT")(texture)
    texture.inputs["Vector"].links[0].from_node.mute = True


MAPPINGS = {
    "none": lambda texture: None,
    "mirror": by_mirror,
    "legacy axes": by_legacy_axes,
    "two mappings": by_two_mappings,
    "group": by_group,
    "object coordinates": by_object_coordinates,
    "muted": by_muted,
    **{f"mapping {k}": by_mapping(k) for k in ("POINT", "TEXTURE", "VECTOR", "NORMAL")},
    **{f"legacy {k}": by_legacy(k) for k in ("POINT", "TEXTURE", "VECTOR", "NORMAL")},
    **{
        f"rotate {k} {i}": by_vector_rotate(k, i)
        for k, i in [("AXIS_ANGLE", False), ("Z_AXIS", True), ("EULER_XYZ", False)]
    },
    "rotate EULER_XYZ inverted": by_vector_rotate("EULER_XYZ", True),
}


@pytest.mark.parametrize("turn", MAPPINGS.values(), ids=MAPPINGS.keys())
def test_lamps_follow_the_mapping(tmp_path, turn):
    scene = fresh_scene()
    texture = hdri_world(scene, one_light(tmp_path, direction(-70, 25), 3, 512))
    turn(texture)
    bpy.ops.sunsplit.convert()
    (lamp,) = suns(scene)
    offset, _ = seen(scene, tmp_path, lamp, 16)
    assert offset < 0.03
