from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core.environment import environment_from_pixels, luminance, scalar_irradiance
from sunsplit.core.errors import UnusableInput
from tests.maps import disc_energy, environment, paint_disc, sky


def test_a_constant_map_gives_four_pi():
    assert scalar_irradiance(sky(64, (1, 2, 3)).astype(np.float32)) == pytest.approx(
        4 * np.pi * np.array([1, 2, 3]), rel=1e-12
    )


def test_luminance_is_double_precision_on_every_numpy():
    assert luminance(np.ones((2, 4, 3), np.float32)).dtype == np.float64


def test_clean_pixels_are_taken_as_they_are():
    pixels = sky(32).astype(np.float32)
    found = environment(pixels)
    assert found.repairs.pixels == 0
    assert (found.radiance == pixels).all()


def test_nan_becomes_the_mean_of_its_neighbours_over_the_seam():
    pixels = sky(16, 1.0)
    pixels[3, 15] = 5.0
    pixels[3, 0] = np.nan
    found = environment(pixels)
    assert found.repairs.nan == 1
    assert found.radiance[3, 0] == pytest.approx(np.full(3, (7 + 5) / 8))


def test_infinite_light_becomes_the_brightest_there_is():
    pixels = sky(16, 1.0)
    pixels[2, 2, 0] = np.inf
    pixels[5, 5, 0] = 1e6
    found = environment(pixels)
    assert found.repairs.infinite == 1
    assert found.radiance[2, 2] == pytest.approx([1e6, 1, 1])
    pixels[5, 5, 0] = 1
    assert environment(pixels).radiance[2, 2, 0] == 65504


def test_negative_light_becomes_dark_and_is_accounted_for():
    pixels = sky(16, 1.0)
    pixels[4, 4, 1] = -2.0
    pixels[4, 5] = -np.inf
    found = environment(pixels)
    assert found.repairs.negative == 2
    assert found.radiance.min() == 0
    solid = 4 * np.pi * np.sin(np.pi * 4.5 / 8) * np.sin(np.pi / 16) / 16
    assert found.repairs.negative_energy == pytest.approx((0, 2 * solid, 0))


def test_a_map_of_nothing_but_broken_pixels_is_refused():
    with pytest.raises(UnusableInput, match="no light"):
        environment(np.full((4, 8, 3), np.nan))


@pytest.mark.parametrize(
    ("shape", "hint"),
    [
        ((64, 64), "angular map"),
        ((48, 64), "cube map"),
        ((64, 48), "cube map"),
        ((64, 100), "ordinary picture"),
    ],
)
def test_maps_that_are_not_two_to_one_are_named(shape, hint):
    with pytest.raises(UnusableInput, match=hint):
        environment_from_pixels(np.ones((*shape, 3)), "map")


def test_a_black_map_is_refused():
    with pytest.raises(UnusableInput, match="holds no light"):
        environment(np.zeros((4, 8, 3)))


def test_the_energy_of_a_disc():
    pixels = sky(512, 0.0)
    paint_disc(pixels, np.array([0.0, 1, 0]), 10, (1, 1, 1))
    got = scalar_irradiance(pixels.astype(np.float32))[0]
    assert got == pytest.approx(disc_energy(10, 1), rel=1e-3)
