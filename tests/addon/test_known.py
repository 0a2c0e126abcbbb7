"""A map is known by its content: not converted twice, never taken for another."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from sunsplit.addon import known
from tests.blender import fresh_scene, hdri_world, suns, to_light, write_map
from tests.maps import direction, paint_disc, sky


def map_with_sun(azimuth):
    pixels = sky(256, 0.3)
    paint_disc(pixels, direction(azimuth, 40), 2, (900, 800, 700))
    return pixels


@pytest.fixture
def scene(tmp_path):
    known.forget()
    made = fresh_scene()
    hdri_world(made, write_map(tmp_path / "map.exr", map_with_sun(40)))
    return made


def azimuth(scene):
    x, y, _ = to_light(suns(scene)[0])
    return np.degrees(np.arctan2(y, x))


def test_a_world_that_is_turned_is_not_converted_anew(scene, monkeypatch):
    bpy.ops.sunsplit.convert(lights=1)
    monkeypatch.setattr(known, "convert", None)  # would raise
    tree = scene.world.node_tree
    mapping = tree.nodes.new("ShaderNodeMapping")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0, 0, np.radians(-30))
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    for texture in [n for n in tree.nodes if n.type == "TEX_ENVIRONMENT"]:
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    bpy.ops.sunsplit.convert(lights=1)
    assert azimuth(scene) == pytest.approx(70, abs=0.1)


def test_other_settings_are_another_conversion_of_the_same_map(scene, monkeypatch):
    bpy.ops.sunsplit.convert(lights=1)
    monkeypatch.setattr("sunsplit.addon.images.load", None)  # would raise
    bpy.ops.sunsplit.convert(lights=4, share=0.9)
    assert len(suns(scene)) > 1


def test_a_file_with_other_content_is_another_map(scene, tmp_path):
    bpy.ops.sunsplit.convert(lights=1)
    assert azimuth(scene) == pytest.approx(40, abs=0.1)
    write_map(tmp_path / "map.exr", map_with_sun(-100))
    bpy.data.images["map.exr"].reload()
    bpy.ops.sunsplit.convert(lights=1)
    assert azimuth(scene) == pytest.approx(-100, abs=0.1)


@pytest.mark.parametrize("pixel", [0, 4 * 256 * 60 + 5, 4 * 256 * 128 - 2])
def test_one_changed_number_is_another_map(scene, pixel):
    image = next(i for i in bpy.data.images if i.size[0])
    numbers = np.empty(256 * 128 * 4, np.float32)
    image.pixels.foreach_get(numbers)
    before = known._fingerprint(numbers)
    assert known._fingerprint(numbers.copy()) == before
    numbers[pixel] = np.nextafter(numbers[pixel], np.float32(np.inf))
    assert known._fingerprint(numbers) != before


def test_exchanged_rows_are_another_map():
    numbers = np.random.default_rng(0).random(4 * 512 * 256).astype(np.float32)
    for rows in (numbers.reshape(256, -1), numbers.reshape(-1, 2), numbers.reshape(-1, 2**17)):
        other = np.ascontiguousarray(rows[::-1]).ravel()
        assert known._fingerprint(other) != known._fingerprint(numbers)


def test_what_is_too_large_in_memory_is_not_kept(scene, monkeypatch):
    bpy.data.images["map.exr"].pack()
    bpy.ops.sunsplit.convert(lights=1)
    assert known._last
    monkeypatch.setattr(known, "MOST_BYTES", 1000)
    bpy.ops.sunsplit.convert(lights=1)
    assert not known._last
    assert azimuth(scene) == pytest.approx(40, abs=0.1)
