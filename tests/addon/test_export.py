"""The light of a scene as files of other renderers: what a scene shows now is what they get."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import bpy
import numpy as np
import pytest

from sunsplit.addon.controls import rotation_control
from sunsplit.addon.exported import said_of
from sunsplit.addon.exporting import skylight_of_scene
from sunsplit.addon.world import find_light
from sunsplit.core import ConversionSettings, convert, load
from sunsplit.core.export.lookup import look_up
from sunsplit.core.export.settings import Format
from sunsplit.core.sphere import pixel_centres
from tests.blender import (
    add_mapping,
    add_mesh,
    camera_towards,
    diffuse,
    empty_world,
    fresh_scene,
    hdri_world,
    node,
    plate_mesh,
    render,
    suns,
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky

FORMATS = get_args(Format)

ALIKE = 3e-5
"""Of unit vectors, as in test_rig."""

HALF = 1e-3
"""Relative: residuals are stored as half floats."""


@pytest.fixture
def scene():
    return fresh_scene()


@pytest.fixture(scope="module")
def two_suns(tmp_path_factory):
    """A white and a red sun over a sky that has colours of its own in each direction."""
    v, u = np.indices((128, 256)) / 128 * np.pi
    waves = np.stack([np.sin(v / 2), np.sin(v) * np.sin(u), np.sin(v) * np.cos(3 * u + 5 * v)], -1)
    pixels = sky(256, 0.4) + 0.1 * waves
    paint_disc(pixels, direction(40, 30), 2, (900, 900, 900))
    paint_disc(pixels, direction(-100, 10), 3, (600, 100, 50))
    return write_map(tmp_path_factory.mktemp("maps") / "two suns.exr", pixels)


@pytest.fixture
def texture(scene, two_suns):
    """The environment texture of a converted world."""
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert(lights=2)
    return find_light(scene.world).texture.node


def background(scene) -> bpy.types.Node:
    return node(scene.world.node_tree, "BACKGROUND")


def turn_by(scene, angle: float) -> None:
    """By the panel's control."""
    socket, component = rotation_control(scene.sunsplit)
    socket.default_value[component] = angle


def what_the_world_shows(scene, folder: Path, width: int = 64) -> np.ndarray:
    """Cycles' panorama of what rays other than the camera's see, (width / 2, width, 3), one
    direction for each pixel; in the layout of `sphere`, about the scene's axes."""
    world = scene.world
    scene.world = world.copy()
    mix = scene.world.node_tree.nodes.get("Sunsplit: Use Residual")
    for link in list(mix.inputs[0].links) if mix else ():
        scene.world.node_tree.links.remove(link)
    camera = camera_towards(scene, np.array([0.0, 0, 1]), 60, width)
    camera.rotation_mode = "XYZ"
    camera.rotation_euler = np.pi / 2, 0, -np.pi / 2
    camera.data.type = "PANO"
    settings = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    settings.panorama_type = "EQUIRECTANGULAR"
    scene.render.resolution_y = width // 2
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    try:
        return render(scene, folder, samples=1)
    finally:
        shown, scene.world = scene.world, world
        bpy.data.worlds.remove(shown)
        bpy.data.objects.remove(camera)


def assert_the_map_is_what_the_world_shows(scene, folder: Path) -> None:
    seen = what_the_world_shows(scene, folder)
    height, width = seen.shape[:2]
    exported = skylight_of_scene(scene)
    assert np.linalg.det(exported.turn) == pytest.approx(1, abs=1e-6)
    in_map = pixel_centres(np.arange(width * height), width, height) @ exported.turn
    found = look_up(exported.radiance, in_map, exported.has_cells)
    assert len(found) > 1000
    assert seen.std() > 0.01
    assert np.allclose(found, seen.reshape(-1, 3), rtol=HALF, atol=1e-5)


