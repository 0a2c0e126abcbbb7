"""Cells for the truest shadows."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ConversionSettings, convert, load, sphere
from sunsplit.core.patches import patches_of
from sunsplit.core.placement.edge_split import edge_split
from sunsplit.core.region import light_of_map
from sunsplit.core.suns import disc_sun
from tests.benchmarks.occluders import draw_occluders, light_of, light_of_suns
from tests.maps import direction, disc_energy, environment, paint_disc, painted_radius, sky

PLACES = {
    "side": direction(40, 20),
    "seam": direction(180, -35),
    "pole": direction(0, 90),
    "near the pole": direction(123, -86),
}


def cells_of(pixels: np.ndarray, count: int, shape: str = "disc", most: int = 16_384):
    light = light_of_map(pixels.astype(np.float32))
    return edge_split(patches_of(light, light.luminous_flux, most), count, shape)


def sun_of(pixels: np.ndarray):
    cells = cells_of(pixels, 1)
    return disc_sun(cells.flux[0], cells.to_light[0], float(cells.shortfall[0]), 1)


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES.keys())
@pytest.mark.parametrize("radius", [1.0, 4.0, 15.0, 60.0])
def test_a_disc_gives_itself_back(place, radius):
    pixels = sky(1024, 0.0)
    paint_disc(pixels, place, radius, (3, 2, 1))
    sun = sun_of(pixels)
    assert np.degrees(sphere.angle_between(sun.to_light, place)) < 0.02
    expected = 2 * painted_radius(radius, 1024, place)
    assert np.degrees(sun.angular_diameter) == pytest.approx(expected, rel=0.01, abs=0.04)
    assert sun.scalar_irradiance == pytest.approx(
        disc_energy(radius, 1) * np.array([3, 2, 1]), rel=3e-3
    )


@pytest.mark.parametrize("row", [20, 100, 240])
def test_one_pixel_is_as_large_as_itself(row):
    pixels = sky(512, 0.0)
    pixels[row, 7] = 1e5
    sun = sun_of(pixels)
    high = np.pi / 256
    wide = high * np.sin((row + 0.5) * high)
    # The disc's second moment is a^2 / 2, the pixel's (w^2 + h^2) / 12.
    assert sun.angular_diameter == pytest.approx(2 * np.sqrt((wide**2 + high**2) / 6), rel=1e-3)


def test_sources_apart_get_a_cell_each():
    places = [direction(40 * k, 10 * (k % 3)) for k in range(8)]
    pixels = sky(512, 0.0)
    for k, place in enumerate(places):
        paint_disc(pixels, place, 2, np.full(3, 1.0 + k))
    cells = cells_of(pixels, 8)
    found = cells.to_light[np.argsort(cells.flux[:, 1])]
    for place, to_light in zip(places, found, strict=True):
        assert np.degrees(sphere.angle_between(to_light, place)) < 0.05


def test_a_round_sun_is_not_cut():
    pixels = sky(512, 0.0)
    paint_disc(pixels, direction(20, 30), 4, (9, 9, 9))
    assert len(cells_of(pixels, 3).flux) == 1


def test_points_are_cut_where_discs_need_not_be():
    pixels = sky(512, 0.0)
    paint_disc(pixels, direction(20, 30), 10, (9, 9, 9))
    assert len(cells_of(pixels, 12, "point").flux) == 12


def test_one_pixel_is_cut_into_its_quarters_at_most():
    pixels = sky(64, 0.0)
    pixels[3, 3] = 1
    assert len(cells_of(pixels, 1).flux) == 1
    assert len(cells_of(pixels, 50).flux) <= 4


def test_opposite_discs_have_no_disc_and_are_cut_apart():
    pixels = sky(256, 0.0)
    for place in (direction(10, 30), direction(190, -30)):
        paint_disc(pixels, place, 3, (1, 1, 1))
    assert cells_of(pixels, 1).shortfall[0] >= 0.5
    both = cells_of(pixels, 2)
    expected = painted_radius(3, 256, direction(10, 30))
    diameters = [4 * np.degrees(np.arcsin(np.sqrt(one))) for one in both.shortfall]
    assert diameters == pytest.approx([2 * expected] * 2, rel=0.01)


def test_the_predicted_error_of_a_cell_is_that_of_shadow_edges_measured():
    """Against brute force: random great circles over a bar of light and over its disc."""
    pixels = sky(512, 0.0)
    pixels[50:66, 180:332] = 1
    light = light_of_map(pixels.astype(np.float32))
    cells = edge_split(patches_of(light, light.luminous_flux), 1, "disc")
    suns = (disc_sun(cells.flux[0], cells.to_light[0], float(cells.shortfall[0]), 1),)
    directions, flux = light_of_suns(suns)
    bar = sphere.pixel_directions(light.pixels, 512, 256), light.luminous_flux
    random = np.random.default_rng(0).normal(size=(4000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    errors = []
    for normal in random:
        of_bar = bar[1][bar[0] @ normal > 0].sum() / bar[1].sum()
        of_disc = flux[directions @ normal > 0, 1].sum() / flux[:, 1].sum()
        errors.append(of_bar - of_disc)
    # Few edges are looked at, to be fast; a bar seven times as long as wide is their worst case.
    assert cells.error == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=0.25)


def test_grey_light_in_any_channel_gives_the_same_cells():
    pixels = sky(128, 0.0)
    pixels[20:50, 10:90] = np.random.default_rng(4).random((30, 80, 1))
    grey = cells_of(pixels, 6)
    for tint in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        assert cells_of(pixels * tint, 6).to_light == pytest.approx(grey.to_light, abs=1e-6)


def test_light_of_two_colours_is_right_in_each():
    """A warm sun in a blue sky that share few lamps: by luminance alone blue would be wrong."""
    pixels = sky(256, (0.2, 0.4, 1.0))
    paint_disc(pixels, direction(30, 20), 12, (40, 25, 6))
    found = environment(pixels)
    conversion = convert(found, ConversionSettings(share=1, lights=8))
    occluders = draw_occluders(found, 200, 1)
    wrong = occluders.irradiance(*light_of_suns(conversion.suns))
    wrong -= occluders.irradiance(*light_of(found))
    error = np.sqrt(np.mean(wrong**2, axis=0)) / (conversion.account.source / 4)
    print("red, green, blue wrong by", error)
    assert error.max() < 0.01  # .016 where both share one measure of colour


def test_more_lights_are_truer(sunrise):
    found = load(sunrise)
    errors = [
        convert(found, ConversionSettings(share=1, lights=count)).predicted_error
        for count in (1, 4, 16, 64)
    ]
    print(errors)
    assert errors[0] > 5 * errors[1] > 5 * errors[2] > 10 * errors[3]
