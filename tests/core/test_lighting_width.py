"""A map that only lights is as wide as shadows can tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sunsplit.core import EnvironmentMap, convert, load
from sunsplit.core.lighting_width import ALLOWED, NARROWEST, lighting_width
from sunsplit.core.pixels import HeldPixels
from sunsplit.core.reduction import narrowed
from tests.benchmarks.occluders import draw_occluders, light_of
from tests.maps import direction, environment, paint_disc, sky


def width_for(pixels) -> int:
    return lighting_width(pixels, environment(pixels).scalar_irradiance)


@pytest.mark.parametrize(
    ("width", "enough"), [(128, 128), (256, 256), (512, 256), (1024, 256), (1000, 500), (514, 514)]
)
def test_an_even_map_is_halved_as_often_as_it_can_be(width, enough):
    assert width_for(sky(width, (0.3, 0.4, 0.6))) == enough


@pytest.mark.parametrize("channel", range(3))
def test_a_small_light_is_kept_sharp(channel):
    """Of any colour, against what there is of that colour."""
    pixels = sky(1024, (0.3, 0.4, 0.6))
    colour = np.zeros(3)
    colour[channel] = 20_000
    paint_disc(pixels, direction(30, 25), 0.3, colour)
    assert width_for(pixels) == 1024


def test_light_that_is_seen_alone_decides():
    pixels = sky(1024, 0.3)
    paint_disc(pixels, direction(30, 25), 0.4, (200, 200, 200))
    light = environment(pixels).scalar_irradiance
    assert lighting_width(pixels, light) < 1024
    assert lighting_width(pixels, light / 100) == 1024


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("lit_by", ["spots", "sunrise"])
def test_what_is_allowed_holds_under_occluders(sunrise, lit_by, seed):
    """By half the width that is chosen it may not, where a light is small."""
    found = load(sunrise) if lit_by == "sunrise" else spots()
    rest = convert(found).residual if lit_by == "sunrise" else found.radiance
    width = lighting_width(rest, found.scalar_irradiance)
    occluders = draw_occluders(replace(found, radiance=rest), 300, seed)
    wrong = {n: wrong_of_narrowed(found, rest, occluders, n) for n in (width, width // 2)}
    print({n: f"{error:.4%}" for n, error in wrong.items()})
    # Edges are drawn near light, so that they part it more often than great circles anywhere.
    assert wrong[width] <= 3 * ALLOWED
    if lit_by == "spots":
        assert width > NARROWEST
        # Of a grey light all three channels count.
        assert wrong[width // 2] > ALLOWED / 4


def spots() -> EnvironmentMap:
    """A sky of lights as small as pixels."""
    random = np.random.default_rng(3)
    pixels = sky(1024, 0.3)
    for _ in range(4):
        where = direction(random.uniform(-180, 180), random.uniform(-60, 60))
        paint_disc(pixels, where, 0.3, np.full(3, random.uniform(1000, 3000)))
    return environment(pixels)


def wrong_of_narrowed(found, rest, occluders, width) -> float:
    """What surfaces get wrong of a channel's mean if the rest of a map is narrowed."""
    times = rest.shape[1] // width
    coarse = narrowed(HeldPixels.of(rest), width) if times > 1 else rest
    coarse = coarse.repeat(times, axis=0).repeat(times, axis=1)
    sharp, given = (
        occluders.irradiance(*light_of(replace(found, radiance=some))) for some in (rest, coarse)
    )
    wrong = np.sqrt(np.mean((given - sharp) ** 2, axis=0))
    return float((wrong / (found.scalar_irradiance / 4)).max())
