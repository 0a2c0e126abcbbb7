"""Lamps follow the world: its rotations, however they are made, and its strength."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sunsplit.addon.controls import rotation_control
from sunsplit.addon.world import find_light
from tests.blender import add_mapping, fresh_scene, hdri_world, node, suns, to_light, write_map
from tests.maps import direction, paint_disc, sky

ALIKE = 3e-5
"""Of unit vectors, .002 degrees: angles and matrices are float32, and Blender leaves each driven
angle that would change by a hundred thousandth or less."""

angles = st.tuples(*[st.floats(-7, 7)] * 3)
anything = settings(
    max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)


@pytest.fixture(scope="module")
def two_suns(tmp_path_factory):
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(40, 30), 2, (900, 900, 900))
    paint_disc(pixels, direction(-100, 10), 3, (600, 100, 50))
    return write_map(tmp_path_factory.mktemp("maps") / "two suns.exr", pixels)


@pytest.fixture
def scene():
    return fresh_scene()


def assert_lamps_are_where_the_map_shows_them(scene, in_map):
    turned = find_light(scene.world).map_from_world
    for lamp, towards in zip(suns(scene), in_map, strict=True):
        assert to_light(lamp) == pytest.approx(turned.T @ towards, abs=ALIKE)


def directions_in_map(scene):
    turned = find_light(scene.world).map_from_world
    return [turned @ to_light(lamp) for lamp in suns(scene)]


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE", "VECTOR", "NORMAL"])
@anything
@given(first=angles, second=angles)
def test_every_kind_of_mapping(two_suns, kind, first, second):
    scene = fresh_scene()
    mapping = add_mapping(hdri_world(scene, two_suns))
    mapping.vector_type = kind
    mapping.inputs["Rotation"].default_value = first
    bpy.ops.sunsplit.convert()
    in_map = directions_in_map(scene)
    scene.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value = second
    assert_lamps_are_where_the_map_shows_them(scene, in_map)


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE"])
@pytest.mark.parametrize("least", [2e-5, -2e-5])
def test_lamps_follow_the_least_turn(two_suns, kind, least):
    scene = fresh_scene()
    mapping = add_mapping(hdri_world(scene, two_suns))
    mapping.vector_type = kind
    bpy.ops.sunsplit.convert()
    before = to_light(suns(scene)[0])
    scene.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value[2] = least
    moved = np.linalg.norm(to_light(suns(scene)[0]) - before)
    assert moved == pytest.approx(abs(least) * np.hypot(*before[:2]), rel=0.05)


def vector_rotate(texture, kind):
    tree = texture.id_data
    turn = tree.nodes.new("ShaderNodeVectorRotate")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs["Vector"], texture.inputs["Vector"])
    turn.rotation_type = kind
    return turn


def set_inputs(turn, values):
    """Those that the node has, with its kind of rotation."""
    found = [s for s in turn.inputs if s.enabled and s.name in values]
    for socket in found:
        socket.default_value = values[socket.name]
    return found


@pytest.mark.parametrize("undone", [False, True], ids=["", "inverted"])
@pytest.mark.parametrize("kind", ["X_AXIS", "Y_AXIS", "Z_AXIS", "AXIS_ANGLE", "EULER_XYZ"])
def test_every_kind_of_vector_rotate(scene, two_suns, kind, undone):
    turn = vector_rotate(hdri_world(scene, two_suns), kind)
    turn.invert = undone
    set_inputs(turn, {"Axis": (0.3, -0.5, 0.7)})
    bpy.ops.sunsplit.convert()
    in_map = directions_in_map(scene)
    turn = scene.world.node_tree.nodes[turn.name]
    others = {"Angle": 2.3, "Axis": (-0.3, 0.2, 0.9), "Rotation": (0.4, -1.2, 2.5)}
    assert set_inputs(turn, others)
    assert_lamps_are_where_the_map_shows_them(scene, in_map)


def test_several_rotations_and_a_mirror(scene, two_suns):
    texture = hdri_world(scene, two_suns)
    tree = texture.id_data
    mapping = add_mapping(texture)
    mapping.inputs["Scale"].default_value = (-2, 2, 2)
    turn = vector_rotate(texture, "AXIS_ANGLE")
    tree.links.new(mapping.outputs["Vector"], turn.inputs["Vector"])
    again = tree.nodes.new("ShaderNodeMapping")
    again.vector_type = "TEXTURE"
    tree.links.new(turn.outputs["Vector"], again.inputs["Vector"])
    again.inputs["Scale"].default_value = (3, 3, -3)
    tree.links.new(again.outputs["Vector"], texture.inputs["Vector"])
    texture.texture_mapping.rotation = (0.2, 0.4, 0.6)
    bpy.ops.sunsplit.convert()
    in_map = directions_in_map(scene)
    nodes = scene.world.node_tree.nodes
    nodes[mapping.name].inputs["Rotation"].default_value = (0.1, 0.2, 0.3)
    nodes[turn.name].inputs["Angle"].default_value = -1.5
    nodes[again.name].inputs["Rotation"].default_value = (-0.7, 0.5, 2.1)
    assert_lamps_are_where_the_map_shows_them(scene, in_map)


def test_angles_that_other_nodes_make(scene, two_suns):
    """Degrees from a Value, through Math and Combine XYZ."""
    mapping = add_mapping(hdri_world(scene, two_suns))
    tree = mapping.id_data
    degrees = tree.nodes.new("ShaderNodeValue")
    factor = tree.nodes.new("ShaderNodeMath")
    factor.operation = "MULTIPLY"
    factor.inputs[1].default_value = np.pi / 180
    together = tree.nodes.new("ShaderNodeCombineXYZ")
    tree.links.new(degrees.outputs[0], factor.inputs[0])
    tree.links.new(factor.outputs[0], together.inputs["Z"])
    tree.links.new(together.outputs[0], mapping.inputs["Rotation"])
    bpy.ops.sunsplit.convert()
    in_map = directions_in_map(scene)
    scene.world.node_tree.nodes[degrees.name].outputs[0].default_value = 77
    assert_lamps_are_where_the_map_shows_them(scene, in_map)


def test_an_angle_that_a_group_is_given(scene, two_suns):
    texture = hdri_world(scene, two_suns)
    tree = texture.id_data
    group = bpy.data.node_groups.new("Turn", "ShaderNodeTree")
    group.interface.new_socket("Angle", in_out="INPUT", socket_type="NodeSocketVector")
    group.interface.new_socket("Vector", in_out="OUTPUT", socket_type="NodeSocketVector")
    inner = group.nodes.new("ShaderNodeMapping")
    ends = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    coordinates = group.nodes.new("ShaderNodeTexCoord")
    group.links.new(coordinates.outputs["Generated"], inner.inputs["Vector"])
    group.links.new(ends[0].outputs[0], inner.inputs["Rotation"])
    group.links.new(inner.outputs[0], ends[1].inputs[0])
    outer = tree.nodes.new("ShaderNodeGroup")
    outer.node_tree = group
    tree.links.new(outer.outputs[0], texture.inputs["Vector"])
    bpy.ops.sunsplit.convert()
    in_map = directions_in_map(scene)
    scene.world.node_tree.nodes[outer.name].inputs[0].default_value = (0.3, 0.2, -2)
    assert_lamps_are_where_the_map_shows_them(scene, in_map)


def test_an_animated_rotation(scene, two_suns):
    mapping = add_mapping(hdri_world(scene, two_suns))
    rotation = mapping.inputs["Rotation"]
    for frame, angle in ((1, 0.0), (11, 2.0)):
        rotation.default_value[2] = angle
        rotation.keyframe_insert("default_value", frame=frame)
    scene.frame_set(1)
    bpy.ops.sunsplit.convert()
    in_map = directions_in_map(scene)
    for frame in (1, 5, 11):
        scene.frame_set(frame)
        assert_lamps_are_where_the_map_shows_them(scene, in_map)
    assert abs(to_light(suns(scene)[0])[0] - in_map[0][0]) > 0.1


def test_a_world_without_a_mapping_gets_one_that_stays(scene, two_suns):
    hdri_world(scene, two_suns)
    original = scene.world
    bpy.ops.sunsplit.convert()
    socket, component = rotation_control(scene.sunsplit)
    in_map = directions_in_map(scene)
    socket.default_value[component] = 1.0
    assert_lamps_are_where_the_map_shows_them(scene, in_map)
    bpy.ops.sunsplit.convert()
    socket, component = rotation_control(scene.sunsplit)
    assert socket.default_value[component] == 1.0
    assert len([n for n in scene.world.node_tree.nodes if n.type == "MAPPING"]) == 1
    assert_lamps_are_where_the_map_shows_them(scene, in_map)
    bpy.ops.sunsplit.restore()
    assert scene.world == original
    assert not any(n.type == "MAPPING" for n in original.node_tree.nodes)


def irradiance(scene):
    """Of each lamp, as renderers take it."""
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for lamp in suns(scene):
        data = lamp.evaluated_get(graph).data
        tint = np.array(data.temperature_color) if data.use_temperature else 1
        found.append(data.energy * 2**data.exposure * np.array(data.color) * tint)
    return np.array(found)


def test_the_strength_of_the_world(scene, two_suns):
    hdri_world(scene, two_suns)
    node(scene.world.node_tree, "BACKGROUND").inputs["Strength"].default_value = 0.7
    bpy.ops.sunsplit.convert()
    before = irradiance(scene)
    node(scene.world.node_tree, "BACKGROUND").inputs["Strength"].default_value = 1.4
    assert irradiance(scene) == pytest.approx(2 * before, rel=1e-6)
    bpy.ops.sunsplit.convert()
    assert irradiance(scene) == pytest.approx(2 * before, rel=1e-6)


def test_factors_of_all_suns(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    sky, before = scene.sunsplit.sky, irradiance(scene)
    measured = [lamp.data.angle for lamp in suns(scene)]
    assert all(not lamp.data.use_temperature for lamp in suns(scene))
    sky["strength"] = 3.0
    sky.update_tag()
    assert irradiance(scene) == pytest.approx(3 * before, rel=1e-6)
    sky["strength"], sky["softness"] = 1.0, 2.0
    sky.update_tag()
    bpy.context.view_layer.update()
    assert [lamp.data.angle for lamp in suns(scene)] == pytest.approx(
        [2 * angle for angle in measured], rel=1e-6
    )
    assert irradiance(scene) == pytest.approx(before, rel=1e-6)
    weights = [0.2126, 0.7152, 0.0722]
    for warmth in (-1.0, -0.3, 0.3, 1.0):
        sky["warmth"] = warmth
        sky.update_tag()
        tinted = irradiance(scene)
        ratio = tinted / before
        assert (np.sign(ratio[:, 0] - ratio[:, 2]) == np.sign(warmth)).all()
        # A white lamp keeps its luminance; of a red one more is left by a warm tint.
        white = ratio[0] @ weights
        assert white == pytest.approx(1, abs=2e-3)


def test_converting_again_keeps_the_factors_and_restore_forgets_them(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    scene.sunsplit.sky["strength"] = 2.0
    bpy.ops.sunsplit.convert(lights=1)
    assert scene.sunsplit.sky["strength"] == 2
    bpy.context.view_layer.update()
    assert suns(scene)[0].data.exposure == pytest.approx(1)
    bpy.ops.sunsplit.restore()
    bpy.ops.sunsplit.convert()
    assert scene.sunsplit.sky["strength"] == 1


def test_drivers_need_no_python(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    things = [scene.sunsplit.sky, *(lamp.data for lamp in suns(scene))]
    drivers = [curve.driver for thing in things for curve in thing.animation_data.drivers]
    assert len(drivers) == 3 + 4 * len(suns(scene))
    bpy.context.view_layer.update()
    assert all(driver.is_simple_expression and driver.is_valid for driver in drivers)


def test_what_hangs_on_the_sky_stays_when_it_goes(scene, two_suns):
    add_mapping(hdri_world(scene, two_suns)).inputs["Rotation"].default_value = (0, 0, 1)
    bpy.ops.sunsplit.convert()
    mine = suns(scene)[0].copy()
    scene.collection.objects.link(mine)
    before = to_light(mine)
    bpy.ops.sunsplit.restore()
    assert mine.parent is None
    assert to_light(mine) == pytest.approx(before, abs=ALIKE)
