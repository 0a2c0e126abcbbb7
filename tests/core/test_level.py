"""Discs that are tilted so that level ground gets what it should."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ConversionSettings, convert, sphere
from sunsplit.core.placement.level import MOST, Level, levelled
from sunsplit.core.suns import disc_on_ground, disc_sun, point_sun
from tests.maps import direction, environment

WHITE = np.ones(3)


def on_ground(suns) -> np.ndarray:
    """Of each channel, the part that level ground gets."""
    flux = np.array([sun.scalar_irradiance for sun in suns])
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    heights = np.array([sun.to_light[2] for sun in suns])
    return disc_on_ground(heights, half) @ flux / flux.sum(axis=0)


def raised(suns, wanted, limit=1e-4, shadows=1.0, wrong=0.0):
    """Tilted until the ground has what is wanted, where shadows may be wrong by so much."""
    level = Level(wanted, None, on_ground=limit, on_walls=np.inf, shadows=shadows)
    return levelled(suns, level, wrong, costs=0.65)


def tilts_of(suns, after) -> np.ndarray:
    """Radians."""
    pairs = zip(suns, after, strict=True)
    return np.array([sphere.angle_between(one.to_light, other.to_light) for one, other in pairs])


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
    assert on_ground(raised(suns, wanted)) == pytest.approx(wanted, abs=1e-4)


def test_bright_and_narrow_discs_stay_and_the_others_keep_their_side():
    suns = discs()
    after = raised(suns, on_ground(suns) + 0.01)
    tilts = tilts_of(suns, after)
    assert tilts[0] < tilts.max() / 50
    for one, other in zip(suns, after, strict=True):
        assert np.linalg.norm(other.to_light) == pytest.approx(1, abs=1e-12)
        before, after_it = one.to_light[:2], other.to_light[:2]
        aside = before[0] * after_it[1] - before[1] * after_it[0]
        assert aside == pytest.approx(0, abs=1e-12)
        assert before @ after_it > 0
        assert (other.scalar_irradiance == one.scalar_irradiance).all()


def test_no_disc_is_tilted_by_much_of_its_width():
    suns = discs()
    most = MOST * np.array([sun.angular_diameter / 2 for sun in suns])
    tilts = tilts_of(suns, raised(suns, on_ground(suns) + 0.5))
    assert (tilts <= most + 1e-12).all()
    # What some of them cannot give any more, others do, as far as they may.
    assert (tilts > 0.9 * most).sum() >= 3


def test_a_tilt_is_as_small_as_is_enough():
    suns = discs()
    wanted = on_ground(suns) + 0.01
    limits = [0.001, 0.003, 0.006, 0.02]
    tilted = [raised(suns, wanted, limit) for limit in limits]
    tilts = [tilts_of(suns, after).max() for after in tilted]
    assert tilts == sorted(tilts, reverse=True)
    assert tilts[-1] == 0  # right enough as it is
    for after, limit in zip(tilted, limits, strict=True):
        assert np.abs(on_ground(after) - wanted).max() <= limit


def test_the_worst_of_ground_and_shadows_is_best():
    """Where both cannot be right enough, a tilt must not cost shadows more than it gives."""
    suns = discs()
    wanted = on_ground(suns) + 0.03
    off = [
        np.abs(on_ground(raised(suns, wanted, 0.005, shadows, wrong)) - wanted).max() / 0.005
        for shadows, wrong in ((1.0, 0.0), (0.005, 0.0), (0.002, 0.0), (0.002, 20.0))
    ]
    print(off)
    assert off[0] <= 1 < off[1] < off[2] < 6
    assert off[3] == pytest.approx(6)  # the ground is less wrong than shadows are anyway


def test_points_and_what_is_right_already_stay():
    points = (point_sun(WHITE, direction(0, 20), 2), point_sun(WHITE, direction(0, -20), 2))
    assert raised(points, on_ground(points) + 0.1) == points
    suns = discs()
    assert raised(suns, on_ground(suns)) == suns


def test_a_channel_without_light_asks_for_nothing():
    red = np.array([1.0, 0, 0])
    suns = tuple(disc_sun(red, direction(40 * k, 4 * k - 8), 0.05, 2) for k in range(5))
    wanted = np.array([0.01, 0, 0]) + on_ground_of_red(suns)
    after = raised(suns, np.array([wanted[0], np.nan, np.nan]))
    assert on_ground_of_red(after)[0] == pytest.approx(wanted[0], abs=2e-4)


def on_ground_of_red(suns) -> np.ndarray:
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    heights = np.array([sun.to_light[2] for sun in suns])
    return np.array([disc_on_ground(heights, half).mean(), 0, 0])


def test_colours_that_one_faint_sun_alone_has():
    """All of red and of blue are in one disc, which may be tilted at no cost."""
    green, faint = np.array([0, 1.0, 0]), np.array([1e-7, 0, 1e-7])
    suns = (
        disc_sun(green, direction(10, 3), 0.05, 2),
        disc_sun(green, direction(100, 20), 0.05, 2),
        disc_sun(faint, direction(200, 1), 0.05, 2),
    )
    wanted = on_ground(suns) + 0.01
    assert np.abs(on_ground(raised(suns, wanted)) - wanted).max() <= 1e-3


def test_a_map_whose_red_and_blue_are_in_one_faint_sun():
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[...] = 0, 1, 0
    pixels[20:44, 30:50] = 1e-6
    conversion = convert(environment(pixels), ConversionSettings(share=1, tolerance=0.5))
    assert conversion.suns