def test_nothing_is_lost_of_a_conversion(scene, sunrise):
    hdri_world(scene, sunrise)
    bpy.ops.sunsplit.convert()
    expected = convert(load(sunrise), ConversionSettings(residual_width="lighting"))
    found = skylight_of_scene(scene)
    assert found.name == "spruit_sunrise_1k"
    assert np.array_equal(found.radiance, expected.residual)
    assert found.radiance.dtype == np.float32
    assert found.scalar_irradiance == pytest.approx(expected.account.source, rel=HALF)
    given = sum(sun.scalar_irradiance for sun in found.suns)
    assert given == pytest.approx(expected.account.suns, rel=1e-5)
    assert len(found.suns) == len(expected.suns)
    for sun, wanted in zip(found.suns, expected.suns, strict=True):
        assert sun.to_light == pytest.approx(wanted.to_light, abs=1e-6)
        assert sun.irradiance == pytest.approx(wanted.irradiance, rel=1e-5)
        assert sun.angular_diameter == pytest.approx(wanted.angular_diameter, rel=1e-6)


def test_a_scene_stays_as_it_is(scene, texture):
    residual = scene.world.node_tree.nodes["Sunsplit: Residual"].image
    before = sorted(thing.name for thing in bpy.data.images), residual.has_data
    skylight_of_scene(scene)
    assert (sorted(thing.name for thing in bpy.data.images), residual.has_data) == before
    assert not residual.is_dirty


def test_rotation_by_the_panel(scene, texture, tmp_path):
    before = skylight_of_scene(scene)
    turn_by(scene, 1.1)
    found = skylight_of_scene(scene)
    for sun, was, lamp in zip(found.suns, before.suns, suns(scene), strict=True):
        assert sun.to_light == pytest.approx(to_light(lamp), abs=ALIKE)
        assert found.turn.T @ sun.to_light == pytest.approx(was.to_light, abs=ALIKE)
        assert sun.to_light != pytest.approx(was.to_light, abs=0.1)
    assert_the_map_is_what_the_world_shows(scene, tmp_path)


def test_what_an_artist_changes(scene, texture):
    before = skylight_of_scene(scene)
    sky_ = scene.sunsplit.sky
    sky_["strength"], sky_["softness"] = 0.25, 3.0
    sky_.update_tag()
    for sun, was in zip(skylight_of_scene(scene).suns, before.suns, strict=True):
        assert sun.irradiance == pytest.approx(0.25 * was.irradiance, rel=1e-6)
        assert sun.angular_diameter == pytest.approx(3 * was.angular_diameter, rel=1e-6)
        half = sun.angular_diameter / 2
        facing = np.pi * np.sin(half) ** 2 * sun.radiance
        assert facing == pytest.approx(sun.irradiance, rel=1e-9)
    assert np.allclose(skylight_of_scene(scene).radiance, before.radiance, rtol=1e-6, atol=0)


def test_a_slider_at_0_leaves_no_suns(scene, texture):
    scene.sunsplit.sky["strength"] = 0.0
    scene.sunsplit.sky.update_tag()
    found = skylight_of_scene(scene)
    assert found.suns == ()
    assert found.radiance.any()


def plate_under_suns(scene, folder: Path, normal: np.ndarray) -> np.ndarray:
    """Irradiance, (3,), of a plate that faces a direction, from Cycles, without the world."""
    from mathutils import Vector

    facing = Vector(normal).to_track_quat("Z", "Y")
    plate = add_mesh(scene, plate_mesh(5), diffuse("Plate", 1.0), facing.to_matrix().to_4x4())
    camera = camera_towards(scene, -normal, 20, 8)
    camera.location = 5 * normal
    world, scene.world = scene.world, None
    scene.cycles.max_bounces = 0
    picture = render(scene, folder, samples=256)
    scene.world = world
    for thing in (plate, camera):
        bpy.data.objects.remove(thing)
    return picture.mean(axis=(0, 1)) * np.pi


def changed_by_hand(lamp: bpy.types.Object) -> None:
    """All that makes a lamp's strength, at once."""
    data = lamp.data
    data.driver_remove("use_temperature")
    data.driver_remove("temperature")
    data.driver_remove("exposure")
    data.driver_remove("angle")
    data.energy, data.color, data.exposure = 3.0, (0.9, 0.5, 0.2), -0.7
    data.use_temperature, data.temperature = True, 4200.0
    data.angle = 0.8


