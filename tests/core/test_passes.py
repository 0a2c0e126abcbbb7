"""Samples of two passes: the least noise for the time, against all other ways to share it out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sunsplit.core import ConversionSettings, convert, sphere
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.noise import OF_TABLE, OTHERWISE
from sunsplit.core.passes import (
    COST_OF_SKY,
    COST_OF_SUNS,
    EVENLY,
    PassPart,
    part_of_residual,
    part_of_suns,
    parts_of,
    samples_of_passes,
)
from sunsplit.core.suns import point_sun
from tests.maps import direction, environment, paint_disc, sky

parts = st.builds(PassPart, st.floats(1e-3, 1e3), st.floats(0.1, 1.5))


@given(st.integers(1, 5000), parts, parts)
def test_passes_take_the_time_of_one(samples, suns, residual):
    number = samples_of_passes(samples, suns, residual)
    assert min(number) >= 1
    seconds = number[0] * suns.cost + number[1] * residual.cost
    assume(min(number) > 1)
    # Up to a part of a sample of each.
    assert samples - suns.cost - residual.cost < seconds <= samples + 1e-9


@given(st.integers(2, 2000), parts, parts)
def test_no_other_number_of_suns_samples_leaves_less_noise(samples, suns, residual):
    chosen, _ = samples_of_passes(samples, suns, residual)
    number = np.arange(1, (samples - residual.cost) / suns.cost + 1e-9)
    assume(len(number) > 1)
    rest = (samples - suns.cost * number) / residual.cost
    noise = suns.variance / number + residual.variance / rest
    assert noise[chosen - 1] == pytest.approx(noise.min(), rel=1e-9)


@given(st.integers(2, 2000), parts, parts)
def test_variances_count_by_their_ratio(samples, suns, residual):
    double = [PassPart(2 * part.variance, part.cost) for part in (suns, residual)]
    assert samples_of_passes(samples, *double) == samples_of_passes(samples, suns, residual)


@pytest.mark.parametrize(
    ("suns", "residual", "number"),
    [
        ((1, 1), (1, 1), (50, 50)),
        ((4, 1), (1, 1), (66, 34)),
        ((1, 4), (1, 1), (17, 33)),
        ((1, 0.5), (1, 0.5), (100, 100)),
        ((1e9, 1), (1e-9, 1), (99, 1)),
        ((1e-9, 1), (1e9, 1), (1, 99)),
    ],
)
def test_samples_by_hand(suns, residual, number):
    found = samples_of_passes(100, PassPart(*suns), PassPart(*residual))
    assert found == pytest.approx(number, abs=1)


def test_one_sample_becomes_one_of_each():
    assert samples_of_passes(1, PassPart(1, 1), PassPart(1, 1)) == (1, 1)


def facing(lights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosines of lights (n, 3) on surfaces of all orientations, and what part of all each is."""
    normals = sphere.pixel_directions(np.arange(256 * 128), 256, 128)
    part = np.repeat(sphere.row_solid_angles(256, 128), 256) / (4 * np.pi)
    return np.maximum(lights @ normals.T, 0), part


@pytest.mark.parametrize("strengths", [(1,), (3, 3), (5, 1, 1, 0.2)])
def test_the_variance_of_suns_is_that_of_surfaces_that_choose_one(strengths):
    light = 1.5 * sum(strengths)
    places = [direction(30 + 70 * number, 20 + 9 * number) for number in range(len(strengths))]
    suns = [
        point_sun(np.full(3, float(one)), place, 2)
        for one, place in zip(strengths, places, strict=True)
    ]
    cosine, part = facing(np.array(places))
    flux = np.array(strengths, float)
    seen = (flux @ cosine) ** 2
    by_strength = flux.sum() * flux @ cosine**2 - seen
    by_lot = len(flux) * flux**2 @ cosine**2 - seen
    for chosen, expected in ((True, by_strength), (False, by_lot)):
        found = part_of_suns(suns, light, chosen).variance - OTHERWISE
        assert found == pytest.approx(16 / light**2 * expected @ part, rel=0.02, abs=0.01)


def test_the_calmer_the_residual_the_less_its_variance():
    pixels = sky(64, 1.0)
    even = part_of_residual(pixels.astype(np.float32), 0.5).variance
    paint_disc(pixels, direction(40, 30), 20, (12, 12, 12))
    uneven = part_of_residual(pixels.astype(np.float32), 0.5).variance
    assert part_of_residual(None, 1.0).variance == even == EVENLY * OTHERWISE
    assert even < uneven <= EVENLY * (OF_TABLE + OTHERWISE)
    assert part_of_residual(pixels.astype(np.float32), 0.9).variance < uneven


def test_a_residual_that_is_looked_for_takes_as_long_as_suns():
    pixels = sky(64, 0.1)
    assert part_of_residual(pixels.astype(np.float32), 0).cost == COST_OF_SKY
    paint_disc(pixels, direction(40, 30), 5, (90, 90, 90))
    assert part_of_residual(pixels.astype(np.float32), 0).cost == COST_OF_SUNS


def test_parts_of_a_conversion():
    pixels = sky(128, 0.3)
    paint_disc(pixels, direction(40, 30), 3, (900, 800, 700))
    paint_disc(pixels, direction(-120, 20), 3, (50, 60, 70))
    made = convert(environment(pixels), ConversionSettings(lights=2))
    suns, residual = parts_of(made, by_strength=True)
    # The same light as the account's, added up in another order.
    light, share = made.strata.light, made.visible_share
    assert light == pytest.approx(made.account.source @ LUMINANCE_WEIGHTS, rel=1e-14)
    assert share == pytest.approx(made.account.share, rel=1e-14)
    assert suns == part_of_suns(made.suns, light, by_strength=True)
    assert residual == part_of_residual(made.residual, share)
    assert suns.variance < parts_of(made, by_strength=False)[0].variance
