"""Every method of placement: what its paper promises, and what all of them must keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import sphere
from sunsplit.core.moments import Moments
from sunsplit.core.placement.placement import method_named
from sunsplit.core.region import RegionLight, light_of_map
from tests.maps import direction, paint_disc, sky

METHODS = ["penrose", "median-cut", "variance", "kmeans"]


def light_of(pixels: np.ndarray) -> RegionLight:
    """The pixels that shine."""
    light = light_of_map(pixels.astype(np.float32))
    return light.part(light.luminous_flux > 0)


def grey(plane: object) -> np.ndarray:
    return np.repeat(np.asarray(plane, float)[..., None], 3, axis=-1)


def speck(row: int, column: int, width: int = 64) -> np.ndarray:
    pixels = sky(width, 0.0)
    pixels[row, column] = 5
    return pixels


def random_map(seed: int, width: int = 64, power: float = 4.0) -> np.ndarray:
    return grey(np.random.default_rng(seed).random((width // 2, width)) ** power + 1e-6)


def two_suns(width: int = 128) -> np.ndarray:
    pixels = sky(width, 1e-3)
    paint_disc(pixels, direction(180, 10), 6, (50, 40, 30))
    paint_disc(pixels, direction(20, 85), 4, (20, 20, 90))
    return pixels


MAPS = {
    "constant": sky(64, 0.5),
    "noise": random_map(1),
    "one pixel": speck(9, 40),
    "pixel at the seam": speck(20, 0),
    "pixel at the pole": speck(0, 33),
    "seam and pole": two_suns(),
    "smallest": sky(2, 1.0),
}


@pytest.mark.parametrize("pixels", MAPS.values(), ids=MAPS.keys())
@pytest.mark.parametrize("count", [1, 2, 3, 64, 1000])
@pytest.mark.parametrize("method", METHODS)
def test_all_light_has_a_site(method, count, pixels):
    light = light_of(pixels)
    placement = method_named(method)(light, count)
    assert 1 <= len(placement.sites) <= count
    if method == "penrose":
        assert len(placement.sites) == count
    if len(light.pixels) >= count:
        assert len(placement.sites) == count
    assert np.linalg.norm(placement.sites, axis=1) == pytest.approx(1, abs=1e-12)
    assert placement.owner.shape == light.pixels.shape
    assert placement.owner.min() >= 0
    assert placement.owner.max() < len(placement.sites)
    moments = Moments(light, placement.owner, len(placement.sites))
    assert moments.flux.sum(axis=0) == pytest.approx(light.flux.sum(axis=0), rel=1e-12)
    assert (moments.shortfall >= 0).all()


@pytest.mark.parametrize("power", [-40, 30])
@pytest.mark.parametrize("method", METHODS)
def test_a_power_of_two_changes_nothing(method, power):
    light = light_of(random_map(3))
    brighter = RegionLight(light.pixels, light.flux * 2.0**power, light.width, light.height)
    before, after = method_named(method)(light, 37), method_named(method)(brighter, 37)
    assert (before.sites == after.sites).all()
    assert (before.owner == after.owner).all()


@pytest.mark.parametrize("method", METHODS)
def test_the_same_light_is_placed_the_same_twice(method):
    first, second = (method_named(method)(light_of(random_map(4)), 50) for _ in range(2))
    assert (first.sites == second.sites).all()
    assert (first.owner == second.owner).all()


@pytest.mark.parametrize("method", METHODS)
def test_two_suns_get_lights_in_proportion(method):
    light = light_of(two_suns(512))
    placement = method_named(method)(light, 64)
    moments = Moments(light, placement.owner, len(placement.sites))
    near = np.degrees(sphere.angle_between(placement.sites, direction(180, 10))) < 8
    inside = np.degrees(
        sphere.angle_between(
            sphere.pixel_directions(light.pixels, light.width, light.height), direction(180, 10)
        )
    )
    part = light.luminous_flux[inside < 8].sum() / light.luminous_flux.sum()
    assert 0.6 < part < 0.9
    # A cell on the rim holds light of both sides; this sun lies on the seam, which gives it two.
    near_light = moments.luminous_flux[near].sum() / light.luminous_flux.sum()
    assert near_light == pytest.approx(part, abs=2 / 64)
    if method in ("penrose", "median-cut"):  # the others place by extent, too
        assert np.mean(near) == pytest.approx(part, abs=0.08)


def test_median_cut_makes_boxes_of_equal_light():
    """A smooth map: each of 2^k boxes holds 2^-k of all light, as nearly as pixels allow."""
    rows, columns = np.mgrid[0:256, 0:512]
    pixels = grey(2 + np.sin(rows / 40) + np.cos(columns / 70))
    light = light_of(pixels)
    for count in (2, 16, 64):
        placement = method_named("median-cut")(light, count)
        part = Moments(light, placement.owner, count).luminous_flux / light.luminous_flux.sum()
        assert part * count == pytest.approx(np.ones(count), rel=0.1 if count == 64 else 0.05)


def test_median_cut_follows_its_paper():
    """Against the paper's own words: cut each region across its longer side into equal halves."""
    pixels = random_map(5, 128)
    light = light_of(pixels)
    plane = light.plane()
    regions = [(0, 64, 0, 128)]
    for _ in range(5):
        regions = [half for region in regions for half in naive_halves(plane, *region)]
    expected = sorted(float(plane[a:b, c:d].sum()) for a, b, c, d in regions)
    placement = method_named("median-cut")(light, 32)
    found = np.sort(Moments(light, placement.owner, 32).luminous_flux)
    assert found == pytest.approx(expected, rel=1e-9)