def with_nodes(data: bpy.types.Light) -> bpy.types.Node:
    """The Emission of a lamp that uses nodes."""
    if bpy.app.version < (5, 0):
        data.use_nodes = True
    return node(data.node_tree, "EMISSION")


@pytest.mark.parametrize("kind", ["as it was", "not normalised", "by nodes", "warm", "a point"])
def test_a_lamp_gives_what_cycles_renders(scene, texture, tmp_path, kind):
    lamp, other = suns(scene)
    other.hide_render = True
    if kind == "warm":
        scene.sunsplit.sky["warmth"] = 0.7
        scene.sunsplit.sky.update_tag()
    else:
        changed_by_hand(lamp)
    if kind == "not normalised":
        lamp.data.normalize = False
    if kind == "a point":
        lamp.data.angle, lamp.data.normalize = 0.0, False
    if kind == "by nodes":
        emission = with_nodes(lamp.data)
        emission.inputs["Strength"].default_value = 2.5
        emission.inputs["Color"].default_value = (0.3, 0.6, 0.9, 1)
    (sun,) = skylight_of_scene(scene).suns
    found = plate_under_suns(scene, tmp_path, to_light(lamp))
    assert sun.irradiance == pytest.approx(found, rel=1e-4)
    if kind == "warm":
        assert sun.irradiance[0] > 2 * sun.irradiance[2]


def test_lamps_that_do_more_than_shine_are_refused(scene, texture):
    lamp = suns(scene)[0]
    emission = with_nodes(lamp.data)
    falloff = lamp.data.node_tree.nodes.new("ShaderNodeLightFalloff")
    lamp.data.node_tree.links.new(falloff.outputs[0], emission.inputs["Strength"])
    with pytest.raises(RuntimeError, match=r"nodes of the lamp .Sun 1 \(.*\). do more"):
        bpy.ops.sunsplit.export(directory="/nowhere")
    falloff.id_data.nodes.remove(falloff)
    lamp.data.energy = -1
    with pytest.raises(RuntimeError, match="has a negative strength"):
        bpy.ops.sunsplit.export(directory="/nowhere")


def test_lamps_that_are_not_rendered_are_not_there(scene, texture):
    first, second = suns(scene)
    wanted = {sun.irradiance.tobytes() for sun in skylight_of_scene(scene).suns}
    assert len(wanted) == 2
    first.hide_viewport = True
    second.hide_set(True)
    assert {sun.irradiance.tobytes() for sun in skylight_of_scene(scene).suns} == wanted
    first.hide_render = True
    assert len(skylight_of_scene(scene).suns) == 1
    scene.sunsplit.collection.hide_render = True
    assert skylight_of_scene(scene).suns == ()
    scene.sunsplit.collection.hide_render = first.hide_render = False
    layer = bpy.context.view_layer.layer_collection.children[scene.sunsplit.collection.name]
    layer.exclude = True
    assert skylight_of_scene(scene).suns == ()
    layer.exclude = False
    bpy.data.objects.remove(first)
    assert len(skylight_of_scene(scene).suns) == 1
    second.data.type = "POINT"
    assert skylight_of_scene(scene).suns == ()


def test_lamps_hidden_in_the_viewport_follow_too(scene, texture):
    first, second = suns(scene)
    first.hide_viewport = True
    second.hide_set(True)
    turn_by(scene, -0.8)
    scene.sunsplit.sky["strength"] = 2.0
    scene.sunsplit.sky.update_tag()
    hidden = skylight_of_scene(scene)
    first.hide_viewport = False
    second.hide_set(False)
    for found, shown in zip(hidden.suns, skylight_of_scene(scene).suns, strict=True):
        assert found.to_light == pytest.approx(shown.to_light, abs=1e-7)
        assert found.irradiance == pytest.approx(shown.irradiance, rel=1e-7)


