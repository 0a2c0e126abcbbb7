"""Converting and restoring a scene's world."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from sunsplit.core import ConversionSettings, convert, load, map_warnings
from tests.blender import (
    add_mapping,
    empty_world,
    fresh_scene,
    hdri_world,
    node,
    plate_mesh,
    suns,
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky


@pytest.fixture
def scene():
    return fresh_scene()


@pytest.fixture(scope="module")
def two_suns(tmp_path_factory):
    """A small map with a white and a red sun."""
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(40, 30), 2, (900, 900, 900))
    paint_disc(pixels, direction(-100, 10), 3, (600, 100, 50))
    return write_map(tmp_path_factory.mktemp("maps") / "two suns.exr", pixels)


def inventory() -> dict[str, list[str]]:
    """Names of all data-blocks of a file, by kind."""
    kinds = ("worlds", "lights", "objects", "images", "collections", "node_groups", "meshes")
    return {kind: sorted(thing.name for thing in getattr(bpy.data, kind)) for kind in kinds}


def world_state(world: bpy.types.World) -> dict:
    """All that can be seen of a world."""
    tree = world.node_tree
    return {
        "name": world.name,
        "sampling": (world.cycles.sampling_method, world.cycles.sample_map_resolution),
        "threshold": world.sun_threshold,
        "nodes": sorted((n.name, n.type, tuple(n.location)) for n in tree.nodes),
        "links": sorted(
            (link.from_node.name, link.from_socket.identifier, link.to_node.name)
            for link in tree.links
        ),
    }


def test_the_operator_gives_what_the_function_gives(scene, sunrise):
    hdri_world(scene, sunrise)
    assert bpy.ops.sunsplit.convert(lights=3) == {"FINISHED"}
    expected = convert(load(sunrise), ConversionSettings(lights=3))
    lamps = suns(scene)
    assert len(lamps) == len(expected.suns)
    for lamp, sun in zip(lamps, expected.suns, strict=True):
        irradiance = lamp.data.energy * np.array(lamp.data.color)
        assert irradiance == pytest.approx(sun.irradiance, rel=1e-6)
        assert to_light(lamp) == pytest.approx(sun.to_light, abs=1e-6)
        assert lamp.data.angle == pytest.approx(sun.angular_diameter, rel=1e-6)


def test_the_panel_says_once_what_is_odd_about_a_map(scene, tmp_path, sunrise):
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(40, 30), 3, 900)
    flat = write_map(tmp_path / "flat.exr", pixels)
    hdri_world(scene, flat)
    bpy.ops.sunsplit.convert()
    sentences = scene.sunsplit.report.splitlines()
    expected = map_warnings(load(flat))
    assert "are flat at" in expected[0]
    assert [line for line in sentences if line in expected] == list(expected)
    hdri_world(scene, sunrise)
    bpy.ops.sunsplit.convert()
    assert "are flat at" not in scene.sunsplit.report


@pytest.mark.parametrize("skips", [True, False])
def test_the_residual_in_the_world_is_the_functions(scene, sunrise, skips):
    hdri_world(scene, sunrise)
    bpy.ops.sunsplit.convert(skips=skips)
    image = scene.world.node_tree.nodes["Sunsplit: Residual"].image
    width = 256 if skips else 1024
    pixels = np.empty(width * width // 2 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    found = pixels.reshape(width // 2, width, 4)[::-1, :, :3]
    enough = ConversionSettings(residual_width="lighting" if skips else None)
    expected = convert(load(sunrise), enough).residual
    # A wide one is stored as half floats, as nothing in it is brighter than they reach.
    rounded = {"rtol": 0, "atol": 0} if skips else {"rtol": 5e-4, "atol": 1e-7}
    np.testing.assert_allclose(found, expected, **rounded)
    assert image.packed_file is not None


def test_lamps_lie_in_their_collection_and_are_set_up_whole(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    collection = bpy.data.collections["Sunsplit Suns"]
    assert collection.name in scene.collection.children
    assert [lamp.name for lamp in suns(scene)] == ["Sun 1 (34 %)", "Sun 2 (17 %)"]
    assert all(lamp.data.name == lamp.name for lamp in suns(scene))
    for lamp in suns(scene):
        assert lamp.data.type == "SUN"
        assert not lamp.visible_camera
        assert lamp.visible_glossy
        assert lamp.visible_transmission
        assert lamp.visible_diffuse
        assert lamp.visible_volume_scatter
        assert lamp.data.use_shadow
        assert lamp.data.exposure == 0
        assert lamp.data.cycles.use_multiple_importance_sampling
    assert scene.world.sun_threshold == 0


def test_settings_come_from_the_scene_and_from_arguments(scene, two_suns):
    hdri_world(scene, two_suns)
    scene.sunsplit.lights = 1
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 1
    bpy.ops.sunsplit.convert(lights=5)
    assert 2 <= len(suns(scene)) <= 5
    assert scene.sunsplit.lights == 5


def test_residual_none_leaves_only_lamps(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert(share_auto=False, share=1.0, lights=4)
    assert len(suns(scene)) == 4
    assert "Sunsplit: Residual" not in scene.world.node_tree.nodes


def test_restore_brings_back_the_world_and_removes_everything(scene, two_suns):
    texture = hdri_world(scene, two_suns)
    scene.world.cycles.sampling_method = "MANUAL"
    scene.world.cycles.sample_map_resolution = 777
    scene.world.sun_threshold = 3.5
    add_mapping(texture).inputs["Rotation"].default_value = (0.1, 0.2, 0.3)
    before, world, things = world_state(scene.world), scene.world, inventory()
    bpy.ops.sunsplit.convert()
    assert inventory() != things
    assert scene.world != world
    assert bpy.ops.sunsplit.restore() == {"FINISHED"}
    assert scene.world == world
    assert world_state(world) == before
    assert inventory() == things


def test_restore_after_saving_and_opening_again(scene, two_suns, tmp_path):
    hdri_world(scene, two_suns)
    before, things = world_state(scene.world), inventory()
    bpy.ops.sunsplit.convert()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    residual = scene.world.node_tree.nodes["Sunsplit: Residual"].image
    assert tuple(residual.size) == (256, 128)
    assert len(suns(scene)) == 2
    bpy.ops.sunsplit.restore()
    assert world_state(scene.world) == before
    assert inventory() == things


def test_twice_is_once(scene, two_suns):
    texture = hdri_world(scene, two_suns)
    add_mapping(texture).inputs["Rotation"].default_value[2] = 0.7
    bpy.ops.sunsplit.convert()
    once = inventory(), world_state(scene.world), [tuple(to_light(lamp)) for lamp in suns(scene)]
    bpy.ops.sunsplit.convert()
    again = inventory(), world_state(scene.world), [tuple(to_light(lamp)) for lamp in suns(scene)]
    assert again == once


def test_restore_keeps_what_the_user_has_put_into_the_collection(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    own = bpy.data.objects.new("Mine", plate_mesh(1))
    scene.sunsplit.collection.objects.link(own)
    bpy.ops.sunsplit.restore()
    assert own.name in scene.collection.objects
    assert "Sunsplit Suns" not in bpy.data.collections


def test_a_lamp_moved_to_another_collection_is_removed_too(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    lamp = suns(scene)[0]
    scene.sunsplit.collection.objects.unlink(lamp)
    scene.collection.objects.link(lamp)
    bpy.ops.sunsplit.restore()
    assert not [thing for thing in bpy.data.objects if thing.type == "LIGHT"]


def test_a_world_shared_by_two_scenes_is_left_alone_in_the_other(scene, two_suns):
    hdri_world(scene, two_suns)
    other = bpy.data.scenes.new("Other")
    other.world = scene.world
    before = world_state(scene.world)
    bpy.ops.sunsplit.convert()
    assert world_state(other.world) == before
    assert other.world != scene.world


def test_a_packed_image(scene, two_suns, tmp_path):
    copy = tmp_path / "gone.exr"
    copy.write_bytes(two_suns.read_bytes())
    texture = hdri_world(scene, copy)
    texture.image.pack()
    copy.unlink()
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 2


def test_a_relative_path(scene, two_suns, tmp_path):
    (tmp_path / "textures").mkdir()
    (tmp_path / "textures" / "map.exr").write_bytes(two_suns.read_bytes())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    texture = hdri_world(bpy.context.scene, tmp_path / "textures" / "map.exr")
    texture.image.filepath = "//textures/map.exr"
    bpy.ops.sunsplit.convert()
    assert len(suns(bpy.context.scene)) == 2


def test_a_generated_image(scene):
    texture = hdri_world_from_pixels(scene)
    assert texture.image.source == "GENERATED"
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 1


def hdri_world_from_pixels(scene):
    pixels = sky(128, 0.2)
    paint_disc(pixels, direction(0, 45), 4, (500, 500, 500))
    image = bpy.data.images.new("Painted", 128, 64, float_buffer=True)
    image.pixels.foreach_set(np.dstack([pixels[::-1], np.ones((64, 128))]).astype("f").ravel())
    tree = empty_world(scene)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs[0], node(tree, "BACKGROUND").inputs["Color"])
    return texture


def break_nothing(scene):
    empty_world(scene)


def break_image(scene):
    tree = empty_world(scene)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    tree.links.new(texture.outputs[0], node(tree, "BACKGROUND").inputs["Color"])


def break_missing(scene):
    break_image(scene)
    path = "/nowhere/missing.exr"
    image = bpy.data.images.new("missing.exr", 8, 4)
    image.source, image.filepath = "FILE", path
    node(scene.world.node_tree, "TEX_ENVIRONMENT").image = image


def break_square(scene):
    break_image(scene)
    image = bpy.data.images.new("Square", 64, 64, float_buffer=True)
    image.generated_color = (1, 1, 1, 1)
    node(scene.world.node_tree, "TEX_ENVIRONMENT").image = image


def break_ldr(scene):
    break_image(scene)
    image = bpy.data.images.new("Photo", 64, 32)
    node(scene.world.node_tree, "TEX_ENVIRONMENT").image = image


def break_colour_space(scene):
    hdri_world_from_pixels(scene).image.colorspace_settings.name = "sRGB"


def break_mirror_ball(scene):
    hdri_world_from_pixels(scene).projection = "MIRROR_BALL"


def break_stretch(scene):
    add_mapping(hdri_world_from_pixels(scene)).inputs["Scale"].default_value = (2, 1, 1)


def break_shift(scene):
    add_mapping(hdri_world_from_pixels(scene)).inputs["Location"].default_value = (0, 0, 0.5)


def break_noise(scene):
    mapping = add_mapping(hdri_world_from_pixels(scene))
    noise = mapping.id_data.nodes.new("ShaderNodeTexNoise")
    mapping.id_data.links.new(noise.outputs["Color"], mapping.inputs["Rotation"])


def break_contrast(scene):
    texture = hdri_world_from_pixels(scene)
    tree = texture.id_data
    gamma = tree.nodes.new("ShaderNodeGamma")
    gamma.inputs["Gamma"].default_value = 2
    tree.links.new(texture.outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], node(tree, "BACKGROUND").inputs["Color"])


def break_two(scene):
    tree = hdri_world_from_pixels(scene).id_data
    second = tree.nodes.new("ShaderNodeTexEnvironment")
    mix = tree.nodes.new("ShaderNodeAddShader")
    background = tree.nodes.new("ShaderNodeBackground")
    tree.links.new(second.outputs[0], background.inputs["Color"])
    tree.links.new(node(tree, "BACKGROUND").outputs[0], mix.inputs[0])
    tree.links.new(background.outputs[0], mix.inputs[1])
    tree.links.new(mix.outputs[0], node(tree, "OUTPUT_WORLD").inputs["Surface"])


@pytest.mark.parametrize(
    ("breaking", "sentence"),
    [
        (break_nothing, "No environment texture lights"),
        (break_image, "has no image"),
        (break_missing, "cannot be loaded from /nowhere/missing.exr"),
        (break_square, "angular map"),
        (break_ldr, "LDR image"),
        (break_colour_space, "numbers are not light"),
        (break_mirror_ball, "mirror ball"),
        (break_stretch, "stretched by its mapping"),
        (break_shift, "shifts the map's directions"),
        (break_noise, "not one value"),
        (break_contrast, "Gamma"),
        (break_two, "Several environment textures"),
    ],
)
def test_bad_worlds_get_one_sentence_and_stay(scene, breaking, sentence):
    breaking(scene)
    before, things = world_state(scene.world), inventory()
    with pytest.raises(RuntimeError) as error:
        bpy.ops.sunsplit.convert()
    message = str(error.value).strip()
    assert sentence in message
    assert "\n" not in message
    assert scene.sunsplit.original_world is None
    assert (world_state(scene.world), inventory()) == (before, things)


def test_an_error_leaves_an_earlier_conversion_as_it_was(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert()
    node(scene.world.node_tree, "TEX_ENVIRONMENT").projection = "MIRROR_BALL"
    things = inventory()
    with pytest.raises(RuntimeError, match="mirror ball"):
        bpy.ops.sunsplit.convert()
    assert inventory() == things
    assert len(suns(scene)) == 2


def test_without_a_world_the_button_says_why(scene):
    scene.world = None
    assert not bpy.ops.sunsplit.convert.poll()


def test_restore_needs_a_conversion(scene, two_suns):
    hdri_world(scene, two_suns)
    assert not bpy.ops.sunsplit.restore.poll()


def test_strength_and_tint_reach_the_lamps(scene, two_suns):
    texture = hdri_world(scene, two_suns)
    tree = texture.id_data
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    mix.inputs[0].default_value = 0.5
    mix.inputs[7].default_value = (1, 0.5, 0, 1)
    tree.links.new(texture.outputs[0], mix.inputs[6])
    background = node(tree, "BACKGROUND")
    tree.links.new(mix.outputs[2], background.inputs["Color"])
    background.inputs["Strength"].default_value = 3
    bpy.ops.sunsplit.convert()
    expected = convert(load(two_suns)).suns
    for lamp, sun in zip(suns(scene), expected, strict=True):
        found = lamp.data.energy * np.array(lamp.data.color)
        assert found == pytest.approx(sun.irradiance * 3 * np.array([1, 0.75, 0.5]), rel=1e-6)


def test_a_background_for_the_camera_only_is_not_what_lights(scene, two_suns):
    texture = hdri_world(scene, two_suns)
    tree = texture.id_data
    lit = node(tree, "BACKGROUND")
    shown = tree.nodes.new("ShaderNodeBackground")
    path = tree.nodes.new("ShaderNodeLightPath")
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(lit.outputs[0], mix.inputs[1])
    tree.links.new(shown.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], node(tree, "OUTPUT_WORLD").inputs["Surface"])
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 2


def test_a_texture_inside_nested_groups(scene, two_suns):
    tree = empty_world(scene)
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    for group in (inner, outer):
        group.interface.new_socket("Strength", in_out="INPUT", socket_type="NodeSocketFloat")
        group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    texture = inner.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(two_suns))
    scale = inner.nodes.new("ShaderNodeVectorMath")
    scale.operation = "SCALE"
    given, result = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
    inner.links.new(texture.outputs[0], scale.inputs[0])
    inner.links.new(given.outputs["Strength"], scale.inputs["Scale"])
    inner.links.new(scale.outputs[0], result.inputs["Out"])
    nested = outer.nodes.new("ShaderNodeGroup")
    nested.node_tree = inner
    given, result = outer.nodes.new("NodeGroupInput"), outer.nodes.new("NodeGroupOutput")
    outer.links.new(given.outputs["Strength"], nested.inputs["Strength"])
    outer.links.new(nested.outputs["Out"], result.inputs["Out"])
    top = tree.nodes.new("ShaderNodeGroup")
    top.node_tree = outer
    top.inputs["Strength"].default_value = 2.5
    tree.links.new(top.outputs["Out"], node(tree, "BACKGROUND").inputs["Color"])
    things = inventory()
    bpy.ops.sunsplit.convert()
    expected = convert(load(two_suns)).suns
    for lamp, sun in zip(suns(scene), expected, strict=True):
        found = lamp.data.energy * np.array(lamp.data.color)
        assert found == pytest.approx(sun.irradiance * 2.5, rel=1e-6)
    assert "Sunsplit: Residual" not in inner.nodes
    bpy.ops.sunsplit.restore()
    assert inventory() == things


def test_one_undo_takes_it_back_and_redo_brings_it_again(scene, two_suns):
    hdri_world(scene, two_suns)
    world = scene.world.name
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.sunsplit.convert("EXEC_DEFAULT", True)
    bpy.ops.ed.undo()
    assert bpy.context.scene.world.name == world
    assert bpy.context.scene.sunsplit.original_world is None
    assert not bpy.data.lights
    bpy.ops.ed.redo()
    assert bpy.context.scene.world.name != world
    assert len(suns(bpy.context.scene)) == 2
