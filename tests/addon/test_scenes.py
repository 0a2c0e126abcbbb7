"""What artists do before, between and after conversions: nothing of theirs is lost."""

from __future__ import annotations

import tempfile

import bpy
import numpy as np
import pytest

from tests.addon.test_convert import inventory, world_state
from tests.blender import add_mapping, fresh_scene, hdri_world, node, suns, to_light, write_map
from tests.maps import direction, paint_disc, sky


@pytest.fixture
def scene():
    return fresh_scene()


def one_sun(folder, name, azimuth):
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(azimuth, 30), 4, (900, 900, 900))
    return write_map(folder / name, pixels)


@pytest.fixture(scope="module")
def east(tmp_path_factory):
    return one_sun(tmp_path_factory.mktemp("maps"), "east.exr", 0)


@pytest.fixture(scope="module")
def north(tmp_path_factory):
    return one_sun(tmp_path_factory.mktemp("maps"), "north.exr", 90)


def azimuth_of(lamp):
    x, y, _ = to_light(lamp)
    return np.degrees(np.arctan2(y, x))


def test_a_converted_world_that_was_turned_is_converted_as_it_stands(scene, east):
    original = add_mapping(hdri_world(scene, east))
    world = scene.world
    bpy.ops.sunsplit.convert()
    turned = node(scene.world.node_tree, "MAPPING")
    turned.inputs["Rotation"].default_value[2] = 0.5
    bpy.ops.sunsplit.convert()
    (lamp,) = suns(scene)
    assert azimuth_of(lamp) == pytest.approx(-np.degrees(0.5), abs=0.1)
    assert len([n for n in scene.world.node_tree.nodes if n.type == "MIX"]) == 1
    bpy.ops.sunsplit.restore()
    assert scene.world == world
    assert original.inputs["Rotation"].default_value[2] == 0


