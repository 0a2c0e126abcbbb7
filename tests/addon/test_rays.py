"""Lamps for what reaches a surface that the camera sees, and for nothing else."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon.rays import Reach
from sunsplit.addon.scene_needs import needs_of
from sunsplit.addon.steps import run_at_once
from tests.blender import (
    add_mapping,
    add_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    node,
    plate_mesh,
    suns,
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky

ABOVE, BELOW = direction(40, 50), direction(-100, -50)


@pytest.fixture(scope="module")
def two_suns(tmp_path_factory):
    """A map with one sun above the ground and one below."""
    pixels = sky(256, 0.3)
    for towards in (ABOVE, BELOW):
        paint_disc(pixels, towards, 2, (900, 800, 700))
    return write_map(tmp_path_factory.mktemp("maps") / "two.exr", pixels)


@pytest.fixture
def scene(two_suns):
    """A wide ground, and a camera that looks down on it."""
    made = fresh_scene()
    hdri_world(made, two_suns)
    add_mesh(made, plate_mesh(1000), diffuse("Ground", 0.5), Matrix())
    camera_towards(made, np.array([1, 0, -1]), 40, 64).location = (0, 0, 3)
    bpy.context.view_layer.update()
    return made


def heights(scene):
    return sorted(to_light(lamp)[2] for lamp in suns(scene))


def ground(scene):
    return next(thing for thing in scene.objects if thing.type == "MESH")


def test_a_sun_below_the_ground_is_no_lamp_and_stays_in_the_world(scene):
    bpy.ops.sunsplit.convert()
    assert heights(scene) == pytest.approx([ABOVE[2]], abs=1e-3)
    assert "of the light reaches nothing that the camera shows" in scene.sunsplit.report
    image = scene.world.node_tree.nodes["Sunsplit: Residual"].image
    pixels = np.empty(256 * 128 * 4, np.float32)
    image.pixels.foreach_get(pixels)  # rows upwards
    pixels = pixels.reshape(128, 256, 4)[..., 0]
    assert pixels[:64].max() > 500
    assert pixels[64:].max() < 1
    bpy.ops.sunsplit.convert(skips=False)
    assert heights(scene) == pytest.approx([BELOW[2], ABOVE[2]], abs=1e-3)
    assert "reaches nothing" not in scene.sunsplit.report


def test_eevee_whose_world_shines_through_the_ground_gets_both_lamps(scene):
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    bpy.ops.sunsplit.convert(target="cycles")
    assert heights(scene) == pytest.approx([BELOW[2], ABOVE[2]], abs=1e-3)
    bpy.ops.sunsplit.convert(target="auto")  # and the sky as well
    for sun in (ABOVE, BELOW):
        # Of so many lamps one sun, which is a few pixels, may have two.
        near = [lamp for lamp in suns(scene) if to_light(lamp) @ sun > np.cos(np.radians(2))]
        middle = sum(lamp.data.energy * to_light(lamp) for lamp in near)
        assert middle @ sun > 0.9999 * np.linalg.norm(middle)


def test_what_is_visible_turns_with_the_world(scene):
    """Half a turn about X: the map's lower sun shines from above."""
    tree = scene.world.node_tree
    texture = next(n for n in tree.nodes if n.type == "TEX_ENVIRONMENT")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (np.pi, 0, 0)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    bpy.ops.sunsplit.convert()
    assert heights(scene) == pytest.approx([-BELOW[2]], abs=1e-3)


def let_light_through(scene):
    shader = next(iter(ground(scene).data.materials))
    tree = shader.node_tree
    leaf = tree.nodes.new("ShaderNodeBsdfTranslucent")
    output = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
    tree.links.new(leaf.outputs[0], output.inputs["Surface"])


def cast_no_shadow(scene):
    """And something below, which then is lit from above and below."""
    ground(scene).visible_shadow = False


def not_be_rendered(scene):
    ground(scene).hide_render = True
    add_mesh(scene, plate_mesh(0.4), diffuse("Plate", 0.5), Matrix.Translation((3, 0, 0)))
    turned = Matrix.Translation((3, 0, 0.01)) @ Matrix.Rotation(1.5, 4, "Y")
    add_mesh(scene, plate_mesh(0.4), diffuse("Wall", 0.5), turned)


def move(scene):
    """The ground turns over, so that it shows its other side."""
    for frame, angle in ((1, 0.0), (40, np.pi)):
        ground(scene).rotation_euler[0] = angle
        ground(scene).keyframe_insert("rotation_euler", frame=frame)


def move_camera(scene):
    """From above the ground to where it sees a plate below it."""
    add_mesh(scene, plate_mesh(1), diffuse("Plate", 0.5), Matrix.Translation((3, 0, -6)))
    for frame, height in ((1, 3), (250, -3)):
        scene.camera.location[2] = height
        scene.camera.keyframe_insert("location", frame=frame)


def wave(scene):
    ground(scene).modifiers.new("Wave", "WAVE")


def appear(scene):
    ground(scene).keyframe_insert("hide_render", frame=1)


def hide_from_the_viewport_only(scene):
    plate = add_mesh(scene, plate_mesh(1), diffuse("Plate", 0.5), Matrix.Translation((9, 0, 9)))
    plate.hide_viewport = True


