"""A map is known by its content: not converted twice, never taken for another."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from sunsplit.addon import known
from sunsplit.addon.scene import convert_scene
from sunsplit.addon.trace import TAG
from sunsplit.core.settings import ConversionSettings
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


def test_converting_again_gives_what_converting_afresh_does(tmp_path):
    """To the bit, of a map so wide that it is looked at narrowed."""
    random = np.random.default_rng(0)
    pixels = sky(2048, 0.3) * random.random((1024, 2048, 1)) ** 2
    for place in ((40, 35), (140, 15), (-70, 60)):
        paint_disc(pixels, direction(*place), 2, random.random(3) * 900, fine=2)
    path = write_map(tmp_path / "wide.exr", pixels)
    choices = [{"lights": 8}, {"lights": 5}, {"share": 0.5}, {"share": 0.6}, {}]
    known.forget()
    scene = fresh_scene()
    hdri_world(scene, path)
    again = [_made(scene, choice) for choice in choices]
    for choice, one in zip(choices, again, strict=True):
        known.forget()
        scene = fresh_scene()
        hdri_world(scene, path)
        other = _made(scene, choice)
        assert np.array_equal(one.pop("residual"), other.pop("residual"))
        assert one == other


def _made(scene, choice):
    """All that a conversion leaves in a scene, as numbers and text."""
    convert_scene(scene, ConversionSettings(**choice))
    state = scene.sunsplit
    image = next(i for i in bpy.data.images if i.get(TAG) == "residual" and i.users)
    pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return {
        "residual": pixels,
        "outlines": state.outlines,
        "report": state.report,
        "lamps": [
            (lamp.name, lamp.data.energy, *lamp.data.color, lamp.data.angle, *to_light(lamp))
            for lamp in suns(scene)
        ],
        "sampling": scene.world.cycles.sampling_method,
    }


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