def test_another_map_in_the_converted_world_is_taken(scene, east, north):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    shown = [n for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT"]
    texture = next(n for n in shown if "Sunsplit" not in n.name)
    texture.image = bpy.data.images.load(str(north))
    bpy.ops.sunsplit.convert()
    assert azimuth_of(suns(scene)[0]) == pytest.approx(90, abs=0.1)


def test_a_world_chosen_after_a_conversion_becomes_the_original(scene, east, north):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    hdri_world(scene, north)
    chosen = scene.world
    bpy.ops.sunsplit.convert()
    assert azimuth_of(suns(scene)[0]) == pytest.approx(90, abs=0.1)
    assert len(bpy.data.lights) == 1
    bpy.ops.sunsplit.restore()
    assert scene.world == chosen


def test_a_linked_copy_of_the_scene_keeps_its_light(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    bpy.ops.scene.new(type="LINK_COPY")
    copy = bpy.context.scene
    assert copy != scene
    with bpy.context.temp_override(scene=scene):
        bpy.ops.sunsplit.restore()
    assert copy.world is not None
    assert copy.world.get("sunsplit")
    assert [thing for thing in copy.objects if thing.type == "LIGHT"]
    assert not [thing for thing in scene.objects if thing.type == "LIGHT"]
    with bpy.context.temp_override(scene=copy):
        bpy.ops.sunsplit.restore()
    assert not copy.world.get("sunsplit")
    assert not bpy.data.lights


def test_a_copy_of_a_lamp_is_the_users(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    mine = suns(scene)[0].copy()
    mine.data = mine.data.copy()
    scene.collection.objects.link(mine)
    bpy.ops.sunsplit.restore()
    assert [thing for thing in scene.objects if thing.type == "LIGHT"] == [mine]


def test_a_view_layer_that_overrides_with_the_same_world_follows(scene, east):
    hdri_world(scene, east)
    world = scene.world
    scene.view_layers[0].world_override = world
    bpy.ops.sunsplit.convert()
    assert scene.view_layers[0].world_override == scene.world != world
    bpy.ops.sunsplit.restore()
    assert scene.view_layers[0].world_override == world


def test_a_view_layer_with_another_world_is_named(scene, east):
    hdri_world(scene, east)
    scene.view_layers[0].world_override = bpy.data.worlds.new("Other")
    bpy.ops.sunsplit.convert()
    assert "world of its own" in scene.sunsplit.report


def test_lamps_do_to_each_kind_of_ray_what_the_world_does(scene, east):
    hdri_world(scene, east)
    world = scene.world
    world.cycles_visibility.diffuse = world.cycles_visibility.scatter = False
    world.cycles.max_bounces = 3
    world.lightgroup = "Sky"
    bpy.ops.sunsplit.convert()
    (lamp,) = suns(scene)
    assert not lamp.visible_diffuse
    assert not lamp.visible_volume_scatter
    assert lamp.visible_glossy
    assert lamp.data.cycles.max_bounces == 3
    assert lamp.lightgroup == "Sky"


@pytest.mark.parametrize("name", ["Rotation", "Scale"])
def test_an_animation_that_lamps_do_not_follow_is_named(scene, east, name):
    mapping = add_mapping(hdri_world(scene, east))
    bpy.ops.sunsplit.convert()
    assert "animated" not in scene.sunsplit.report
    bpy.ops.sunsplit.restore()
    mapping.inputs[name].keyframe_insert("default_value", frame=1)
    bpy.ops.sunsplit.convert()
    assert ("animated" in scene.sunsplit.report) == (name == "Scale")


def test_a_share_given_as_an_argument_counts(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert(share=0.9, lights=3)
    assert not scene.sunsplit.share_auto
    assert len(suns(scene)) == 3


def test_arguments_of_a_failed_conversion_are_forgotten(scene, east):
    hdri_world(scene, east).projection = "MIRROR_BALL"
    with pytest.raises(RuntimeError, match="mirror ball"):
        bpy.ops.sunsplit.convert(lights=3)
    assert scene.sunsplit.lights == 0


def test_without_its_original_a_world_is_turned_back(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    bpy.data.worlds.remove(scene.sunsplit.original_world)
    bpy.ops.sunsplit.restore()
    assert not bpy.data.lights
    tree = scene.world.node_tree
    assert [n.type for n in tree.nodes if n.name.startswith("Sunsplit")] == []
    source = node(tree, "BACKGROUND").inputs["Color"].links[0].from_node
    assert source.type == "TEX_ENVIRONMENT"
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 1


def test_a_converted_world_of_another_scene_is_refused(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    other = bpy.data.scenes.new("Other")
    other.world = scene.world
    with (
        bpy.context.temp_override(scene=other),
        pytest.raises(RuntimeError, match="already converted"),
    ):
        bpy.ops.sunsplit.convert()


def test_deleted_lamps_and_collection_do_not_stop_restore(scene, east):
    hdri_world(scene, east)
    before, things = world_state(scene.world), inventory()
    bpy.ops.sunsplit.convert()
    bpy.data.objects.remove(suns(scene)[0])
    bpy.data.collections.remove(scene.sunsplit.collection)
    bpy.ops.sunsplit.restore()
    assert world_state(scene.world) == before
    things_now = inventory()
    # The lamp's data is the user's own leftover: Blender drops it with the next save.
    things_now["lights"] = things["lights"]
    assert things_now == things


@pytest.mark.parametrize("earlier", [False, True], ids=["first", "again"])
def test_a_temporary_folder_that_cannot_be_written_changes_nothing(scene, east, earlier):
    hdri_world(scene, east)
    if earlier:
        bpy.ops.sunsplit.convert()
    before, things = world_state(scene.world), inventory()
    kept = tempfile.tempdir
    tempfile.tempdir = "/proc/nowhere"
    try:
        with pytest.raises(RuntimeError, match="Cannot make a temporary folder"):
            bpy.ops.sunsplit.convert()
    finally:
        tempfile.tempdir = kept
    assert (world_state(scene.world), inventory()) == (before, things)


def strength_of(scene):
    (lamp,) = suns(scene)
    return lamp.data.energy * np.array(lamp.data.color)


@pytest.fixture
def plain_strength(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert()
    return strength_of(scene)


def test_numbers_are_made_of_colours_as_cycles_does(plain_strength, east):
    scene = fresh_scene()
    tree = hdri_world(scene, east).id_data
    colour = tree.nodes.new("ShaderNodeRGB")
    colour.outputs[0].default_value = (2, 1, 0, 1)
    tree.links.new(colour.outputs[0], node(tree, "BACKGROUND").inputs["Strength"])
    bpy.ops.sunsplit.convert()
    gain = 0.2126 * 2 + 0.7152
    assert strength_of(scene) == pytest.approx(plain_strength * gain, rel=1e-3)


def test_a_mix_clamps_its_factor(plain_strength, east):
    scene = fresh_scene()
    texture = hdri_world(scene, east)
    tree = texture.id_data
    mix, two = tree.nodes.new("ShaderNodeMix"), tree.nodes.new("ShaderNodeValue")
    mix.data_type = "RGBA"
    two.outputs[0].default_value = 2
    tree.links.new(two.outputs[0], mix.inputs[0])
    tree.links.new(texture.outputs[0], mix.inputs[7])
    tree.links.new(mix.outputs[2], node(tree, "BACKGROUND").inputs["Color"])
    bpy.ops.sunsplit.convert()
    assert strength_of(scene) == pytest.approx(plain_strength, rel=1e-6)


def test_value_of_a_hue_saturation_node_is_a_strength(plain_strength, east):
    scene = fresh_scene()
    texture = hdri_world(scene, east)
    tree = texture.id_data
    change = tree.nodes.new("ShaderNodeHueSaturation")
    change.inputs["Value"].default_value = 1.5
    tree.links.new(texture.outputs[0], change.inputs["Color"])
    tree.links.new(change.outputs[0], node(tree, "BACKGROUND").inputs["Color"])
    bpy.ops.sunsplit.convert()
    assert strength_of(scene) == pytest.approx(plain_strength * 1.5, rel=1e-6)


def test_a_mapping_without_coordinates_is_refused(scene, east):
    texture = hdri_world(scene, east)
    tree = texture.id_data
    mapping = tree.nodes.new("ShaderNodeMapping")
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    with pytest.raises(RuntimeError, match="nothing linked to its Vector"):
        bpy.ops.sunsplit.convert()


def test_the_output_of_the_engine_in_use_counts(scene, east, north):
    tree = hdri_world(scene, east).id_data
    node(tree, "OUTPUT_WORLD").target = "CYCLES"
    second, background = (
        tree.nodes.new("ShaderNodeTexEnvironment"),
        tree.nodes.new("ShaderNodeBackground"),
    )
    second.image = bpy.data.images.load(str(north))
    output = tree.nodes.new("ShaderNodeOutputWorld")
    output.target = "EEVEE"
    tree.links.new(second.outputs[0], background.inputs["Color"])
    tree.links.new(background.outputs[0], output.inputs[0])
    eevee = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    for engine, azimuth in (("CYCLES", 0), (eevee, 90)):
        scene.render.engine = engine
        bpy.ops.sunsplit.convert()
        # For EEVEE the sky is in lamps too, and a wide sun may be in several.
        x, y, _ = sum(lamp.data.energy * np.array(to_light(lamp)) for lamp in suns(scene))
        assert np.degrees(np.arctan2(y, x)) == pytest.approx(azimuth, abs=0.1)
        bpy.ops.sunsplit.restore()


def test_a_narrower_residual(scene, east):
    hdri_world(scene, east)
    bpy.ops.sunsplit.convert(residual_width=32)
    image = scene.world.node_tree.nodes["Sunsplit: Residual"].image
    assert tuple(image.size) == (32, 16)
