"""What EEVEE's world gives to surfaces, against closed forms; against EEVEE: tests/benchmarks."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ConversionSettings, convert, load
from sunsplit.core.patches import Patches, patches_of
from sunsplit.core.region import light_of_map
from sunsplit.core.settings import MOST_BY_ITSELF
from sunsplit.core.tolerances import ACCOUNT
from sunsplit.core.two_orders import STEEPEST, irradiance_of_two_orders, part_shadowed
from tests.maps import direction, environment, paint_disc, sky

ANGLES = np.radians([0, 30, 60, 90, 120, 180])
NORMALS = np.stack([np.sin(ANGLES), np.zeros(6), np.cos(ANGLES)], axis=-1)


def patches(pixels: np.ndarray) -> Patches:
    light = light_of_map(pixels.astype(np.float32))
    return patches_of(light, light.luminous_flux)


def test_an_even_sky_gives_the_same_to_all():
    assert irradiance_of_two_orders(patches(sky(128, 0.5)), NORMALS) == pytest.approx(0.5 * np.pi)


def test_a_gentle_slope_is_exact():
    """L = 1 + cos / 2 has no more than two orders: E = pi (1 + cos / 3)."""
    v = (np.arange(128) + 0.5) / 128
    pixels = np.broadcast_to((1 + np.cos(np.pi * v) / 2)[:, None, None], (128, 256, 3))
    expected = np.pi * (1 + NORMALS[:, 2] / 3)
    assert irradiance_of_two_orders(patches(pixels), NORMALS) == pytest.approx(expected, rel=1e-3)


def test_one_sun_is_spread_and_lessened():
    to_light = direction(20, 50)[None]
    sun = Patches(
        to_light,
        np.full((1, 3), 4.0),
        np.zeros(1),
        np.ones(1),
        np.zeros((1, 3), np.int32),
    )
    found = irradiance_of_two_orders(sun, np.array([to_light[0], -to_light[0]]))
    assert found == pytest.approx([1 + STEEPEST, 1 - STEEPEST])


@pytest.mark.parametrize("target", ["eevee", "both"])
def test_more_lamps_than_eevee_bears_are_not_made(sunrise, target):
    conversion = convert(load(sunrise), ConversionSettings(target=target))
    assert 8 < len(conversion.suns) <= MOST_BY_ITSELF[target]
    assert conversion.account.relative_error.max() <= ACCOUNT
    # Of the error all but a little is the sky's, which EEVEE does not shadow.
    assert conversion.predicted_error < 0.03


def test_eevee_gets_no_more_lamps_than_help():
    """A studio's soft boxes: what is left in the world is wrong by more than more lamps would
    mend."""
    pixels = sky(256, 0.4)
    pixels[20:60, 30:80] = 20
    conversion = convert(environment(pixels), ConversionSettings(target="eevee", share=0.6))
    assert conversion.predicted_error > 0.01
    assert len(conversion.suns) < 16


def test_the_wider_a_lamp_the_less_of_it_has_shadows():
    parts = [part_shadowed(np.radians(width)) for width in (0, 45, 90, 150, 180)]
    assert parts == pytest.approx([1, 1, 2 / 3, 2 / 9, 0])


def test_a_wide_lamp_is_wrong_in_eevee_and_several_narrow_ones_less():
    pixels = sky(256, 0.0)
    paint_disc(pixels, direction(20, 60), 45, 1)
    wrong = {}
    for target, lights in (("cycles", 1), ("eevee", 1), ("eevee", 12)):
        asked = ConversionSettings(target=target, lights=lights, share=1)
        wrong[target, lights] = convert(environment(pixels), asked).predicted_error
    assert wrong["cycles", 1] < 0.01 < wrong["eevee", 1]
    assert wrong["eevee", 12] < wrong["eevee", 1] / 2
