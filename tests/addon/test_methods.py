"""The paper's methods from inside Blender: panel, script and world."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from sunsplit.addon.properties import CHOICES
from sunsplit.core import ConversionSettings, convert, load
from tests.blender import fresh_scene, hdri_world, suns, to_light

METHODS = ["penrose", "median-cut", "variance", "kmeans"]


@pytest.fixture
def scene(sunrise):
    scene = fresh_scene()
    hdri_world(scene, sunrise)
    return scene


@pytest.mark.parametrize("method", METHODS)
def test_each_method_gives_what_the_function_gives(scene, sunrise, method):
    chosen = {
        "lights": 20,
        "share": 0.5,
        "method": method,
        "frequency": "one",
        "position": "sample",
        "shape": "point",
    }
    assert bpy.ops.sunsplit.convert(**chosen) == {"FINISHED"}
    expected = convert(load(sunrise), ConversionSettings(**chosen)).suns
    lamps = suns(scene)
    assert len(lamps) == len(expected)
    for lamp, sun in zip(lamps, expected, strict=True):
        irradiance = lamp.data.energy * np.array(lamp.data.color)
        assert irradiance == pytest.approx(sun.irradiance, rel=1e-5)
        assert to_light(lamp) == pytest.approx(sun.to_light, abs=1e-5)
        assert lamp.data.angle == 0


def test_a_voronoi_map_is_shown_with_closest_interpolation(scene, sunrise):
    bpy.ops.sunsplit.convert(share=0, residual="voronoi", residual_samples=300)
    assert not suns(scene)
    texture = scene.world.node_tree.nodes["Sunsplit: Residual"]
    assert texture.interpolation == "Closest"
    assert scene.world.cycles.sampling_method == "MANUAL"
    assert scene.world.cycles.sample_map_resolution == 1024
    pixels = np.empty(1024 * 512 * 4, np.float32)
    texture.image.pixels.foreach_get(pixels)
    found = pixels.reshape(512, 1024, 4)[::-1, :, :3]
    chosen = ConversionSettings(share=0, residual="voronoi", residual_samples=300)
    expected = convert(load(sunrise), chosen)
    assert np.abs(found / expected.residual - 1).max() < 1e-3
    # As many values as cells, give or take those that look alike in half floats.
    assert len(np.unique(found.reshape(-1, 3), axis=0)) > 0.9 * len(expected.samples.sites)


def test_a_residual_map_keeps_the_interpolation_of_the_original(scene):
    for chosen in ("Linear", "Smart", "Cubic"):
        texture = next(n for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT")
        texture.interpolation = chosen
        bpy.ops.sunsplit.convert()
        assert scene.world.node_tree.nodes["Sunsplit: Residual"].interpolation == chosen
        bpy.ops.sunsplit.restore()


def test_a_thousand_lamps_come_and_go(scene):
    things = len(bpy.data.objects), len(bpy.data.lights)
    bpy.ops.sunsplit.convert(share=1, lights=1000, method="median-cut")
    assert len(suns(scene)) == 1000
    bpy.ops.sunsplit.restore()
    assert (len(bpy.data.objects), len(bpy.data.lights)) == things


def test_every_setting_of_the_core_is_a_choice_with_the_same_default(scene):
    from dataclasses import asdict

    from sunsplit.addon.options import settings_for

    own = {name: getattr(scene.sunsplit, name) for name in CHOICES}
    assert settings_for(own, "CYCLES") == ConversionSettings()
    found_out = {"mirrors"}  # by a look at the scene
    assert {*CHOICES, *found_out} == {
        *asdict(ConversionSettings()),
        "share_auto",
        "skips",
        "two_passes",
        "light_groups",
    }


def test_an_automatic_fill_or_a_chosen_one(scene, sunrise):
    sun = np.flatnonzero(convert(load(sunrise), ConversionSettings(share=0.5)).strata.region_a)
    row, column = np.divmod(sun, 1024)
    for fill, black in (("surroundings", False), ("auto", True), ("black", True)):
        bpy.ops.sunsplit.convert(share=0.5, method="kmeans", fill=fill, skips=False)
        image = scene.world.node_tree.nodes["Sunsplit: Residual"].image
        pixels = np.empty(1024 * 512 * 4, np.float32)
        image.pixels.foreach_get(pixels)
        shown = pixels.reshape(512, 1024, 4)[::-1][row, column, :3]
        assert (shown == 0).all() == black
