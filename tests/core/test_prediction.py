"""Predicted errors against measured ones, and the fewest lights for a tolerance."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import ConversionSettings, convert, load
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.placement.light_count import fewest
from tests.benchmarks.occluders import draw_occluders, light_of, light_of_suns
from tests.maps import direction, environment, paint_disc, sky


def measured(found, conversion, seed: int = 5) -> float:
    """Of a conversion of the whole map, by other surfaces than the prediction's."""
    occluders = draw_occluders(found, 300, seed)
    directions, flux = light_of(found)
    wrong = occluders.irradiance(*light_of_suns(conversion.suns))
    wrong -= occluders.irradiance(directions, flux)
    mean = flux.sum(axis=0) @ LUMINANCE_WEIGHTS / 4
    return float(np.sqrt(np.mean((wrong @ LUMINANCE_WEIGHTS) ** 2)) / mean)


@pytest.mark.parametrize("method", ["edge", "penrose", "median-cut"])
@pytest.mark.parametrize("shape", ["disc", "point"])
def test_the_prediction_holds_for_any_conversion(method, shape):
    pixels = sky(256, (0.3, 0.4, 0.6)) * np.linspace(1.5, 0.5, 128)[:, None, None]
    paint_disc(pixels, direction(30, 25), 3, (300, 250, 200))
    paint_disc(pixels, direction(-80, 10), 9, (20, 25, 30))
    found = environment(pixels)
    for lights in (2, 12, 40):
        chosen = ConversionSettings(share=1, lights=lights, method=method, shape=shape)
        conversion = convert(found, chosen)
        error = measured(found, conversion)
        print(f"{lights}: predicted {conversion.predicted_error:.2%}, measured {error:.2%}")
        # Both are means of some hundred squares, of which few count much.
        assert conversion.predicted_error == pytest.approx(error, rel=0.4)


def test_no_suns_have_no_error():
    assert convert(environment(sky(64, 0.5))).predicted_error == 0


@pytest.mark.parametrize("tolerance", [4.0, 1.5, 0.6])
def test_as_few_lights_as_the_tolerance_allows(sunrise, tolerance):
    found = load(sunrise)
    conversion = convert(found, ConversionSettings(share=1, tolerance=tolerance))
    count = len(conversion.suns)
    assert conversion.predicted_error <= tolerance / 100
    fewer = convert(found, ConversionSettings(share=1, lights=count - 1))
    assert fewer.predicted_error > tolerance / 100
    at_most = convert(found, ConversionSettings(share=1, lights=500, tolerance=tolerance))
    assert len(at_most.suns) == count
    assert f"{count} of 500 lights: as few are within" in " ".join(at_most.notes)


def test_other_methods_have_a_tolerance_too(sunrise):
    chosen = ConversionSettings(share=1, method="median-cut", tolerance=5)
    conversion = convert(load(sunrise), chosen)
    assert conversion.predicted_error <= 0.05
    assert 1 < len(conversion.suns) < 30


def test_too_few_lights_say_so(sunrise):
    chosen = ConversionSettings(share=1, lights=2, tolerance=0.5)
    notes = " ".join(convert(load(sunrise), chosen).notes)
    assert "2 lights are predicted to be wrong by" in notes
    assert "more than the 0.5 % allowed" in notes


@given(st.lists(st.floats(0.5, 2), min_size=40, max_size=40), st.floats(0.02, 2))
def test_fewest_is_enough_and_one_less_is_not(bumps, allowed):
    """Whatever way the error takes."""
    errors = {n: bump / n for n, bump in enumerate(bumps, start=1)}
    found = fewest(lambda n: SimpleNamespace(predicted_error=errors[n], n=n), allowed, 40)
    if found.predicted_error > allowed:
        assert errors[40] > allowed
    elif found.n > 1:
        assert errors[found.n - 1] > allowed
