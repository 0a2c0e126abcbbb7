"""The noise that a border between suns and residual leaves, against sums over all pixels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import sphere
from sunsplit.core.environment import luminance
from sunsplit.core.noise import OTHERWISE, borders, harmonics, mean_square_irradiance
from tests.maps import direction, paint_disc, sky

SIZE = 64, 32


def everywhere() -> tuple[np.ndarray, np.ndarray]:
    """Directions and solid angles of a fine map's pixels."""
    directions = sphere.pixel_directions(np.arange(256 * 128), 256, 128)
    return directions, np.repeat(sphere.row_solid_angles(256, 128), 256)


def test_harmonics_are_orthonormal():
    directions, solid = everywhere()
    values = harmonics(directions)
    assert (values * solid[:, None]).T @ values == pytest.approx(np.eye(9), abs=1e-3)


@pytest.mark.parametrize("angle", [0, 40, 90, 180])
def test_the_mean_square_irradiance_of_two_lights(angle):
    directions, solid = everywhere()
    lights = np.array([direction(0, 0), direction(angle, 0)])
    irradiance = np.maximum(directions @ lights.T, 0) @ [1.0, 2.0]
    exact = solid @ irradiance**2 / (4 * np.pi)
    assert mean_square_irradiance([1.0, 2.0] @ harmonics(lights)) == pytest.approx(exact, rel=0.02)


def random_map(seed: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    lum = np.exp(spread * random.standard_normal(SIZE[::-1]))
    return lum, sphere.row_solid_angles(*SIZE)


@pytest.mark.parametrize("spread", [0.3, 2.0])
def test_variances_are_those_of_samples_on_all_surfaces(spread):
    lum, solid = random_map(4, spread)
    found = borders(lum, solid)
    weight = np.repeat(solid, SIZE[0])
    facing = np.maximum(sphere.pixel_directions(np.arange(lum.size), *SIZE) @ everywhere()[0].T, 0)
    normals = everywhere()[1] / (4 * np.pi)
    unit = 16 / (weight @ lum.ravel()) ** 2
    for k in range(0, len(found.level), 5):
        rest = np.minimum(lum, found.level[k]).ravel()
        suns = (lum.ravel() - rest) * weight
        by_surfaces = np.pi * (weight * rest**2) @ facing - ((weight * rest) @ facing) ** 2
        by_strength = suns.sum() * (suns @ facing**2) - (suns @ facing) ** 2
        assert found.residual[k] == pytest.approx(unit * by_surfaces @ normals, rel=0.02, abs=0.01)
        assert found.suns[k] == pytest.approx(unit * by_strength @ normals, rel=0.02, abs=0.01)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 5), st.floats(-60, 60))
def test_a_border_is_of_the_map_and_not_of_its_unit(seed, spread, exponent):
    lum, solid = random_map(seed, spread)
    unit = 10.0**exponent
    found, scaled = borders(lum, solid), borders(unit * lum, solid)
    assert scaled.best_level == pytest.approx(unit * found.best_level, rel=1e-9)
    assert (found.suns >= -1e-9).all()
    assert found.variance.min() >= OTHERWISE - 0.02


def test_through_openings_a_path_tracer_looks_for_one_of_both_by_its_strength():
    """A sun and an even sky: the chance of each at surfaces of all orientations, by their sums."""
    lum, solid = np.ones(SIZE[::-1]), sphere.row_solid_angles(*SIZE)
    lum[10, 20] = 2000.0
    part = 0.015
    found = borders(lum, solid, part)
    normals = everywhere()[1] / (4 * np.pi)
    facing = np.maximum(
        everywhere()[0] @ sphere.pixel_directions(np.array([10 * 64 + 20]), *SIZE).T, 0
    )
    facing = facing[:, 0]
    whole = float(solid @ lum.sum(axis=1))
    k = int(np.argmax(found.level < 500))
    level = found.level[k]
    sun = (2000.0 - level) * solid[10]
    rest = whole - sun
    to_sun = sun * facing / (sun * facing + rest / 4)
    unit = 16 / whole**2
    lit = facing > 0
    of_sun = unit * ((sun * facing[lit]) ** 2 / to_sun[lit]) @ normals[lit]
    squares = float(solid @ (np.minimum(lum, level) ** 2).sum(axis=1))
    of_sky = unit * np.pi / 3 * part * squares * (1 / (1 - to_sun)) @ normals
    assert found.suns[k] == pytest.approx(of_sun, rel=0.02)
    assert found.residual[k] == pytest.approx(of_sky, rel=0.02)


def test_through_openings_a_little_of_the_light_is_not_worth_a_sun():
    """Looked for so seldom it would be noisier than the sky that it stands in."""
    lum, solid = np.ones(SIZE[::-1]), sphere.row_solid_angles(*SIZE)
    lum[10, 20:24] = 30.0
    assert borders(lum, solid, 0.015).best == 0
    lum[10, 20:24] = 400.0
    assert borders(lum, solid, 0.015).best > 0


def test_nothing_is_worth_a_sun_in_an_even_sky():
    lum, solid = random_map(0, 0.1)
    assert borders(lum, solid).best_level == lum.max()


@pytest.mark.parametrize("width", [128, 256, 512])
def test_a_sun_and_its_halo_are_above_the_border_at_every_width(width):
    pixels = sky(width, 1.0)
    paint_disc(pixels, direction(40, 30), 12, (20, 20, 20))
    paint_disc(pixels, direction(40, 30), 5, (3000, 3000, 3000))
    solid = sphere.row_solid_angles(width, width // 2)
    assert 1 < borders(luminance(pixels), solid).best_level < 20
