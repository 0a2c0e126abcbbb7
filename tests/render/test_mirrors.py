"""Exact mirrors and clear glass show the map itself, once; what they light keeps its light."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from sunsplit.addon.rig import twins_of
from sunsplit.addon.shaders import EXACT
from tests.blender import (
    add_mesh,
    ball_mesh,
    camera_towards,
    diffuse,
    empty_world,
    fresh_scene,
    hdri_world,
    material,
    node,
    plate_mesh,
    render,
    write_map,
)
from tests.maps import direction, paint_disc, sky
from tests.render.compare import estimate, means_agree, pixels_agree

EEVEE = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"

MIRROR = {"Metallic": 1.0, "Roughness": 0.0}
GLASS = {"Transmission_Weight": 1.0, "Roughness": 0.0, "IOR": 1.45}
BRUSHED = {"Metallic": 1.0, "Roughness": 0.3}


@pytest.fixture(scope="module")
def windows(tmp_path_factory):
    """Long windows, which no disc looks like, and a sun."""
    pixels = sky(512, 0.3)
    for column in (40, 180, 330, 430):
        pixels[70:100, column : column + 50] = (12, 14, 16)
    paint_disc(pixels, direction(-60, 55), 2, (300, 250, 180))
    return write_map(tmp_path_factory.mktemp("maps") / "windows.exr", pixels)


@pytest.fixture
def scene(windows):
    made = fresh_scene()
    hdri_world(made, windows)
    made.cycles.max_bounces = 6
    return made


def add_balls(scene, *surfaces):
    for number, surface in enumerate(surfaces):
        place = Matrix.Translation((1.3 * number - 0.65 * (len(surfaces) - 1), 0, 0.6))
        add_mesh(scene, ball_mesh(0.6), material("Ball", (0.9, 0.9, 0.9), **surface), place)
    camera = camera_towards(scene, np.array([0, 0.95, -0.3]), 40, 64)
    camera.location = Vector((0, -4.75, 2.0))


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside brushed metal"])
@pytest.mark.parametrize("surface", [MIRROR, GLASS], ids=["mirror", "glass"])
def test_they_show_the_map_itself(scene, tmp_path, surface, beside):
    """To the last digit where nothing else is seen in them: not even noise differs much."""
    add_mesh(scene, ball_mesh(1), material("Ball", (1, 1, 1), **surface), Matrix())
    camera_towards(scene, np.array([0.6, -0.75, -0.2]), 30, 64).location = (-2.5, 3.1, 0.85)
    if beside:  # out of sight
        brushed = material("Brushed", (1, 1, 1), **BRUSHED)
        add_mesh(scene, plate_mesh(0.1), brushed, Matrix.Translation((-9, 9, 9)))
    before = render(scene, tmp_path, 64)
    bpy.ops.sunsplit.convert()
    assert bool(twins_of(scene.sunsplit.sky)) == beside
    assert len(scene.sunsplit.lamps) >= 4
    after = render(scene, tmp_path, 64)
    assert after == pytest.approx(before, rel=1e-3, abs=1e-3)
    bpy.ops.sunsplit.convert(skips=False)  # what it is for: as discs they look otherwise
    assert np.abs(render(scene, tmp_path, 64) - before).mean() > 0.02 * before.mean()


@pytest.mark.parametrize("caustics", [True, False])
@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside brushed metal"])
def test_light_that_they_throw_on_others_stays(scene, tmp_path, caustics, beside):
    """As Blender is set up, where Cycles blurs what is mirrored after a matt surface."""
    scene.cycles.blur_glossy = 1.0
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = caustics
    add_mesh(scene, plate_mesh(4), diffuse("Ground", 0.8), Matrix())
    add_balls(scene, MIRROR, GLASS, *([BRUSHED] if beside else []))
    plain = estimate(scene, tmp_path, 192)
    bpy.ops.sunsplit.convert(tolerance=0.3)
    assert bool(twins_of(scene.sunsplit.sky)) == beside
    split = estimate(scene, tmp_path, 192)
    means_agree(plain, split, tmp_path)
    pixels_agree(plain, split, tmp_path, slack=0.05)


def test_a_glaze_over_what_is_matt(scene, tmp_path):
    """It has the lamps' light by its matt ground, and mirrors the map."""
    add_mesh(scene, plate_mesh(4), material("Ground", (0.6, 0.6, 0.6), Roughness=0.0), Matrix())
    add_balls(scene, BRUSHED)
    plain = estimate(scene, tmp_path, 128)
    bpy.ops.sunsplit.convert(tolerance=0.3)
    assert twins_of(scene.sunsplit.sky)
    split = estimate(scene, tmp_path, 128)
    means_agree(plain, split, tmp_path)
    pixels_agree(plain, split, tmp_path, slack=0.05)