def test_two_passes_are_one_sky(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert(lights=2)
    one = skylight_of_scene(scene)
    bpy.ops.sunsplit.convert(lights=2, two_passes=True)
    turn_by(scene, 0.5)
    two = skylight_of_scene(scene)
    assert len(two.suns) == 2
    assert two.scalar_irradiance == pytest.approx(one.scalar_irradiance, rel=1e-6)
    for lamp, sun in zip(suns(scene), two.suns, strict=True):
        assert to_light(lamp) == pytest.approx(sun.to_light, abs=ALIKE)


def test_a_tinted_world_that_gets_stronger_by_keyframes(scene, two_suns, tmp_path):
    texture = hdri_world(scene, two_suns)
    tree = texture.id_data
    tint = tree.nodes.new("ShaderNodeMix")
    tint.data_type, tint.blend_type = "RGBA", "MULTIPLY"
    tint.inputs[0].default_value, tint.inputs[7].default_value = 1.0, (0.5, 1.5, 2.0, 1)
    tree.links.new(texture.outputs[0], tint.inputs[6])
    tree.links.new(tint.outputs[2], background(scene).inputs["Color"])
    strength = background(scene).inputs["Strength"]
    for frame, value in ((1, 1.0), (11, 3.0)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    scene.frame_set(1)
    bpy.ops.sunsplit.convert(lights=2)
    before = skylight_of_scene(scene)
    expected = convert(load(two_suns), ConversionSettings(lights=2))
    tinted = expected.account.source * (0.5, 1.5, 2.0)
    assert before.scalar_irradiance == pytest.approx(tinted, rel=HALF)
    assert_the_map_is_what_the_world_shows(scene, tmp_path)
    scene.frame_set(11)
    after = skylight_of_scene(scene)
    assert after.scalar_irradiance == pytest.approx(3 * before.scalar_irradiance, rel=1e-5)
    assert_the_map_is_what_the_world_shows(scene, tmp_path)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1), (2, 2, 2)])
def test_mirrored_and_tilted_mappings(scene, two_suns, tmp_path, scale):
    mapping = add_mapping(hdri_world(scene, two_suns))
    mapping.inputs["Scale"].default_value = scale
    mapping.inputs["Rotation"].default_value = 0.3, -0.7, 2.0
    bpy.ops.sunsplit.convert(lights=2)
    assert_the_map_is_what_the_world_shows(scene, tmp_path)
    for lamp, sun in zip(suns(scene), skylight_of_scene(scene).suns, strict=True):
        assert sun.to_light == pytest.approx(to_light(lamp), abs=ALIKE)


