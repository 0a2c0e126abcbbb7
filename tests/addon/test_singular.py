"""Exact mirrors and clear glass: which they are, and lamps that leave them to the map."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon.rig import twins_of
from sunsplit.addon.scene_needs import needs_steps
from sunsplit.addon.singular import ALL_BUT, ONLY
from sunsplit.addon.steps import run_at_once
from tests.blender import (
    add_mapping,
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
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky

SAID = "show the HDRI itself"


@pytest.fixture
def scene(tmp_path):
    """A ground under a small sun and a wide light."""
    made = fresh_scene()
    pixels = sky(256, 0.3)
    paint_disc(pixels, direction(40, 30), 1, (9000, 8000, 7000))
    paint_disc(pixels, direction(-100, 40), 12, (30, 40, 50))
    add_mapping(hdri_world(made, write_map(tmp_path / "map.exr", pixels)))
    add_mesh(made, plate_mesh(10), diffuse("Ground", 0.5), Matrix())
    camera_towards(made, np.array([1, 0, -0.3]), 60, 64).location = (-4, 0, 2)
    return made


def add(scene, surface, name="Thing"):
    thing = add_mesh(scene, box_mesh(0.3, 0.3, 0.3), surface, Matrix())
    thing.name = name
    bpy.context.view_layer.update()
    return thing


def brushed():
    """What must meet wide lamps, but is no mirror."""
    return material("Brushed", (1, 1, 1), Metallic=1.0, Roughness=0.3)


def shiny():
    """Too rough to be exact, but sharp."""
    return material("Shiny", (1, 1, 1), Metallic=1.0, Roughness=0.1)


def chrome():
    return material("Chrome", (1, 1, 1), Metallic=1.0, Roughness=0.0)


def needs(scene):
    return run_at_once(needs_steps(scene, by_map=True))


def singular(scene) -> set[str]:
    return {thing.name for thing in needs(scene).singular}


@pytest.mark.parametrize(
    ("inputs", "exact"),
    [
        ({"Roughness": 0.0, "Metallic": 1.0}, True),
        ({"Roughness": 0.0036, "Transmission_Weight": 1.0}, True),
        ({"Roughness": 0.0}, True),  # as glazed tiles are: matt under an exact gloss
        ({"Roughness": 0.5, "Coat_Weight": 1.0, "Coat_Roughness": 0.0}, True),
        ({"Roughness": 0.03, "Metallic": 1.0}, False),
        ({"Roughness": 0.0038, "Metallic": 1.0}, False),  # too near to tell
        ({"Roughness": 0.5}, False),
        # These have an exact layer, and another that must meet lamps.
        ({"Roughness": 0.0, "Coat_Weight": 1.0, "Coat_Roughness": 0.03}, False),
        ({"Roughness": 0.3, "Metallic": 1.0, "Coat_Weight": 1.0, "Coat_Roughness": 0.0}, False),
        ({"Roughness": 0.0, "Sheen_Weight": 0.5}, False),
    ],
)
def test_which_surfaces_are_exact(scene, inputs, exact):
    add(scene, material("New", (1, 1, 1), **inputs))
    assert singular(scene) == ({"Thing"} if exact else set())


@pytest.mark.parametrize(
    ("kind", "exact"),
    [
        ("ShaderNodeBsdfAnisotropic", True),
        ("ShaderNodeBsdfGlass", True),
        ("ShaderNodeBsdfRefraction", True),
        ("ShaderNodeBsdfMetallic", True),
        ("ShaderNodeBsdfDiffuse", False),
        ("ShaderNodeBsdfToon", False),
    ],
)
def test_which_shaders_are_exact(scene, kind, exact):
    made = diffuse("New", 0.5)
    shader = made.node_tree.nodes.new(kind)
    if "Roughness" in shader.inputs:
        shader.inputs["Roughness"].default_value = 0.0
    add(scene, made)
    assert singular(scene) == ({"Thing"} if exact else set())


def test_a_shader_that_cycles_blurs_at_least_a_little(scene):
    made = diffuse("New", 0.5)
    shader = made.node_tree.nodes.new("ShaderNodeBsdfAnisotropic")
    shader.inputs["Roughness"].default_value = 0.0
    shader.distribution = "ASHIKHMIN_SHIRLEY"
    add(scene, made)
    assert not singular(scene)
    assert needs(scene).mirrors


def link_roughness(scene, thing):
    tree = thing.material_slots[0].material.node_tree
    texture = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(texture.outputs[0], node(tree, "BSDF_PRINCIPLED").inputs["Roughness"])


def override_all(scene, thing):
    scene.view_layers[0].material_override = chrome()


def give_modifier(scene, thing):
    thing.modifiers.new("Any", "NODES")


def fill_with_fog(scene, thing):
    scene.collection.objects.link(bpy.data.objects.new("V", bpy.data.volumes.new("V")))


def animate_material(scene, thing):
    shader = node(thing.material_slots[0].material.node_tree, "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].keyframe_insert("default_value", frame=1)


@pytest.mark.parametrize(
    "change", [link_roughness, override_all, give_modifier, fill_with_fog, animate_material]
)
def test_what_cannot_be_told_shows_lamps_as_before(scene, change):
    add(scene, chrome(), "Mirror")
    other = add(scene, brushed(), "Other")
    assert singular(scene) == {"Mirror"}
    change(scene, other)
    bpy.context.view_layer.update()
    assert not needs(scene).singular
    assert needs(scene).mirrors
    bpy.ops.sunsplit.convert()
    assert SAID not in scene.sunsplit.report


def test_what_is_sharp_besides_counts_alone(scene):
    add(scene, chrome(), "Mirror")
    found = needs(scene)
    assert not found.mirrors
    assert found.unmet_width == pytest.approx(np.pi)
    assert found.residual_width(4096) == "lighting"
    assert found.mirrored_part > 0
    add(scene, shiny(), "Shiny")
    found = needs(scene)
    assert found.mirrors
    assert found.unmet_width == 0
    assert {thing.name for thing in found.singular} == {"Mirror"}


def test_a_mirror_alone_needs_no_lamps_to_be_met(scene):
    for thing in list(scene.objects):
        if thing.type == "MESH":
            bpy.data.objects.remove(thing)
    add(scene, chrome())
    assert needs(scene).unmet_width == pytest.approx(np.pi)


def linked(lamp) -> str:
    collection = lamp.light_linking.receiver_collection
    return collection.name if collection else ""


def test_lamps_and_their_twins(scene):
    mirror = add(scene, chrome(), "Mirror")
    add(scene, brushed())
    bpy.ops.sunsplit.convert()
    state = scene.sunsplit
    assert needs(scene).unmet_width == pytest.approx(np.radians(3))
    wide = [lamp for lamp in suns(scene) if lamp.data.angle > np.radians(3)]
    twins = twins_of(state.sky)
    assert 0 < len(wide) < len(suns(scene))
    assert len(twins) == len(wide)
    for lamp in suns(scene):
        assert linked(lamp) == (ALL_BUT if lamp in wide else "")
        assert lamp.data.cycles.use_multiple_importance_sampling == (lamp in wide)
    for twin in twins:
        assert linked(twin) == ONLY
        assert not twin.data.cycles.use_multiple_importance_sampling
        assert not twin.visible_camera
    for name, way, held in (
        (ALL_BUT, "EXCLUDE", {mirror}),
        (ONLY, "INCLUDE", {mirror, state.sky}),
    ):
        collection = bpy.data.collections[name]
        assert set(collection.objects) == held
        assert {one.light_linking.link_state for one in collection.collection_objects} == {way}
    assert "till then they show both" in state.report


def test_without_gloss_besides_no_ray_meets_lamps(scene):
    add(scene, chrome())
    bpy.ops.sunsplit.convert()
    assert not twins_of(scene.sunsplit.sky)
    assert not any(linked(lamp) for lamp in suns(scene))
    assert SAID in scene.sunsplit.report
    assert "till then they show both" not in scene.sunsplit.report
    assert "nothing else mirrors sharply" in scene.sunsplit.report


@pytest.mark.parametrize(
    "settings",
    [
        {"skips": False},
        {"two_passes": True},
        {"light_groups": True},
        {"target": "eevee"},
        {"target": "both"},
    ],
    ids=lambda one: next(iter(one)),
)
def test_where_lamps_must_be_in_mirrors(scene, settings):
    add(scene, chrome())
    bpy.ops.sunsplit.convert(**settings)
    assert SAID not in scene.sunsplit.report
    kinds = [n.operation for n in scene.world.node_tree.nodes if n.type == "MATH"]
    assert not kinds
    assert all(lamp.data.cycles.use_multiple_importance_sampling for lamp in suns(scene))


def counts() -> tuple[int, ...]:
    made = bpy.data.objects, bpy.data.lights, bpy.data.collections, bpy.data.worlds
    return tuple(len(some) for some in made)


def test_nothing_is_left_behind(scene):
    mirror = add(scene, chrome())
    add(scene, brushed())
    before, world = counts(), scene.world
    bpy.ops.sunsplit.convert()
    after = counts()
    bpy.ops.sunsplit.convert()
    assert counts() == after
    assert SAID in scene.sunsplit.report
    bpy.ops.sunsplit.restore()
    assert counts() == before
    assert scene.world == world
    assert list(mirror.users_collection) == [scene.collection]


def test_what_was_deleted_is_not_missed(scene):
    mirror = add(scene, chrome())
    add(scene, brushed())
    before = counts()
    bpy.ops.sunsplit.convert()
    bpy.data.objects.remove(mirror)
    lamp = next(lamp for lamp in suns(scene) if linked(lamp))
    bpy.data.lights.remove(lamp.data)  # and the lamp with it
    bpy.ops.sunsplit.convert()
    assert SAID not in scene.sunsplit.report
    bpy.ops.sunsplit.restore()
    assert counts() == (before[0] - 1, *before[1:])


def evaluated(lamp):
    return lamp.evaluated_get(bpy.context.evaluated_depsgraph_get())


def test_twins_do_as_their_lamps_do(scene):
    add(scene, chrome())
    add(scene, brushed())
    bpy.ops.sunsplit.convert()
    lamp = next(one for one in suns(scene) if linked(one))
    [twin] = [one for one in twins_of(scene.sunsplit.sky) if one.constraints[0].target == lamp]
    scene.sunsplit.sky["strength"] = 0.5
    scene.sunsplit.sky["warmth"] = 0.3
    scene.sunsplit.sky["softness"] = 1.5
    scene.sunsplit.sky.update_tag()
    lamp.data.energy *= 3
    lamp.data.color = (1, 0.5, 0.25)
    lamp.rotation_quaternion = (0.8, 0.6, 0, 0)
    mapping = node(scene.world.node_tree, "MAPPING")
    mapping.inputs["Rotation"].default_value[2] = 1.0
    bpy.context.view_layer.update()
    data, other = evaluated(lamp).data, evaluated(twin).data
    assert data.exposure == pytest.approx(-1)
    assert data.use_temperature
    for name in ("energy", "exposure", "use_temperature", "temperature", "angle"):
        assert getattr(other, name) == pytest.approx(getattr(data, name)), name
    assert list(other.color) == pytest.approx([1, 0.5, 0.25])
    assert to_light(twin) == pytest.approx(to_light(lamp), abs=1e-6)
    lamp.hide_render = True
    bpy.context.view_layer.update()
    assert evaluated(twin).hide_render


def test_without_its_things_a_twin_lights_nothing(scene):
    """To Blender a lamp that is linked to nothing is linked to all."""
    mirror = add(scene, chrome())
    add(scene, brushed())
    bpy.ops.sunsplit.convert()
    bpy.data.objects.remove(mirror)
    for twin in twins_of(scene.sunsplit.sky):
        assert list(twin.light_linking.receiver_collection.objects) == [scene.sunsplit.sky]


def test_twins_of_a_rig_that_is_gone_go_too(scene):
    add(scene, chrome())
    add(scene, brushed())
    before = counts()
    for redo in (True, False):
        bpy.ops.sunsplit.convert()
        after = counts()
        bpy.data.objects.remove(scene.sunsplit.sky)
        if redo:
            bpy.ops.sunsplit.convert()
            assert counts() == after
    bpy.ops.sunsplit.restore()
    assert counts() == before


def smooth_by_angle(thing):
    """As Shade Auto Smooth does it: nodes that give no material."""
    group = bpy.data.node_groups.new("Smooth", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes = [group.nodes.new(f"NodeGroup{end}") for end in ("Input", "Output")]
    smooth = group.nodes.new("GeometryNodeSetShadeSmooth")
    group.links.new(nodes[0].outputs[0], smooth.inputs[0])
    group.links.new(smooth.outputs[0], nodes[1].inputs[0])
    thing.modifiers.new("Smooth", "NODES").node_group = group


def subdivide(thing):
    thing.modifiers.new("Subdivision", "SUBSURF")


@pytest.mark.parametrize("change", [smooth_by_angle, subdivide])
def test_modifiers_that_give_no_material(scene, change):
    add(scene, chrome(), "Mirror")
    change(add(scene, diffuse("Matt", 0.5), "Other"))
    bpy.context.view_layer.update()
    found = needs(scene)
    assert {thing.name for thing in found.singular} == {"Mirror"}
    assert not found.mirrors
    assert found.unmet_width == pytest.approx(np.pi)


def test_what_is_no_mirror_is_no_part_of_them(scene):
    skin = material("Skin", (1, 1, 1), Subsurface_Weight=0.2, Roughness=0.5)
    add_mesh(scene, plate_mesh(9), skin, Matrix.Translation((0, 0, 0.01)))
    mirror = add(scene, chrome())
    mirror.location = (-9, 0, 0)  # behind the camera
    bpy.context.view_layer.update()
    found = needs(scene)
    assert found.singular
    assert found.mirrored_part == 0


def test_a_saved_file_can_be_restored(scene, tmp_path):
    add(scene, chrome())
    add(scene, brushed())
    before = counts()
    bpy.ops.sunsplit.convert()
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    assert {linked(lamp) for lamp in suns(scene)} == {"", ALL_BUT}
    bpy.ops.sunsplit.restore()
    assert counts() == before


def test_a_mirror_without_a_world_behind_it_needs_the_map(scene):
    """The camera looks down, and sees the map in the mirror only."""
    add(scene, chrome())
    camera_towards(scene, np.array([0, 0.01, -1]), 30, 64).location = (0, 0, 4)
    bpy.context.view_layer.update()
    found = needs(scene)
    assert not found.camera_sees_world
    assert found.shows_map
    bpy.ops.sunsplit.convert()
    assert "do not load the HDRI" not in scene.sunsplit.report
    images = {n.image for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT"}
    assert len(images) == 2
