"""What is read of an image's file is what Blender reads of it."""

from __future__ import annotations

import bpy
import numpy as np
import OpenEXR
import pytest

from sunsplit.addon import known
from sunsplit.addon.images import _file_of, _from_pixels, _pixels_of, read_image
from sunsplit.addon.steps import run_at_once
from sunsplit.core.errors import UnusableInput
from tests.blender import fresh_scene

SOME = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32) * 50
ALPHA = np.full((64, 128, 1), 0.5, np.float32)
RGBA = np.concatenate([SOME, ALPHA], axis=-1)

CHANNELS = {
    "colour": {"RGB": SOME},
    "alpha": {"RGBA": RGBA},
    "half": {"RGBA": RGBA.astype(np.float16)},
    "grey": {"Y": SOME[..., 0].copy()},
}


@pytest.fixture(autouse=True)
def fresh():
    known.forget()
    fresh_scene()


def written(path, channels, **header):
    kind = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(kind | header, channels) as file:
        file.write(str(path))
    return bpy.data.images.load(str(path))


def as_blender_has_it(image):
    pixels = _pixels_of(image)
    return _from_pixels(pixels, (image.size[1], image.size[0], image.channels), image.name)


@pytest.mark.parametrize("kind", CHANNELS)
def test_an_exr_file(tmp_path, kind):
    image = written(tmp_path / "map.exr", CHANNELS[kind])
    assert _file_of(image) is not None
    found = run_at_once(read_image(image))
    assert not image.has_data  # Blender did not need to load it
    assert np.array_equal(found.radiance, as_blender_has_it(image).radiance)


def test_a_radiance_file(sunrise):
    image = bpy.data.images.load(str(sunrise))
    found = run_at_once(read_image(image))
    assert not image.has_data
    assert np.array_equal(found.radiance, as_blender_has_it(image).radiance)
    assert (found.name, found.file) == (sunrise.stem, sunrise.name)


def test_pixels_that_were_changed_count_and_not_the_file(tmp_path):
    image = written(tmp_path / "map.exr", CHANNELS["colour"])
    image.pixels.foreach_set(np.full(64 * 128 * image.channels, 7, np.float32))
    assert _file_of(image) is None
    assert (run_at_once(read_image(image)).radiance == 7).all()


def test_a_colour_space_that_is_not_the_files_is_left_to_blender(tmp_path):
    image = written(tmp_path / "map.exr", CHANNELS["colour"])
    image.colorspace_settings.name = "ACEScg"
    assert _file_of(image) is None
    found = run_at_once(read_image(image)).radiance
    assert found == pytest.approx(as_blender_has_it(image).radiance)
    assert not np.allclose(found, SOME, rtol=0.01)


@pytest.mark.parametrize("channels", [{"View.Combined.RGB": SOME}, {"RGB": SOME, "Z.RGB": SOME}])
def test_several_layers_are_refused(tmp_path, channels):
    with pytest.raises(UnusableInput, match="is a multilayer EXR"):
        run_at_once(read_image(written(tmp_path / "map.exr", channels)))


def test_a_cropped_picture_is_what_blender_makes_of_it(tmp_path):
    window = (np.array([0, 0], np.int32), np.array([127, 63], np.int32))
    smaller = (np.array([16, 8], np.int32), np.array([111, 55], np.int32))
    image = written(
        tmp_path / "map.exr",
        {"RGB": np.ascontiguousarray(SOME[8:56, 16:112])},
        displayWindow=window,
        dataWindow=smaller,
    )
    found = run_at_once(read_image(image))
    assert np.array_equal(found.radiance, as_blender_has_it(image).radiance)
