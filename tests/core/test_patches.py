"""Patches hold what the pixels hold: light, mean direction, spread."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import load
from sunsplit.core.moments import Moments
from sunsplit.core.patches import Patches, patches_of
from sunsplit.core.region import RegionLight, light_of_map
from tests.maps import direction, paint_disc, sky


def light_of(pixels: np.ndarray) -> RegionLight:
    light = light_of_map(pixels.astype(np.float32))
    return light.part(light.luminous_flux > 0)


def patched(light: RegionLight, most: int) -> Patches:
    return patches_of(light, light.luminous_flux, most)


def moments(patches: Patches) -> tuple[np.ndarray, float]:
    """Mean direction and 1 - R of all patches together."""
    weight = patches.flux @ [0.2126, 0.7152, 0.0722]
    vector = weight * (1 - patches.spread) @ patches.directions
    length = np.linalg.norm(vector)
    return vector / length, 1 - length / weight.sum()


@pytest.mark.parametrize("size", [(256, 128), (250, 125), (130, 65)])
@pytest.mark.parametrize("most", [500, 3000])
def test_light_direction_and_spread_are_kept(size, most):
    random = np.random.default_rng(2)
    pixels = random.random((size[1], size[0], 3)) * 0.1
    pixels[5, 7] = 4000, 300, 20
    pixels[:, : size[0] // 2] *= 2
    light = light_of(pixels)
    patches = patched(light, most)
    assert len(patches) <= most + 12
    assert patches.flux.sum(axis=0) == pytest.approx(light.flux.sum(axis=0), rel=1e-12)
    exact = Moments(light, np.zeros(len(light.pixels), np.intp), 1)
    mean, shortfall = moments(patches)
    assert mean == pytest.approx(exact.to_light[0], abs=1e-4)
    assert shortfall == pytest.approx(exact.shortfall[0], rel=5e-4)
    assert np.linalg.norm(patches.directions, axis=1) == pytest.approx(1, abs=1e-12)


def test_bright_light_keeps_its_pixels_and_faint_light_becomes_blocks():
    pixels = sky(512, 0.2)
    paint_disc(pixels, direction(30, 20), 12, (900, 800, 700))
    light = light_of(pixels)
    patches = patched(light, 4000)
    bright = np.flatnonzero(pixels[..., 1].ravel() > 400)
    single = patches.spread < 1.01 * patches.spread.min() * 4
    found = np.isin(light.flux[np.isin(light.pixels, bright), 1], patches.flux[single, 1])
    assert found.all()
    assert len(patches) > 3500
    assert patches.spread.max() > 50 * patches.spread.min()


@pytest.mark.parametrize("most", [256, 512, 2048])
def test_a_sun_is_no_block_however_many_blocks_its_sky_has(sunrise, most):
    """A map 1,024 wide has 2,048 of the largest."""
    light = light_of_map(load(sunrise).radiance)
    patches = patched(light, most)
    brightest = patches.spread[np.argmax(patches.flux.sum(axis=1))]
    assert brightest < 2 * light.spread().max()
    assert 2048 < len(patches) < 2048 + most


def test_few_pixels_are_themselves(sunrise):
    light = light_of_map(load(sunrise).radiance)
    faint = light.luminous_flux < np.median(light.luminous_flux)
    some = light.part(faint & (np.arange(len(light.pixels)) % 500 == 0))
    patches = patched(some, 1000)
    assert (patches.flux == some.flux).all()


def test_a_pixel_with_much_light_is_four():
    pixels = sky(64, 0.01)
    pixels[10, 63] = 5000, 3000, 1000
    light = light_of(pixels)
    patches = patched(light, 5000)
    assert len(patches) == len(light.pixels) + 3
    four = patches.flux[:, 0] > 1
    assert four.sum() == 4
    sun = light.flux[light.flux[:, 0] > 1][0]
    assert patches.flux[four].sum(axis=0) == pytest.approx(sun, rel=1e-12)
    whole = light.part(light.flux[:, 0] > 1)
    exact = Moments(whole, np.zeros(1, np.intp), 1)
    mean, shortfall = moments(Patches(*(getattr(patches, n)[four] for n in vars(patches))))
    assert mean == pytest.approx(exact.to_light[0], abs=3e-4)
    assert shortfall == pytest.approx(exact.shortfall[0], rel=0.01)


def test_what_does_not_shine_is_no_patch():
    pixels = sky(64, 0.0)
    pixels[3, 3] = 1
    pixels[20, 20] = 1
    patches = patched(light_of_map(pixels.astype(np.float32)), 10)
    assert len(patches) == 8  # two pixels, in four each


def test_the_brightest_pixel_of_a_block_is_remembered():
    pixels = sky(256, 0.2)
    pixels[40, 50] = 0.3
    light = light_of(pixels)
    brightness = pixels[..., 1].ravel()[light.pixels]
    patches = patches_of(light, brightness, 1000)
    assert patches.brightness.max() == 0.3
    assert patches.brightness.min() == 0.2


def test_faint_colours_have_patches_too():
    """A red and a blue half: each is all that there is of its colour, whatever its luminance."""
    pixels = sky(512, 0.0)
    pixels[:, :256, 0] = pixels[:, 256:, 2] = 1
    pixels *= 0.5 + np.random.default_rng(2).random((256, 512, 1))
    light = light_of_map(pixels.astype(np.float32))
    found = patches_of(light, light.luminous_flux, 2000)
    red = int((found.flux[:, 0] > 0).sum())
    blue = int((found.flux[:, 2] > 0).sum())
    print(red, blue)
    assert blue > 0.75 * red  # .58 by luminance alone
