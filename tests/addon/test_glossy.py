"""What a picture shows in rough gloss, by rays through the scene."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon.glossy import PICTURE, gloss_steps, layers_of
from sunsplit.addon.scene import convert_scene
from sunsplit.addon.scene_needs import needs_of
from sunsplit.addon.steps import run_at_once
from sunsplit.core.placement.placement import ON_GLOSS
from sunsplit.core.settings import ConversionSettings
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
)

TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.fixture
def scene(sunrise):
    made = fresh_scene()
    hdri_world(made, sunrise)
    camera_towards(made, np.array([1, 0, -0.3]), 60, 64).location = (0, 0, 2)
    return made


def add_floor(scene, **inputs):
    floor = material("Floor", (0.2, 0.2, 0.2), **({"Roughness": 0.3} | inputs))
    return add_mesh(scene, plate_mesh(50), floor, Matrix())


def gloss(scene, turn=TURN):
    bpy.context.view_layer.update()
    return run_at_once(gloss_steps(needs_of(scene).sight, turn))


def test_a_floor_mirrors_what_is_before_the_viewer(scene):
    add_floor(scene)
    found = gloss(scene)
    assert found.rays == PICTURE[0] * PICTURE[1]
    assert 0.4 * found.rays < len(found.roughness) < found.rays
    assert found.normals == pytest.approx(np.tile([0, 0, 1.0], (len(found.roughness), 1)))
    assert np.linalg.norm(found.to_viewer, axis=1) == pytest.approx(np.ones(len(found.normals)))
    assert (found.to_viewer @ (TURN @ [-1, 0, 0.3]) > 0).all()
    assert found.roughness == pytest.approx(np.full(len(found.normals), 0.3))
    assert found.facing == pytest.approx(np.full(len(found.normals), 0.04))


def test_what_stands_behind_hides_the_world(scene):
    add_floor(scene)
    before = len(gloss(scene).roughness)
    add_mesh(scene, box_mesh(0.5, 20, 20), diffuse("Wall", 0.5), Matrix.Translation((30, 0, 0)))
    found = gloss(scene)
    assert found is None or len(found.roughness) < before / 2


def put_pane(scene):
    pane = material("Pane", (1, 1, 1), Transmission_Weight=1.0, Roughness=0.0)
    turn = Matrix.Rotation(np.pi / 2, 4, "Y")
    return add_mesh(scene, plate_mesh(4), pane, Matrix.Translation((1, 0, 2)) @ turn)


def put_hidden(scene):
    wall = diffuse("Wall", 0.5)
    turn = Matrix.Rotation(np.pi / 2, 4, "Y")
    plate = add_mesh(scene, plate_mesh(4), wall, Matrix.Translation((1, 0, 2)) @ turn)
    plate.hide_render = True


@pytest.mark.parametrize("put", [put_pane, put_hidden])
def test_what_one_sees_through_hides_nothing(scene, put):
    add_floor(scene)
    before = gloss(scene)
    put(scene)
    assert len(gloss(scene).roughness) == pytest.approx(len(before.roughness), rel=0.1)


def test_frames_share_the_rays(scene):
    add_floor(scene)
    camera = scene.camera
    camera.rotation_mode = "XYZ"
    scene.frame_end = 50
    for frame, angle in ((1, 0.0), (50, 1.0)):
        camera.rotation_euler = (np.radians(73), 0, angle - np.pi / 2)
        camera.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    bpy.context.view_layer.update()
    assert len(needs_of(scene).sight.moments) > 4
    assert gloss(scene).rays == pytest.approx(PICTURE[0] * PICTURE[1], rel=0.1)


@pytest.mark.parametrize(
    ("inputs", "layers"),
    [
        ({"Roughness": 0.5}, [(0.5, 0.04)]),
        ({"Roughness": 0.5, "Specular_IOR_Level": 0.25}, [(0.5, 0.02)]),
        ({"Roughness": 0.5, "Specular_IOR_Level": 0.0}, []),
        ({"Roughness": 0.4, "Metallic": 1.0}, [(0.4, 0.2)]),
        ({"Roughness": 0.1, "Metallic": 1.0}, []),
        ({"Roughness": 0.9}, []),
        (
            {"Roughness": 0.5, "Coat_Weight": 0.5, "Coat_Roughness": 0.3},
            [(0.5, 0.04), (0.3, 0.02)],
        ),
    ],
)
def test_layers_of_a_surface(scene, inputs, layers):
    found = list(layers_of(add_floor(scene, **inputs)))
    found = [(one.roughness, one.facing) for one in found]
    assert found == [pytest.approx(layer, abs=1e-6) for layer in layers]


@pytest.mark.parametrize(
    ("kind", "facing"),
    [
        ("ShaderNodeBsdfAnisotropic", 0.8),
        ("ShaderNodeBsdfGlass", 0.04),
        ("ShaderNodeBsdfRefraction", None),
        ("ShaderNodeBsdfDiffuse", None),
    ],
)
def test_shaders_that_shine(scene, kind, facing):
    made = diffuse("New", 0.5)
    shader = made.node_tree.nodes.new(kind)
    shader.inputs["Roughness"].default_value = 0.4
    if kind == "ShaderNodeBsdfAnisotropic":
        shader.inputs["Color"].default_value = (0.8, 0.8, 0.8, 1)
    floor = add_mesh(scene, plate_mesh(50), made, Matrix())
    found = [one.facing for one in layers_of(floor)]
    assert found == ([] if facing is None else [pytest.approx(facing, abs=1e-6)])


def test_a_roughness_that_cannot_be_told_is_a_usual_one(scene):
    floor = add_floor(scene)
    tree = floor.material_slots[0].material.node_tree
    texture = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(texture.outputs[0], node(tree, "BSDF_PRINCIPLED").inputs["Roughness"])
    assert [one.roughness for one in layers_of(floor)] == [0.4]


def test_a_matt_scene_shows_nothing(scene):
    add_mesh(scene, plate_mesh(50), diffuse("Matt", 0.5), Matrix())
    assert gloss(scene) is None


def test_a_floor_is_asked_what_it_shows_of_the_lamps(scene):
    """What that is like in a picture: tests/render/test_mirrors.py."""
    floor = add_floor(scene)
    bpy.context.view_layer.update()
    shining = convert_scene(scene, ConversionSettings()).conversion
    assert 0 < shining.gloss_error <= 0.01 * ON_GLOSS
    floor.data.materials[0] = diffuse("Matt", 0.2)
    assert convert_scene(scene, ConversionSettings()).conversion.gloss_error is None