def test_a_mirror_in_an_instanced_collection(scene, tmp_path):
    brushed = material("Brushed", (1, 1, 1), **BRUSHED)
    add_mesh(scene, plate_mesh(0.1), brushed, Matrix.Translation((-9, 9, 9)))
    inside = bpy.data.collections.new("Inside")
    ball = bpy.data.objects.new("Ball", ball_mesh(1))
    ball.data.materials.append(material("Mirror", (1, 1, 1), **MIRROR))
    inside.objects.link(ball)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", inside
    instance.location.z = 2
    scene.collection.objects.link(instance)
    camera_towards(scene, np.array([0.6, -0.75, 0]), 30, 64).location = (-2.5, 3.1, 2)
    bpy.context.view_layer.update()
    before = render(scene, tmp_path, 64)
    bpy.ops.sunsplit.convert()
    assert twins_of(scene.sunsplit.sky)
    assert render(scene, tmp_path, 64) == pytest.approx(before, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("roughness", [EXACT, 0.004], ids=["exact", "too rough"])
@pytest.mark.parametrize(
    "kind",
    [
        "ShaderNodeBsdfAnisotropic",
        "ShaderNodeBsdfGlass",
        "ShaderNodeBsdfRefraction",
        "ShaderNodeBsdfMetallic",
        "ShaderNodeBsdfPrincipled",
    ],
)
def test_what_is_exact_to_cycles(tmp_path, kind, roughness):
    """Cycles says so to the world, which shines for such rays alone."""
    scene = fresh_scene()
    tree = empty_world(scene)
    path = tree.nodes.new("ShaderNodeLightPath")
    background = node(tree, "BACKGROUND")
    tree.links.new(path.outputs["Is Singular Ray"], background.inputs["Strength"])
    surface = diffuse("Surface", 0.5)
    shader = surface.node_tree.nodes.new(kind)
    shader.inputs["Roughness"].default_value = roughness
    if "Metallic" in shader.inputs:
        shader.inputs["Metallic"].default_value = 1.0
    output = node(surface.node_tree, "OUTPUT_MATERIAL")
    surface.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    add_mesh(scene, plate_mesh(1), surface, Matrix())
    camera_towards(scene, np.array([0, 0.6, -0.8]), 30, 16).location = (0, -1.2, 1.6)
    shown = render(scene, tmp_path, 16)[4:12, 4:12]
    assert bool((shown > 0.1).any()) == (roughness == EXACT)


def test_eevee_does_not_light_with_what_mirrors_show(scene, tmp_path):
    """A viewport of the same scene: in 4.5 EEVEE lights with what is every kind of ray at once."""
    add_mesh(scene, plate_mesh(4), diffuse("Ground", 0.8), Matrix())
    add_balls(scene, MIRROR, BRUSHED)
    shown = []
    for skips in (True, False):
        scene.render.engine = "CYCLES"
        bpy.ops.sunsplit.convert(skips=skips)
        assert bool(twins_of(scene.sunsplit.sky)) == skips
        scene.render.engine = EEVEE
        shown.append(render(scene, tmp_path, 1)[48:].mean())
    assert shown[0] == pytest.approx(shown[1], rel=0.02)


def test_light_that_blurred_mirrors_throw_by_many_lamps(scene, tmp_path):
    """More than Cycles' light tree can draw from, each with a twin."""
    scene.cycles.blur_glossy = 1.0
    add_mesh(scene, plate_mesh(4), diffuse("Ground", 0.8), Matrix())
    add_balls(scene, MIRROR, BRUSHED)
    lamp = bpy.data.objects.new("Own", bpy.data.lights.new("Own", "POINT"))
    lamp.data.energy = 1e-6  # so that the tree stays
    scene.collection.objects.link(lamp)
    bpy.ops.sunsplit.convert(lights=24)
    assert scene.cycles.use_light_tree
    assert len(twins_of(scene.sunsplit.sky)) + len(scene.sunsplit.lamps) > 40
    by_tree = estimate(scene, tmp_path, 256)
    scene.cycles.use_light_tree = False
    means_agree(estimate(scene, tmp_path, 256), by_tree, tmp_path)


def test_a_floor_that_shines_mirrors_windows(scene, tmp_path):
    """Lamps are cut where rough gloss shows them."""
    floor = material("Floor", (0.2, 0.2, 0.2), Roughness=0.3)
    add_mesh(scene, plate_mesh(30), floor, Matrix())
    camera_towards(scene, direction(10, -14), 50, 48).location = (0, 0, 1.5)
    bpy.context.view_layer.update()
    plain = estimate(scene, tmp_path, 256)
    bpy.ops.sunsplit.convert()
    true = estimate(scene, tmp_path, 256)
    bpy.ops.sunsplit.convert(lights=6)
    coarse = estimate(scene, tmp_path, 256)

    def wrong(found):
        square = (found.mean - plain.mean) ** 2 - found.error**2 - plain.error**2
        return float(np.sqrt(max(square.mean(), 0))) / plain.mean.mean()

    print(f"{len(scene.sunsplit.lamps)} lamps: {wrong(coarse):.3%}, more: {wrong(true):.3%}")
    assert wrong(true) < 0.02  # of the picture; the program asks for .012 of the map
    assert wrong(coarse) > 5 * wrong(true)
