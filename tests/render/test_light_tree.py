"""Cycles with its light tree gives the light that it gives without."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from sunsplit.addon.rig import guards_of
from sunsplit.core.sampling import MOST_IN_TREE
from tests.blender import (
    add_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    node,
    plate_mesh,
    render,
    write_map,
)
from tests.maps import direction, paint_disc, sky

BIAS = 0.003
"""Of the light of the surface itself, however dark it is."""

LIGHTS = 41


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    """A bright sun below and forty soft lights of all strengths around, all of which level ground
    sees a part of and none of which it sees whole."""
    pixels = sky(512, 1e-4)
    pixels[:128] = 0.3 + 0.3 * np.sin(np.linspace(0, 2 * np.pi, 512))[:, None]  # for a table
    paint_disc(pixels, direction(0, -60), 2, 100_000)
    for k in range(LIGHTS - 1):
        paint_disc(pixels, direction(9 * k, 1), 4, 10 * 1.1 ** (k * 7 % (LIGHTS - 1)))
    return write_map(tmp_path_factory.mktemp("maps") / "ring.exr", pixels)


@pytest.fixture
def scene(ring):
    made = fresh_scene()
    made.cycles.use_light_tree = True
    made.cycles.max_bounces = 0
    hdri_world(made, ring)
    return made


def add_ground(scene) -> None:
    add_mesh(scene, plate_mesh(10), diffuse("Ground", 0.8), Matrix())
    look_from(scene, (0, 0, 5))


def look_from(scene, place) -> None:
    camera_towards(scene, -np.array(place, float), 20, 8)
    scene.camera.location = place


def add_fog(scene) -> None:
    surface = diffuse("Fog", 0.8)
    tree = surface.node_tree
    tree.nodes.remove(node(tree, "BSDF_DIFFUSE"))
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(scatter.outputs[0], node(tree, "OUTPUT_MATERIAL").inputs["Volume"])
    add_mesh(scene, box_mesh(1, 1, 1), surface, Matrix.Translation((0, 0, -1)))
    look_from(scene, (0, -5, 0))


def add_lamp(scene, kind) -> None:
    lamp = bpy.data.objects.new("Own", bpy.data.lights.new("Own", kind))
    lamp.data.energy = 1e-6
    scene.collection.objects.link(lamp)


def as_it_is_and_without(scene, folder, samples) -> float:
    """Light of a picture as the conversion has left the scene, in that without a light tree."""
    seen = render(scene, folder, samples).mean()
    scene.cycles.use_light_tree = False
    return seen / render(scene, folder, samples).mean()


def convert(lights=LIGHTS, **more) -> None:
    bpy.ops.sunsplit.convert(share=0.995, lights=lights, **more)


@pytest.mark.parametrize("other", [None, "POINT", "SUN"])
def test_soft_lights_that_the_horizon_cuts(scene, tmp_path, other):
    add_ground(scene)
    if other:
        add_lamp(scene, other)
    convert()
    assert scene.cycles.use_light_tree
    assert len(scene.sunsplit.lamps) > MOST_IN_TREE
    assert as_it_is_and_without(scene, tmp_path, 2048) == pytest.approx(1, abs=BIAS)


def test_a_world_that_is_sampled_is_one_light_more(scene, tmp_path):
    add_ground(scene)
    convert()
    scene.world.cycles.sampling_method = "MANUAL"
    assert as_it_is_and_without(scene, tmp_path, 2048) == pytest.approx(1, abs=BIAS)


def test_without_guards_light_is_missing(scene, tmp_path):
    """What all this is for: where this fails, Cycles does not need it any more."""
    add_ground(scene)
    convert()
    for guard in guards_of(scene.sunsplit.sky):
        bpy.data.objects.remove(guard)
    assert as_it_is_and_without(scene, tmp_path, 512) < 0.95


def test_fog(scene, tmp_path):
    add_fog(scene)
    convert()
    assert "in fog Cycles leaves out light of so many lamps" in scene.sunsplit.report
    assert not scene.cycles.use_light_tree
    scene.cycles.use_light_tree = True
    assert as_it_is_and_without(scene, tmp_path, 64) < 0.95  # what it is switched off for
    scene.cycles.use_light_tree = True
    convert(skips=False)
    assert not scene.cycles.use_light_tree
    bpy.ops.sunsplit.restore()
    assert scene.cycles.use_light_tree


def test_fog_with_a_light_of_the_users_is_said(scene):
    add_fog(scene)
    add_lamp(scene, "POINT")
    convert()
    assert scene.cycles.use_light_tree
    assert "switch it off, or allow fewer lights" in scene.sunsplit.report


def test_guards_give_nothing_and_go(scene, tmp_path):
    add_ground(scene)
    add_lamp(scene, "SUN")
    convert()
    assert len(guards_of(scene.sunsplit.sky)) == 4
    lit = {entry.lamp for entry in scene.sunsplit.lamps}
    assert lit.isdisjoint(guards_of(scene.sunsplit.sky))
    convert()  # in the place of what was there
    assert len(guards_of(scene.sunsplit.sky)) == 4
    made = [light for light in scene.objects if light.type == "LIGHT" and light.name != "Own"]
    assert len(made) == len(scene.sunsplit.lamps) + 4
    for lamp in scene.objects:
        if lamp.type == "LIGHT":
            lamp.hide_render = lamp not in guards_of(scene.sunsplit.sky)
    scene.world = None
    assert render(scene, tmp_path, 16).max() < 1e-4
    bpy.ops.sunsplit.restore()
    assert not [light for light in bpy.data.lights if light.name != "Own"]


def test_few_lamps_need_no_guards(scene):
    add_ground(scene)
    convert(lights=MOST_IN_TREE - 1)
    assert not guards_of(scene.sunsplit.sky)
    add_lamp(scene, "SUN")
    convert(lights=MOST_IN_TREE - 1)
    assert len(scene.sunsplit.lamps) == MOST_IN_TREE - 1
    assert len(guards_of(scene.sunsplit.sky)) == 4


def test_many_lamps_of_the_users_and_none_of_a_conversion(scene):
    for _ in range(MOST_IN_TREE):
        add_lamp(scene, "SUN")
    bpy.ops.sunsplit.convert(share=0.0)
    assert not scene.sunsplit.lamps
    assert not guards_of(scene.sunsplit.sky)


def test_every_surface_faces_a_guard(scene):
    add_ground(scene)
    convert()
    bpy.context.view_layer.update()
    guards = guards_of(scene.sunsplit.sky)
    to_light = np.array([g.matrix_world.to_3x3() @ Vector((0, 0, 1)) for g in guards])
    normals = np.random.default_rng(1).normal(size=(10_000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert (normals @ to_light.T).max(axis=1).min() > 0.33