def fill_with_smoke(scene):
    smoke = bpy.data.volumes.new("Smoke")
    scene.collection.objects.link(bpy.data.objects.new("Smoke", smoke))


def be_everywhere(scene):
    """On each corner of the ground."""
    thing = bpy.data.objects.new("Thing", plate_mesh(1))
    scene.collection.objects.link(thing)
    thing.parent, ground(scene).instance_type = ground(scene), "VERTS"


@pytest.mark.parametrize(
    "change",
    [
        let_light_through,
        cast_no_shadow,
        not_be_rendered,
        move,
        move_camera,
        wave,
        appear,
        hide_from_the_viewport_only,
        fill_with_smoke,
        be_everywhere,
    ],
)
def test_a_scene_that_light_from_below_may_reach_gets_both_lamps(scene, change):
    change(scene)
    bpy.context.view_layer.update()
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 2


def test_through_a_window_only_what_is_in_front_of_it(two_suns):
    """Five sides of a box: both suns are outside, one shines in."""
    made = fresh_scene()
    hdri_world(made, two_suns)
    corners = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
    mesh = bpy.data.meshes.new("Box")
    sides = [(0, 1, 3, 2), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    mesh.from_pydata(corners.tolist(), [], sides)
    add_mesh(made, mesh, diffuse("Wall", 0.5), Matrix())
    camera_towards(made, np.array([1.0, 0.2, 0]), 60, 64)
    bpy.context.view_layer.update()
    bpy.ops.sunsplit.convert()
    assert heights(made) == pytest.approx([ABOVE[2]], abs=1e-3)


def test_what_is_below_the_ground_may_come_round_in_an_animated_world(scene):
    mapping = add_mapping(node(scene.world.node_tree, "TEX_ENVIRONMENT"))
    for frame, angle in ((1, 0.0), (50, np.pi)):
        mapping.inputs["Rotation"].default_value[0] = angle
        mapping.inputs["Rotation"].keyframe_insert("default_value", frame=frame)
    bpy.ops.sunsplit.convert()
    assert len(suns(scene)) == 2


def test_the_same_scene_is_seen_the_same_way_twice(scene):
    first, second = (run_at_once(Reach.steps(needs_of(scene).sight)) for _ in range(2))
    assert first.escaped == second.escaped


def test_the_width_that_a_camera_shows(scene):
    """64 pixels across 40 degrees, at its corners finer than in the middle."""
    half = np.tan(np.radians(20))
    finest = 2 * half / 64 / (1 + 2 * half**2)
    assert needs_of(scene).camera_width == pytest.approx(2 * 2 * np.pi / finest, abs=1)
    scene.render.resolution_percentage = 50
    assert needs_of(scene).camera_width == pytest.approx(2 * np.pi / finest, abs=1)
    scene.camera.data.type = "ORTHO"
    assert needs_of(scene).camera_width is None


def test_a_lens_that_changes_shows_what_its_longest_shows(scene):
    still = needs_of(scene).camera_width
    lens = scene.camera.data.lens
    for frame, times in ((1, 1), (60, 2)):
        scene.camera.data.lens = times * lens
        scene.camera.data.keyframe_insert("lens", frame=frame)
    scene.camera.data.lens = lens
    longest = needs_of(scene).camera_width
    assert 1.5 * still < longest
    scene.camera.data.lens = 2 * lens
    scene.camera.data.animation_data_clear()
    assert longest == needs_of(scene).camera_width


def test_a_lens_that_a_script_changes_may_show_any_width(scene):
    scene.camera.data.driver_add("lens").driver.expression = "sum([20, frame])"
    assert needs_of(scene).camera_width is None


@pytest.mark.parametrize("mirrors", [False, True])
def test_a_camera_gets_no_wider_a_map_than_it_can_show(two_suns, tmp_path, mirrors):
    made = fresh_scene()
    pixels = sky(512, 0.3)
    paint_disc(pixels, ABOVE, 2, (900, 800, 700))
    pixels = pixels.repeat(8, axis=0).repeat(8, axis=1)
    texture = hdri_world(made, write_map(tmp_path / "wide.exr", pixels))
    camera_towards(made, np.array([1, 0, 0.3]), 90, 96)
    if mirrors:
        chrome = material("Chrome", (1, 1, 1), Metallic=1, Roughness=0.1)
        add_mesh(made, plate_mesh(1), chrome, Matrix())
    assert 1024 < needs_of(made).camera_width <= 2048
    bpy.ops.sunsplit.convert()
    nodes = made.world.node_tree.nodes
    assert nodes["Sunsplit: Map"].image.size[0] == 2048
    assert nodes["Sunsplit: Map"].image.name == f"{texture.image.name.split('.')[0]} map"
    assert nodes["Sunsplit: Residual"].image.size[0] == (2048 if mirrors else 256)
    assert "gets a map that wide instead of 4096" in made.sunsplit.report
    bpy.ops.sunsplit.convert(skips=False)
    assert "Sunsplit: Map" not in made.world.node_tree.nodes
    assert made.world.node_tree.nodes["Sunsplit: Residual"].image.size[0] == 4096
    bpy.ops.sunsplit.convert()
    bpy.ops.sunsplit.restore()
    assert [image.size[0] for image in bpy.data.images if image.size[0]] == [4096]