def naive_halves(plane, top, bottom, left, right):
    latitude = np.pi / 2 - np.pi * (top + bottom) / 2 / plane.shape[0]
    whole = plane[top:bottom, left:right].sum()
    if (right - left) * np.cos(latitude) >= bottom - top:
        errors = [abs(plane[top:bottom, left:k].sum() - whole / 2) for k in range(left + 1, right)]
        k = left + 1 + int(np.argmin(errors))
        return (top, bottom, left, k), (top, bottom, k, right)
    errors = [abs(plane[top:k, left:right].sum() - whole / 2) for k in range(top + 1, bottom)]
    k = top + 1 + int(np.argmin(errors))
    return (top, k, left, right), (k, bottom, left, right)


@given(st.integers(0, 1000))
def test_variance_finds_the_best_cut(seed):
    pixels = random_map(seed, 16)
    light = light_of(pixels)
    placement = method_named("variance")(light, 2)
    rows, columns = np.divmod(light.pixels, 16)
    directions = sphere.pixel_directions(light.pixels, 16, 8)
    cuts = [rows < k for k in range(1, 8)] + [columns < k for k in range(1, 16)]

    def spread(mask):
        flux = light.luminous_flux[mask]
        mean = flux @ directions[mask] / flux.sum()
        return float(flux @ ((directions[mask] - mean) ** 2).sum(axis=1))

    best = min(cuts, key=lambda cut: max(spread(cut), spread(~cut)))
    least = max(spread(best), spread(~best))
    assert max(spread(placement.owner == 0), spread(placement.owner == 1)) == pytest.approx(least)


def cost(light, placement):
    moments = Moments(light, placement.owner, len(placement.sites))
    return float(moments.luminous_flux @ moments.shortfall)


def test_k_means_finds_what_is_there():
    pixels = sky(256, 1e-6)
    places = [direction(0, 0), direction(180, 40), direction(77, -88), direction(-60, 60)]
    for place in places:
        paint_disc(pixels, place, 4, (10, 10, 10))
    placement = method_named("kmeans")(light_of(pixels), 4)
    for place in places:
        apart = np.degrees(sphere.angle_between(placement.sites, place))
        assert apart.min() < 0.5


def test_k_means_is_as_good_with_another_seed_and_better_than_its_rivals():
    from sunsplit.core.placement.kmeans import kmeans

    light = light_of(random_map(8, 128))
    costs = [cost(light, kmeans(light, 40, seed)) for seed in (0, 1, 2)]
    assert max(costs) < 1.03 * min(costs)
    for rival in ("penrose", "median-cut", "variance"):
        assert max(costs) < cost(light, method_named(rival)(light, 40))


def test_k_means_with_as_many_sites_as_pixels_has_one_for_each():
    pixels = sky(64, 0.0)
    pixels[10:12, 5:9] = 1
    placement = method_named("kmeans")(light_of(pixels), 8)
    assert sorted(placement.owner.tolist()) == list(range(8))
