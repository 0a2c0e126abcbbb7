"""Closed forms: what a disc sun must be for light whose moments are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import sphere
from sunsplit.core.cells import Cell, split
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.suns import Sun, disc_sun
from tests.maps import direction, disc_energy, paint_disc, painted_radius, sky


def cell_of(pixels: np.ndarray) -> Cell:
    height, width = pixels.shape[:2]
    lit = np.flatnonzero(pixels.any(axis=-1))
    solid = sphere.row_solid_angles(width, height)[lit // width, None]
    return Cell.of(lit, pixels.reshape(-1, 3)[lit] * solid, width, height)


def sun_of(pixels: np.ndarray) -> Sun:
    cell = cell_of(pixels)
    return disc_sun(cell.flux.sum(axis=0), cell.to_light, cell.shortfall, 1)


PLACES = {
    "side": direction(40, 20),
    "seam": direction(180, -35),
    "pole": direction(0, 90),
    "near the pole": direction(123, -86),
}


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES.keys())
@pytest.mark.parametrize("radius", [1.0, 4.0, 15.0, 60.0])
def test_a_disc_gives_itself_back(place, radius):
    pixels = sky(1024, 0.0)
    paint_disc(pixels, place, radius, (3, 2, 1))
    sun = sun_of(pixels)
    assert np.degrees(sphere.angle_between(sun.to_light, place)) < 0.02
    expected = 2 * painted_radius(radius, 1024, place)
    assert np.degrees(sun.angular_diameter) == pytest.approx(expected, rel=0.01, abs=0.04)
    assert sun.scalar_irradiance == pytest.approx(
        disc_energy(radius, 1) * np.array([3, 2, 1]), rel=3e-3
    )


@given(st.floats(0.5, 89))
def test_irradiance_of_a_disc_in_closed_form(radius):
    """A uniform cap of radiance L gives a facing surface pi L sin^2 a."""
    shortfall = (1 - np.cos(np.radians(radius))) / 2
    sun = disc_sun(np.array([3.0, 2, 1]), np.array([0.0, 0, 1]), shortfall, 1)
    assert np.degrees(sun.angular_diameter) == pytest.approx(2 * radius, rel=1e-9)
    expected = np.pi * sun.radiance * np.sin(np.radians(radius)) ** 2
    assert sun.irradiance == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("row", [20, 100, 240])
def test_one_pixel_is_as_large_as_itself(row):
    pixels = sky(512, 0.0)
    pixels[row, 7] = 1e5
    sun = sun_of(pixels)
    high = np.pi / 256
    wide = high * np.sin((row + 0.5) * high)
    # The disc's second moment is a^2 / 2, the pixel's (w^2 + h^2) / 12.
    assert sun.angular_diameter == pytest.approx(2 * np.sqrt((wide**2 + high**2) / 6), rel=1e-3)


def test_two_opposite_discs_have_no_disc_and_are_cut_apart():
    pixels = sky(256, 0.0)
    for place in (direction(10, 30), direction(190, -30)):
        paint_disc(pixels, place, 3, (1, 1, 1))
    both = cell_of(pixels)
    assert both.angular_diameter == pytest.approx(np.pi)
    parts = split(both)
    assert len(parts) == 2
    found = sorted(np.degrees(part.angular_diameter) for part in parts)
    assert found == pytest.approx([2 * painted_radius(3, 256, direction(10, 30))] * 2, rel=0.01)
    whole = sum(part.flux.sum(axis=0) for part in parts)
    assert whole == pytest.approx(scalar_irradiance(pixels.astype(np.float32)), rel=1e-6)


def test_one_pixel_cannot_be_cut():
    pixels = sky(64, 0.0)
    pixels[3, 3] = 1
    assert split(cell_of(pixels)) == ()


def test_a_disc_fits_a_disc_and_not_a_bar():
    disc, bar = sky(512, 0.0), sky(512, 0.0)
    paint_disc(disc, direction(0, 0), 10, (1, 1, 1))
    bar[124:132, 200:312] = 1
    assert cell_of(disc).misfit() < 0.003 * cell_of(disc).total
    assert cell_of(bar).misfit() > 0.03 * cell_of(bar).total


def test_the_misfit_is_the_error_of_shadow_edges_measured():
    """Predicted against brute force: random half spaces over a bar of light and over its disc."""
    pixels = sky(512, 0.0)
    pixels[120:136, 200:312] = 1
    bar = cell_of(pixels)
    disc = sky(512, 0.0)
    paint_disc(disc, bar.to_light, np.degrees(bar.angular_diameter / 2), (1, 1, 1))
    disc = cell_of(disc)
    random = np.random.default_rng(0)
    first, second = sphere.tangents(bar.to_light)
    turn = random.uniform(0, np.pi, 4000)
    edge = random.uniform(-1, 1, 4000)
    errors = []
    for t, x in zip(turn, edge, strict=True):
        across = np.cos(t) * first + np.sin(t) * second
        lit = [c.luminous_flux[c.directions @ across < x].sum() / c.total for c in (bar, disc)]
        errors.append(lit[0] - lit[1])
    measured = bar.total * np.sqrt(np.mean(np.square(errors)))
    print(f"predicted {bar.misfit():.5f}, measured {measured:.5f}")
    assert bar.misfit() == pytest.approx(measured, rel=0.1)
