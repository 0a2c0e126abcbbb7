"""What a scene does not need is skipped, said, and brought back."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon.rays import PLACES, Reach
from sunsplit.addon.scene_needs import ALL, SceneNeeds, needs_of
from sunsplit.addon.steps import run_at_once
from tests.blender import (
    add_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    node,
    plate_mesh,
    suns,
    write_map,
)
from tests.maps import direction, paint_disc, sky


@pytest.fixture
def scene(sunrise):
    """A box to stand in, half a metre above its floor, and the camera in it."""
    made = fresh_scene()
    hdri_world(made, sunrise)
    add_mesh(made, box_mesh(2, 2, 1), diffuse("Wall", 0.5), Matrix.Translation((0, 0, -0.5)))
    camera_towards(made, np.array([1, 0, 0]), 60, 32)
    return made


def sees_world(scene) -> bool:
    bpy.context.view_layer.update()
    return needs_of(scene).camera_sees_world


def test_in_a_box_nothing_is_needed(scene):
    needs = needs_of(scene)
    assert not any((needs.camera_sees_world, needs.mirrors, needs.other_lights))
    reach = run_at_once(Reach.steps(needs.sight))
    assert len(reach.places) >= PLACES
    assert not reach.escaped


def break_wall(scene):
    mesh = next(thing for thing in scene.objects if thing.type == "MESH").data
    mesh.clear_geometry()


def open_wall(scene):
    wall = next(thing for thing in scene.objects if thing.type == "MESH")
    wall.hide_render = True


def move_camera_out(scene):
    scene.camera.location = (9, 0, 0)


def animate_camera(scene):
    for frame, place in ((1, 0), (250, 9)):
        scene.camera.location[0] = place
        scene.camera.keyframe_insert("location", frame=frame)


def make_glass_pane(scene):
    pane = material("Pane", (1, 1, 1), Alpha=0.5)
    add_mesh(scene, plate_mesh(0.1), pane, Matrix.Translation((0, 0, 0.3)))


def fill_with_fog(scene):
    fog = bpy.data.materials.new("Fog")
    if bpy.app.version < (5, 0):
        fog.use_nodes = True
    tree = fog.node_tree
    tree.nodes.clear()
    volume = tree.nodes.new("ShaderNodeVolumeScatter")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    open_wall(scene)
    add_mesh(scene, box_mesh(2, 2, 1), fog, Matrix.Translation((0, 0, -0.5)))


def hide_collection_of_walls(scene):
    wall = next(thing for thing in scene.objects if thing.type == "MESH")
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    scene.collection.objects.unlink(wall)
    hidden.objects.link(wall)
    hidden.hide_render = True


def build_wall_slowly(scene):
    wall = next(thing for thing in scene.objects if thing.type == "MESH")
    wall.modifiers.new("Build", "BUILD").frame_duration = 1


def look_around(scene):
    scene.camera.data.type = "PANO"


def have_no_camera(scene):
    scene.camera = None


@pytest.mark.parametrize(
    "change",
    [
        break_wall,
        open_wall,
        move_camera_out,
        animate_camera,
        make_glass_pane,
        fill_with_fog,
        hide_collection_of_walls,
        build_wall_slowly,
        look_around,
        have_no_camera,
    ],
)
def test_a_camera_that_may_see_the_world(scene, change):
    assert not sees_world(scene)
    change(scene)
    assert sees_world(scene)


def test_a_transparent_film_shows_no_world(scene):
    move_camera_out(scene)
    scene.render.film_transparent = True
    assert not sees_world(scene)


@pytest.mark.parametrize(
    ("inputs", "sharp"),
    [
        ({"Roughness": 0.5}, False),
        ({"Roughness": 0.1}, True),
        ({"Roughness": 0.5, "Coat_Weight": 0.3}, True),
        ({"Roughness": 0.5, "Coat_Weight": 0.3, "Coat_Roughness": 0.4}, False),
    ],
)
def test_what_mirrors_sharply(scene, inputs, sharp):
    made = material("New", (1, 1, 1), **inputs)
    add_mesh(scene, plate_mesh(0.1), made, Matrix())
    assert needs_of(scene).mirrors is sharp


def test_a_roughness_that_cannot_be_told_is_sharp(scene):
    made = material("New", (1, 1, 1), Roughness=0.5)
    noise = made.node_tree.nodes.new("ShaderNodeTexNoise")
    shader = node(made.node_tree, "BSDF_PRINCIPLED")
    made.node_tree.links.new(noise.outputs[0], shader.inputs["Roughness"])
    add_mesh(scene, plate_mesh(0.1), made, Matrix())
    assert needs_of(scene).mirrors


@pytest.mark.parametrize(
    ("inputs", "degrees"),
    [
        ({"Roughness": 0.5}, 180),
        ({"Roughness": 0.4}, 30),
        ({"Roughness": 0.39}, 3),
        ({"Roughness": 0.5, "Metallic": 1.0}, 3),
        ({"Roughness": 0.5, "Specular_IOR_Level": 0.6}, 3),
        ({"Roughness": 0.5, "Coat_Weight": 0.3, "Coat_Roughness": 0.4}, 3),
        ({"Roughness": 0.2}, 0),
    ],
)
def test_suns_that_need_not_be_met(scene, inputs, degrees):
    assert needs_of(scene).unmet_width == pytest.approx(np.pi)
    made = material("New", (1, 1, 1), **inputs)
    add_mesh(scene, box_mesh(0.1, 0.1, 0.2), made, Matrix.Translation((0.2, 0, -0.1)))
    assert needs_of(scene).unmet_width == pytest.approx(np.radians(degrees))


@pytest.mark.parametrize(
    ("kind", "degrees"),
    [
        ("ShaderNodeBsdfTranslucent", 180),
        ("ShaderNodeEmission", 180),
        ("ShaderNodeTexNoise", 180),
        ("ShaderNodeBsdfGlossy", 3),
        ("ShaderNodeBsdfGlass", 0),  # as sharp as it comes
        ("ShaderNodeBsdfToon", 0),
        ("ShaderNodeBsdfHair", 0),
    ],
)
def test_shaders_that_need_not_meet_suns(scene, kind, degrees):
    made = diffuse("New", 0.5)
    shader = made.node_tree.nodes.new(kind)
    if kind == "ShaderNodeBsdfGlossy":
        shader.inputs["Roughness"].default_value = 0.5
    add_mesh(scene, plate_mesh(0.1), made, Matrix())
    assert needs_of(scene).unmet_width == pytest.approx(np.radians(degrees))


def test_a_little_lacquer_does_not_count(scene):
    """It makes its own surface noisier, and all else calmer."""
    made = material("New", (1, 1, 1), Roughness=0.4)
    ball = add_mesh(scene, box_mesh(0.05, 0.05, 0.1), made, Matrix.Translation((0.9, 0, 0)))
    assert needs_of(scene).unmet_width == pytest.approx(np.pi)
    ball.location.x = 0.1
    bpy.context.view_layer.update()
    assert needs_of(scene).unmet_width == pytest.approx(np.radians(30))
    ball.location.x = 0.9
    ball.modifiers.new("Any", "NODES")  # may wear what it likes
    bpy.context.view_layer.update()
    assert needs_of(scene).unmet_width == pytest.approx(np.radians(30))


@pytest.mark.parametrize(("index", "degrees"), [(1.0, 0), (1.05, 0), (1.45, 3)])
@pytest.mark.parametrize("kind", ["ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction", None])
def test_glass_that_does_not_bend_light_is_as_sharp_as_a_mirror(scene, kind, index, degrees):
    """Cycles lets light straight through it, which is not looked for, however rough it is."""
    made = material("New", (1, 1, 1), Roughness=0.5, Transmission_Weight=1.0, IOR=index)
    if kind:
        shader = made.node_tree.nodes.new(kind)
        shader.inputs["Roughness"].default_value, shader.inputs["IOR"].default_value = 0.5, index
        made.node_tree.nodes.remove(node(made.node_tree, "BSDF_PRINCIPLED"))
    add_mesh(scene, plate_mesh(0.1), made, Matrix())
    assert needs_of(scene).unmet_width == pytest.approx(np.radians(degrees))


def test_lacquer_behind_what_one_sees_through_counts(scene):
    matt, pane = material("New", (1, 1, 1), Roughness=0.4), material("Pane", (1, 1, 1), Alpha=0.5)
    add_mesh(scene, box_mesh(0.1, 0.1, 0.2), matt, Matrix.Translation((0.4, 0, -0.1)))
    add_mesh(scene, box_mesh(0.1, 0.1, 0.2), pane, Matrix.Translation((0.2, 0, -0.1)))
    assert needs_of(scene).unmet_width == pytest.approx(np.radians(30))


def test_a_mirror_that_appears_in_another_frame_counts(scene):
    chrome = material("Chrome", (1, 1, 1), Metallic=1.0, Roughness=0.0)
    mirror = add_mesh(scene, plate_mesh(0.1), chrome, Matrix())
    mirror.hide_render = True
    assert not needs_of(scene).mirrors
    mirror.keyframe_insert("hide_render", frame=1)
    mirror.hide_render = False
    mirror.keyframe_insert("hide_render", frame=10)
    scene.frame_set(1)
    assert mirror.hide_render
    needs = needs_of(scene)
    assert needs.mirrors
    assert needs.unmet_width == 0


def test_keys_within_a_group_of_nodes_may_make_anything_of_it(scene):
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    shader = group.nodes.new("ShaderNodeBsdfPrincipled")
    made = diffuse("New", 0.5)
    made.node_tree.nodes.new("ShaderNodeGroup").node_tree = group
    add_mesh(scene, plate_mesh(0.1), made, Matrix())
    assert not needs_of(scene).mirrors
    shader.inputs["Roughness"].keyframe_insert("default_value", frame=1)
    assert needs_of(scene) == ALL


def test_of_a_background_scene_all_is_needed(scene):
    other = bpy.data.scenes.new("Other")
    assert needs_of(scene) != ALL
    scene.background_set = other
    assert needs_of(scene) == ALL


def test_a_volume_scatters_light_whatever_it_wears(scene):
    scene.collection.objects.link(bpy.data.objects.new("V", bpy.data.volumes.new("V")))
    assert needs_of(scene).fog


def test_in_an_empty_scene_suns_are_met(scene):
    """What is put into their light later may be a mirror."""
    assert needs_of(scene).unmet_width > 0
    for thing in list(scene.objects):
        if thing.type == "MESH":
            bpy.data.objects.remove(thing)
    scene.collection.objects.link(bpy.data.objects.new("Empty", None))
    assert needs_of(scene).unmet_width == 0


def test_in_fog_suns_are_met(scene):
    fill_with_fog(scene)
    assert needs_of(scene).unmet_width == 0


def are_met(scene) -> list[bool]:
    return [lamp.data.cycles.use_multiple_importance_sampling for lamp in suns(scene)]


def test_rays_meet_suns_where_something_mirrors_them(scene):
    move_camera_out(scene)
    said = "rays need not meet lamps"
    bpy.ops.sunsplit.convert(lights=2)
    assert are_met(scene) == [False, False]
    assert said in scene.sunsplit.report
    bpy.ops.sunsplit.convert(lights=2, skips=False)
    assert are_met(scene) == [True, True]
    assert said not in scene.sunsplit.report
    chrome = material("Chrome", (1, 1, 1), Metallic=1.0, Roughness=0.0)
    add_mesh(scene, plate_mesh(0.1), chrome, Matrix())
    bpy.ops.sunsplit.convert(lights=2)
    assert are_met(scene) == [True, True]
    assert said not in scene.sunsplit.report


def test_glowing_things_and_lamps_are_other_lights(scene):
    assert not needs_of(scene).other_lights
    glowing = material("New", (1, 1, 1), Emission_Strength=2)
    plate = add_mesh(scene, plate_mesh(0.1), glowing, Matrix())
    assert needs_of(scene).other_lights
    plate.hide_render = True
    assert not needs_of(scene).other_lights
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    scene.collection.objects.link(lamp)
    assert needs_of(scene).other_lights


def test_a_lamp_in_an_instanced_collection_is_another_light(scene):
    lamps = bpy.data.collections.new("Lamps")
    lamps.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN")))
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", lamps
    scene.collection.objects.link(instance)
    assert needs_of(scene).other_lights


def test_a_copied_lamp_is_another_light(scene):
    bpy.ops.sunsplit.convert(lights=1)
    assert not needs_of(scene).other_lights
    scene.collection.objects.link(suns(scene)[0].copy())
    assert needs_of(scene).other_lights


def test_a_material_that_overrides_all_others_counts(scene):
    chrome = material("Chrome", (1, 1, 1), Metallic=1.0, Roughness=0.0)
    assert not needs_of(scene).mirrors
    scene.view_layers[0].material_override = chrome
    assert needs_of(scene).mirrors


def test_an_animated_material_may_become_anything(scene):
    made = material("New", (1, 1, 1), Roughness=0.5)
    add_mesh(scene, plate_mesh(0.1), made, Matrix())
    shader = node(made.node_tree, "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].keyframe_insert("default_value", frame=1)
    assert needs_of(scene) == ALL


@pytest.mark.parametrize(
    ("width", "camera", "shown", "mirrored"),
    [
        (8192, 2048, 2048, 2048),
        (8192, 2049, 4096, 4096),
        (8192, 300, 512, 1024),
        (8192, 9000, 8192, "own"),
        (3000, 700, 750, 1500),
        (2 * 4099, 700, 2 * 4099, "own"),
    ],
)
def test_a_map_that_is_seen_is_as_wide_as_a_picture_can_show(width, camera, shown, mirrored):
    needs = SceneNeeds(True, mirrors=True, other_lights=False, camera_width=camera)
    assert needs.shown_width(width) == shown
    assert needs.residual_width(width) == mirrored
    assert replace(needs, mirrors=False).residual_width(width) == "lighting"
    assert ALL.residual_width(width) == "own"
    assert ALL.shown_width(width) == width


def test_a_wide_map_lights_with_a_narrower_one(scene, tmp_path):
    pixels = sky(2048, 0.3)
    paint_disc(pixels, direction(0, 40), 2, (900, 800, 700))
    hdri_world(scene, write_map(tmp_path / "wide.exr", pixels))
    for skips, width in ((True, 256), (False, 2048)):
        bpy.ops.sunsplit.convert(lights=1, skips=skips)
        tree = scene.world.node_tree
        assert tree.nodes["Sunsplit: Residual"].image.size[0] == width
        assert ("256 pixels wide instead of 2048" in scene.sunsplit.report) is skips
    bpy.ops.sunsplit.convert(share=1.0, lights=4)
    assert "pixels wide" not in scene.sunsplit.report


def test_skipped_things_are_said_and_brought_back(scene):
    scene.cycles.use_light_tree = True
    bpy.ops.sunsplit.convert(lights=1)
    assert "the camera does not see the world" in scene.sunsplit.report
    assert "the light tree" in scene.sunsplit.report
    assert not scene.cycles.use_light_tree
    mix = next(n for n in scene.world.node_tree.nodes if n.type == "MIX")
    assert not mix.inputs[0].is_linked
    assert mix.inputs[0].default_value == 0
    bpy.ops.sunsplit.convert(lights=1)
    assert "the light tree" in scene.sunsplit.report
    assert len(suns(scene)) == 1
    bpy.ops.sunsplit.restore()
    assert scene.cycles.use_light_tree


def test_a_light_tree_that_was_off_stays_off(scene):
    scene.cycles.use_light_tree = False
    bpy.ops.sunsplit.convert(lights=1)
    assert "the light tree" not in scene.sunsplit.report
    bpy.ops.sunsplit.restore()
    assert not scene.cycles.use_light_tree


def test_one_switch_keeps_everything(scene):
    scene.cycles.use_light_tree = True
    bpy.ops.sunsplit.convert(lights=1, skips=False)
    assert "Skipped" not in scene.sunsplit.report
    assert scene.cycles.use_light_tree
    mix = next(n for n in scene.world.node_tree.nodes if n.type == "MIX")
    assert mix.inputs[0].is_linked
