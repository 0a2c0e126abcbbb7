from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.strata import stratify
from tests.maps import environment, sky


def ramp(width=64):
    pixels = sky(width, 0.0)
    pixels += np.linspace(0.1, 10, width // 2)[:, None, None] + np.arange(width)[:, None] * 1e-3
    return environment(pixels)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_region_a_holds_the_share(share):
    strata = stratify(ramp(), share, 2)
    solid = sphere.row_solid_angles(64, 32)[:, None]
    light = strata.luminance * solid
    assert light[strata.region_a].sum() / light.sum() == pytest.approx(strata.share, rel=1e-12)
    assert strata.share == pytest.approx(share, abs=2e-3)


@pytest.mark.parametrize("count", [2, 4, 8])
def test_strata_hold_equal_parts_of_their_region(count):
    strata = stratify(ramp(), 0.6, count)
    light = strata.luminance * sphere.row_solid_angles(64, 32)[:, None]
    number = np.searchsorted(strata.bounds, strata.luminance.ravel()) + 1
    parts = np.bincount(number, light.ravel(), minlength=count + 1)[1:] / light.sum()
    half = count // 2
    expected = [0.4 / half] * half + [0.6 / half] * half
    assert parts == pytest.approx(expected, abs=4e-3)
    assert (strata.region_a == (number > half).reshape(32, 64)).all()


def test_the_whole_share_takes_black_pixels_too():
    pixels = sky(16, 0.0)
    pixels[3, 3] = 1
    assert stratify(environment(pixels), 1.0, 2).region_a.all()


def test_equal_pixels_stay_together():
    assert not stratify(environment(sky(16, 1.0)), 0.3, 2).region_a.any()
    assert stratify(environment(sky(16, 1.0)), 0.7, 2).region_a.all()


def test_a_calm_map_has_no_region_a():
    assert not stratify(ramp(), None, 2).region_a.any()


def test_one_lit_pixel_is_all_of_region_a():
    pixels = sky(64, 0.0)
    pixels[10, 20] = 5.0
    region = stratify(environment(pixels), None, 2).region_a
    assert region.sum() == 1
    assert region[10, 20]
