"""Discs that are tilted so that level ground gets what it should."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.placement.level import MOST, levelled
from sunsplit.core.suns import disc_on_ground, disc_sun, point_sun
from tests.maps import direction

WHITE = np.ones(3)


def on_ground(suns) -> np.ndarray:
    """Of each channel, the part that level ground gets."""
    flux = np.array([sun.scalar_irradiance for sun in suns])
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    heights = np.array([sun.to_light[2] for sun in suns])
    return disc_on_ground(heights, half) @ flux / flux.sum(axis=0)


def discs():
    """A narrow sun and wide lights across the horizon, of several colours."""
    return (
        disc_sun(np.array([30.0, 25, 20]), direction(10, 40), 1e-4, 2),
        disc_sun(np.array([1.0, 2, 4]), direction(100, 3), 0.05, 2),
        disc_sun(np.array([4.0, 2, 1]), direction(200, -5), 0.1, 2),
        disc_sun(np.array([1.0, 1, 1]), direction(300, 60), 0.2, 2),
    )


def test_ground_gets_what_it_should_in_every_channel():
    random = np.random.default_rng(3)
    suns = tuple(
        disc_sun(random.uniform(1, 3, 3), direction(24 * k, random.uniform(-20, 60)), 0.05, 2)
        for k in range(15)
    )
    wanted = on_ground(suns) + np.array([0.006, -0.004, 0.002])
    assert on_ground(levelled(suns, wanted)) == pytest.approx(wanted, abs=2e-4)


def test_bright_and_narrow_discs_stay_and_the_others_keep_their_side():
    suns = discs()
    after = levelled(suns, on_ground(suns) + 0.01)
    tilts = [sphere.angle_between(a.to_light, b.to_light) for a, b in zip(suns, after, strict=True)]
    assert tilts[0] < max(tilts) / 50
    for one, other in zip(suns, after, strict=True):
        assert np.linalg.norm(other.to_light) == pytest.approx(1, abs=1e-12)
        before, after_it = one.to_light[:2], other.to_light[:2]
        aside = before[0] * after_it[1] - before[1] * after_it[0]
        assert aside == pytest.approx(0, abs=1e-12)
        assert before @ after_it > 0
        assert (other.scalar_irradiance == one.scalar_irradiance).all()


def test_no_disc_is_tilted_by_much_of_its_width():
    suns = discs()
    for one, other in zip(suns, levelled(suns, on_ground(suns) + 0.5), strict=True):
        tilt = sphere.angle_between(one.to_light, other.to_light)
        assert tilt <= MOST * one.angular_diameter / 2 + 1e-12


def test_points_and_what_is_right_already_stay():
    points = (point_sun(WHITE, direction(0, 20), 2), point_sun(WHITE, direction(0, -20), 2))
    assert levelled(points, on_ground(points) + 0.1) == points
    suns = discs()
    for one, other in zip(suns, levelled(suns, on_ground(suns)), strict=True):
        assert other.to_light == pytest.approx(one.to_light, abs=1e-9)


def test_a_channel_without_light_asks_for_nothing():
    red = np.array([1.0, 0, 0])
    suns = tuple(disc_sun(red, direction(40 * k, 4 * k - 8), 0.05, 2) for k in range(5))
    wanted = np.array([0.01, 0, 0]) + on_ground_of_red(suns)
    after = levelled(suns, np.array([wanted[0], np.nan, np.nan]))
    assert on_ground_of_red(after)[0] == pytest.approx(wanted[0], abs=2e-4)


def on_ground_of_red(suns) -> np.ndarray:
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    heights = np.array([sun.to_light[2] for sun in suns])
    return np.array([disc_on_ground(heights, half).mean(), 0, 0])