def test_a_voronoi_map_keeps_its_cells(scene, two_suns, tmp_path):
    # Tilted, as else rays would meet the edges of pixels, where rounding decides.
    add_mapping(hdri_world(scene, two_suns)).inputs["Rotation"].default_value = 0.3, -0.7, 2.0
    bpy.ops.sunsplit.convert(lights=2, residual="voronoi", residual_samples=40)
    assert skylight_of_scene(scene).has_cells
    seen, found = what_the_world_shows(scene, tmp_path), skylight_of_scene(scene)
    in_map = pixel_centres(np.arange(seen.size // 3), seen.shape[1], seen.shape[0]) @ found.turn
    shown = look_up(found.radiance, in_map, found.has_cells)
    same = np.isclose(shown, seen.reshape(-1, 3), rtol=HALF, atol=1e-5).all(axis=-1)
    assert same.mean() > 0.999


def test_lamps_only(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert(lights=2, residual="none")
    found = skylight_of_scene(scene)
    assert found.radiance is None
    assert len(found.suns) == 2
    assert found.name == "two suns"


def test_a_world_only(scene, texture, tmp_path):
    for lamp in suns(scene):
        bpy.data.objects.remove(lamp)
    assert skylight_of_scene(scene).suns == ()
    bpy.ops.sunsplit.export(directory=str(tmp_path), format="pbrt")
    assert (tmp_path / "two suns.pbrt.exr").is_file()


def test_no_light_at_all(scene, texture, tmp_path):
    background(scene).inputs["Strength"].default_value = 0
    with pytest.raises(RuntimeError, match="nothing to export"):
        bpy.ops.sunsplit.export(directory=str(tmp_path), format="pbrt")
    assert list(tmp_path.iterdir()) == []


def test_a_black_residual_is_no_failure(scene, two_suns):
    hdri_world(scene, two_suns)
    bpy.ops.sunsplit.convert(share_auto=False, share=1.0, lights=4)
    found = skylight_of_scene(scene)
    assert len(found.suns) == 4
    assert found.radiance is None or not found.radiance.any()


def test_a_plain_light_beside_the_map(scene, texture, tmp_path):
    """The artist adds some blue from everywhere."""
    before = skylight_of_scene(scene)
    tree = scene.world.node_tree
    blue, both = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeAddShader")
    blue.inputs["Color"].default_value, blue.inputs["Strength"].default_value = (0.1, 0.2, 1, 1), 2
    surface = node(tree, "OUTPUT_WORLD").inputs["Surface"]
    tree.links.new(surface.links[0].from_socket, both.inputs[0])
    tree.links.new(blue.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], surface)
    added = skylight_of_scene(scene).scalar_irradiance - before.scalar_irradiance
    assert added == pytest.approx(4 * np.pi * np.array([0.2, 0.4, 2]), rel=1e-5)
    assert_the_map_is_what_the_world_shows(scene, tmp_path)


def test_another_world_in_place_of_the_converted_one(scene, texture):
    tree = empty_world(scene)
    node(tree, "BACKGROUND").inputs["Color"].default_value = 0.1, 0.2, 0.3, 1
    found = skylight_of_scene(scene)
    assert found.name == scene.world.name
    assert found.radiance.reshape(-1, 3).max(axis=0) == pytest.approx([0.1, 0.2, 0.3])
    assert len(found.suns) == 2
    scene.world = None
    assert skylight_of_scene(scene).radiance is None


def test_another_image_in_place_of_the_residual(scene, texture, tmp_path):
    """Once as a file, once painted, once packed in a format that is not ours."""
    shown = scene.world.node_tree.nodes["Sunsplit: Residual"]
    pixels = sky(64, (0.1, 0.5, 2.0))
    shown.image = bpy.data.images.load(str(write_map(tmp_path / "blue.exr", pixels)))
    assert skylight_of_scene(scene).radiance == pytest.approx(pixels, rel=1e-6)
    shown.image.pixels[0] = 9.0
    assert shown.image.is_dirty
    assert skylight_of_scene(scene).radiance[-1, 0, 0] == pytest.approx(9)
    assert skylight_of_scene(scene).name == "two suns"
    plain = bpy.data.images.new("drawing", 64, 32)
    shown.image = plain
    with pytest.raises(RuntimeError, match="LDR image"):
        bpy.ops.sunsplit.export(directory=str(tmp_path / "out"))
    shown.image = bpy.data.images.load(str(write_map(tmp_path / "square.exr", pixels[:, :32])))
    with pytest.raises(RuntimeError, match="not 2:1"):
        bpy.ops.sunsplit.export(directory=str(tmp_path / "out"))
    pixels[3, 4] = -1
    shown.image = bpy.data.images.load(str(write_map(tmp_path / "dark.exr", pixels)))
    with pytest.raises(RuntimeError, match="what is no light"):
        bpy.ops.sunsplit.export(directory=str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_residual_that_is_lost(scene, texture, tmp_path):
    shown = scene.world.node_tree.nodes["Sunsplit: Residual"]
    shown.image.unpack(method="REMOVE")
    shown.image.filepath = str(tmp_path / "gone.exr")
    with pytest.raises(RuntimeError, match="cannot be loaded"):
        bpy.ops.sunsplit.export(directory=str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_saved_and_opened_again(scene, texture, tmp_path):
    turn_by(scene, 0.9)
    scene.sunsplit.sky["strength"] = 0.5
    scene.sunsplit.sky.update_tag()
    before = skylight_of_scene(scene)
    bpy.ops.sunsplit.export(format="pbrt", directory=str(tmp_path / "before"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    after = skylight_of_scene(bpy.context.scene)
    assert after.name == before.name
    assert after.scalar_irradiance == pytest.approx(before.scalar_irradiance, rel=1e-6)
    assert (after.radiance == before.radiance).all()
    assert after.turn == pytest.approx(before.turn, abs=1e-7)
    # Beside the .blend, by what was chosen last.
    assert bpy.ops.sunsplit.export() == {"FINISHED"}
    for path in (tmp_path / "before").iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


@pytest.mark.parametrize("kind", FORMATS)
def test_each_format(scene, texture, tmp_path, kind, capfd):
    turn_by(scene, 0.9)
    assert bpy.ops.sunsplit.export(format=kind, directory=str(tmp_path / "new")) == {"FINISHED"}
    names = sorted(path.name for path in (tmp_path / "new").iterdir())
    assert len(names) >= 2
    stem = "two_suns-85c186" if kind == "povray" else "two suns"  # it reads no names with spaces
    assert all(name.startswith(f"{stem}.") for name in names)
    said = said_of(scene)
    assert said[0] == f"{len(names)} files written to {tmp_path / 'new'}"
    printed = capfd.readouterr().out
    assert all(sentence in printed for sentence in (said[0], *said[2:]))
    assert scene.sunsplit.export.format == kind


def test_a_name_and_settings(scene, texture, tmp_path):
    done = bpy.ops.sunsplit.export(
        format="mitsuba", up="z", discs="map", directory=str(tmp_path), filename="my/sky: 1"
    )
    assert done == {"FINISHED"}
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("my_sky_ 1.lights.xml", "my_sky_ 1.mitsuba.exr", "my_sky_ 1.scene.xml")
    ]
    again = tmp_path / "again"  # as who clicks on an older file in the file browser
    bpy.ops.sunsplit.export(directory=str(again), filename="my_sky_ 1.lights.xml")
    assert {path.name for path in again.iterdir()} < {path.name for path in tmp_path.iterdir()}
    text = (tmp_path / "my_sky_ 1.lights.xml").read_text()
    assert "Z up" in text
    assert "directional" not in text


def test_the_axis_of_other_formats_does_not_disturb_gltf(scene, texture, tmp_path):
    scene.sunsplit.export.up = "z"
    assert bpy.ops.sunsplit.export(format="gltf", directory=str(tmp_path)) == {"FINISHED"}
    assert scene.sunsplit.export.up == "z"


def test_what_cannot_be_is_said(scene, texture, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RuntimeError, match=r"it is a file\. Nothing was changed"):
        bpy.ops.sunsplit.export(format="pbrt", directory=str(tmp_path / "file"))
    with pytest.raises(RuntimeError, match="Say into which folder"):
        bpy.ops.sunsplit.export(format="pbrt")
    with pytest.raises(RuntimeError, match="glTF is Y up"):
        bpy.ops.sunsplit.export(format="gltf", up="z", directory=str(tmp_path))
    with pytest.raises(TypeError, match="enum"):
        bpy.ops.sunsplit.export(format="renderman", directory=str(tmp_path))
    tree = scene.world.node_tree
    gradient = tree.nodes.new("ShaderNodeTexGradient")
    tree.links.new(gradient.outputs[0], background(scene).inputs["Strength"])
    with pytest.raises(RuntimeError, match="not one value for the whole map"):
        bpy.ops.sunsplit.export(format="pbrt", directory=str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert said_of(scene) == []
    assert scene.sunsplit.export.format == "usd"


def test_a_scene_that_is_not_converted(scene):
    empty_world(scene)
    with pytest.raises(RuntimeError, match="not converted"):
        bpy.ops.sunsplit.export(directory="/nowhere")


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="before 5.0 Blender works in Rec.709")
@pytest.mark.parametrize("when", ["after", "before"])
def test_another_working_space_gives_the_same_light(scene, sunrise, when):
    """Files are in Rec.709 whatever Blender works in when it converts and when it exports."""
    hdri_world(scene, sunrise)
    if when == "before":
        bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    bpy.ops.sunsplit.convert()
    if when == "after":
        bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    source = load(sunrise).scalar_irradiance
    assert skylight_of_scene(scene).scalar_irradiance == pytest.approx(source, rel=2e-5)
