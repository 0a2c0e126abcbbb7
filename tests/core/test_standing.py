"""Walls on level ground get from suns what they get from the light in their place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sunsplit.core import ConversionSettings, convert, load
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.placement.level import Level, levelled
from sunsplit.core.standing import NORMALS, WALLS, discs_on_walls
from sunsplit.core.suns import disc_on_ground, disc_sun
from tests.benchmarks.occluders import NEVER, Occluders, light_of, light_of_suns
from tests.maps import direction, environment, paint_disc, sky

GROUND = Occluders(NORMALS, np.array([[[0, 0, -1.0]] * 2] * WALLS), np.array([[0, NEVER]] * WALLS))
"""Walls whose ground hides all below the horizon."""


@pytest.mark.parametrize("elevation", [-9, -2, 0, 4, 9, 30])
@pytest.mark.parametrize("radius", [2.0, 5.0, 12.0])
def test_a_disc_gives_walls_what_its_pixels_give(elevation, radius):
    pixels = np.zeros_like(sky(1024))
    paint_disc(pixels, direction(70, elevation), radius, 100)
    directions, flux = light_of(environment(pixels + 1e-9))[:2]
    expected = GROUND.irradiance(directions, flux)[:, 0] / flux[:, 0].sum()
    found = discs_on_walls(direction(70, elevation)[None], np.radians([radius]))[0]
    # A pixel is on one side of the horizon, a sixty-fourth of a disc is cut by it.
    assert found == pytest.approx(expected, abs=0.01)


def test_tilted_discs_give_walls_and_ground_what_they_should():
    """Lights above the horizon, with discs in their places that reach below it."""
    suns = tuple(
        disc_sun(np.full(3, 1.0 + k % 3), direction(30 * k, 2 + 3 * (k % 4)), 0.01, 2)
        for k in range(12)
    )
    to_light = np.array([sun.to_light for sun in suns])
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    part = np.array([sun.scalar_irradiance for sun in suns]) @ LUMINANCE_WEIGHTS
    part /= part.sum()

    def wrong(some) -> tuple[float, float]:
        at = np.array([sun.to_light for sun in some])
        walls = part @ discs_on_walls(at, half) - wanted
        return float(np.sqrt(np.mean(walls**2))), abs(part @ disc_on_ground(at[:, 2], half) - up)

    wanted = part @ discs_on_walls(to_light, half) * 1.03
    up = part @ disc_on_ground(to_light[:, 2], half)
    level = Level(np.full(3, up), wanted, on_ground=5e-4, on_walls=5e-4, shadows=1.0)
    before, after = wrong(suns), wrong(levelled(suns, level, 0.0, costs=0.65))
    print(before, after)
    assert before[0] > 4 * level.on_walls
    assert after[0] <= level.on_walls
    assert after[1] <= level.on_ground


@pytest.mark.parametrize("share", [None, 0.9])
def test_what_is_said_of_walls_is_so(sunrise, share):
    found = load(sunrise)
    for lights in (2, 7, None):
        conversion = convert(found, ConversionSettings(share=share, lights=lights))
        wrong = wrong_of_walls(found, conversion)
        print(f"{len(conversion.suns)} lights: {conversion.standing_error:.3%}, is {wrong:.3%}")
        assert conversion.standing_error == pytest.approx(wrong, rel=0.2, abs=1e-3)


def test_lights_at_the_horizon_leave_walls_as_bright():
    """Where discs alone would be several percent too faint."""
    random = np.random.default_rng(5)
    pixels = sky(512, 0.05)
    for _ in range(60):
        place = direction(random.uniform(-180, 180), random.uniform(1.5, 6))
        paint_disc(pixels, place, random.uniform(0.5, 1.5), random.uniform(5, 60, 3))
    found = environment(pixels)
    conversion = convert(found, ConversionSettings(share=0.8))
    wrong = wrong_of_walls(found, conversion)
    print(f"{len(conversion.suns)} lights, walls wrong by {wrong:.3%}")
    assert wrong <= 0.01 + 1e-3


def wrong_of_walls(found, conversion) -> float:
    """Root mean square of luminance, as a part of the mean irradiance."""
    rest = replace(found, radiance=conversion.residual)
    wanted = GROUND.irradiance(*light_of(found))
    given = GROUND.irradiance(*light_of(rest)) + GROUND.irradiance(*light_of_suns(conversion.suns))
    wrong = (given - wanted) @ LUMINANCE_WEIGHTS
    return float(np.sqrt(np.mean(wrong**2)) / (found.scalar_irradiance @ LUMINANCE_WEIGHTS / 4))
