"""The share that the program chooses, for each target."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ConversionSettings, convert, load
from sunsplit.core.noise import OTHERWISE, squared_noise
from sunsplit.core.placement.choice import choose_suns
from sunsplit.core.region import light_of_region_a
from sunsplit.core.sampling import contrast
from sunsplit.core.settings import TOLERANCE
from sunsplit.core.share import choose_strata
from sunsplit.core.tolerances import ACCOUNT
from sunsplit.core.whole_lights import suns_for_whole_lights, whole_lights
from tests.maps import direction, environment, paint_disc, sky


def test_a_budget_for_export_gets_more_of_the_map_than_cycles(sunrise):
    found = load(sunrise)
    cycles, export = (
        convert(found, ConversionSettings(target=target, lights=16))
        for target in ("cycles", "export")
    )
    assert export.account.share > cycles.account.share + 0.1


def test_export_counts_the_shadows_that_its_residual_lacks(sunrise):
    found = load(sunrise)
    fixed = {"share": 0.5, "lights": 8}
    cycles = convert(found, ConversionSettings(target="cycles", **fixed))
    export = convert(found, ConversionSettings(target="export", **fixed))
    assert len(export.suns) == len(cycles.suns)
    assert export.predicted_error > 5 * cycles.predicted_error


def test_a_sky_without_suns_lacks_all_its_shadows_in_a_game(sunrise):
    none = convert(load(sunrise), ConversionSettings(target="export", share=0))
    assert none.suns == ()
    assert none.predicted_error > 0.3
    assert convert(load(sunrise), ConversionSettings(share=0)).predicted_error == 0


@pytest.mark.parametrize("target", ["cycles", "eevee", "both", "export"])
@pytest.mark.parametrize("name", ["even", "one pixel", "one channel", "far apart", "random"])
@pytest.mark.parametrize("lights", [None, 3])
def test_odd_maps_for_every_target(target, name, lights):
    pixels = {
        "even": sky(64, 0.5),
        "one pixel": sky(64, 0.0),
        "one channel": sky(64, (0, 0.3, 0)),
        "far apart": sky(64, 1e-30),
        "random": np.random.default_rng(0).random((32, 64, 3)),
    }[name]
    if name in ("one pixel", "far apart"):
        pixels[3, 3] = 1e30
    conversion = convert(environment(pixels), ConversionSettings(target=target, lights=lights))
    assert np.isfinite(conversion.predicted_error)
    assert conversion.account.relative_error.max() <= ACCOUNT
    for sun in conversion.suns:
        assert np.isfinite([*sun.to_light, *sun.irradiance, sun.angular_diameter]).all()


def test_one_light_for_export_is_the_sun_and_not_all_of_the_sky():
    pixels = sky(128, 0.3)
    paint_disc(pixels, direction(30, 30), 4, (400, 400, 400))
    found = environment(pixels)
    conversion = convert(found, ConversionSettings(target="export", lights=1))
    assert conversion.residual is not None
    assert np.degrees(conversion.suns[0].angular_diameter) < 12
    whole = convert(found, ConversionSettings(target="export", lights=1, share=1))
    assert conversion.predicted_error < whole.predicted_error


def test_eevee_keeps_a_world_for_mirrors(sunrise):
    conversion = convert(load(sunrise), ConversionSettings(target="eevee", lights=64))
    assert conversion.residual is not None
    assert conversion.residual.max() > 0
    none = convert(load(sunrise), ConversionSettings(target="eevee", lights=64, mirrors=False))
    assert none.account.share == pytest.approx(1)
    assert none.predicted_error < conversion.predicted_error


def glittering() -> np.ndarray:
    """A sun, and 60 sparks each a four-hundredth as strong."""
    pixels = sky(256, 0.1)
    paint_disc(pixels, direction(30, 40), 3, (2000, 2000, 2000))
    random = np.random.default_rng(5)
    pixels[random.integers(40, 90, 60), random.integers(0, 256, 60)] = 1500
    return pixels


def test_specks_that_make_noise_become_suns():
    conversion = convert(environment(glittering()), ConversionSettings(lights=40))
    moment, _ = contrast(conversion.residual)
    assert moment < 3
    assert len(conversion.suns) <= 40


def test_specks_that_few_lights_cannot_stand_for_stay(sunrise):
    conversion = convert(environment(glittering()), ConversionSettings(lights=2))
    assert len(conversion.suns) == 2
    assert conversion.predicted_error < 0.01
    assert "beyond the limit of 2 lights" in " ".join(conversion.notes)


@pytest.mark.parametrize("lights", [1, 2, 5])
def test_of_numbers_of_specks_none_that_could_be_best_is_left_out(lights):
    """Against trying all of them."""
    world, settings = environment(glittering()), ConversionSettings(lights=lights)
    strata = choose_strata(world, settings)
    light = light_of_region_a(world, strata, settings.filled)
    groups = whole_lights(light, strata)
    evils, count = {}, groups.noisy
    while True:
        wrong = choose_suns(groups.brightest(count), strata, settings).predicted_error
        evils[count] = wrong**2 + squared_noise(groups.variance[count] + OTHERWISE)
        if count <= lights or wrong <= TOLERANCE / 100:
            break
        count = max(count // 2, lights)
    taken, _, _ = suns_for_whole_lights(light, strata, settings)
    best = min(evils, key=evils.__getitem__)
    assert len(evils) > 1
    assert np.array_equal(taken.pixels, groups.brightest(best).pixels)


def test_a_speck_that_makes_no_noise_stays():
    pixels = sky(256, 0.3)
    paint_disc(pixels, direction(30, 40), 3, (2000, 2000, 2000))
    pixels[64, 10] = 30
    conversion = convert(environment(pixels))
    assert len(conversion.suns) == 1
    assert conversion.residual.max() == pytest.approx(30)
    assert "too faint to make noise" in " ".join(conversion.notes)
