from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from sunsplit.core import sphere
from sunsplit.core.conversion import convert
from sunsplit.core.files.maps import load
from sunsplit.core.library.thumbnail import HEIGHT, LEAST_RADIUS, MARKED, WIDTH, thumbnail
from sunsplit.core.settings import ConversionSettings
from tests.maps import direction, environment, paint_disc, sky


def pixels_of(jpeg):
    with Image.open(io.BytesIO(jpeg)) as picture:
        assert picture.format == "JPEG"
        return np.asarray(picture.convert("RGB")).astype(int)


def converted(*suns, width=256, **settings):
    """A grey sky with discs: azimuth, elevation, radius."""
    pixels = sky(width)
    for azimuth, elevation, radius in suns:
        paint_disc(pixels, direction(azimuth, elevation), radius, 5000, fine=3)
    return convert(environment(pixels, "grey"), ConversionSettings(**settings))


def marks(jpeg):
    """Where a picture of a grey sky is yellow."""
    red, green, blue = np.moveaxis(pixels_of(jpeg), -1, 0)
    return (red - blue > 110) & (green - blue > 80)


def reach(mask, to_light):
    """Angles in degrees of marked pixels from a direction."""
    rows, columns = np.nonzero(mask)
    seen = sphere.to_directions((columns + 0.5) / WIDTH, (rows + 0.5) / HEIGHT)
    return np.degrees(sphere.angle_between(seen, to_light))


def test_a_small_jpeg_always_the_same(sunrise):
    conversion = convert(load(sunrise))
    made = thumbnail(conversion)
    assert pixels_of(made).shape == (HEIGHT, WIDTH, 3)
    assert len(made) < 5000
    assert thumbnail(conversion) == made


@pytest.mark.parametrize("width", [2, 24, 64, 100, 190, 192, 300, 1024, 1536, 2050])
def test_maps_of_any_width(width):
    pixels = np.full((width // 2, width, 3), [0.2, 0.3, 0.5])
    pixels[: max(width // 10, 1), : width // 2] = 5
    seen = pixels_of(thumbnail(convert(environment(pixels), ConversionSettings(share=0.0))))
    assert seen.shape == (HEIGHT, WIDTH, 3)
    blue = seen[HEIGHT - 3, WIDTH - 3]
    assert blue[2] > blue[1] > blue[0]
    assert seen[1, 3].min() > blue.max()


@pytest.mark.parametrize(("azimuth", "elevation"), [(60, 40), (-120, -35), (0, 0), (178, 10)])
def test_a_large_sun_has_its_true_size(azimuth, elevation):
    conversion = converted((azimuth, elevation, 20), lights=1)
    (sun,) = conversion.suns
    angles = reach(marks(thumbnail(conversion)), direction(azimuth, elevation))
    # Within a pixel and a half, which are 2 degrees each.
    assert abs(angles - np.degrees(sun.angular_diameter) / 2).max() < 3
    assert len(angles) > 40


def test_a_small_sun_is_seen():
    angles = reach(marks(thumbnail(converted((0, 5, 0.5), width=512))), direction(0, 5))
    assert len(angles) > 10
    assert abs(angles * WIDTH / 360 - LEAST_RADIUS).max() < 1.5


def test_a_circle_goes_on_beyond_the_seam():
    mask = marks(thumbnail(converted((180, 5, 1))))
    assert mask[:, : WIDTH // 20].any()
    assert mask[:, -WIDTH // 20 :].any()
    assert not mask[:, WIDTH // 20 : -WIDTH // 20].any()


def test_a_sun_at_the_pole_is_marked_along_the_whole_edge():
    mask = marks(thumbnail(converted((0, 90, 12))))
    assert mask.any(axis=0).mean() > 0.95
    assert not mask[HEIGHT // 5 :].any()


def test_a_map_without_suns_has_no_marks():
    assert not marks(thumbnail(converted())).any()


def test_the_brightest_suns_are_marked():
    places = [
        (azimuth, elevation) for azimuth in range(-175, 180, 30) for elevation in (-40, 0, 40)
    ]
    pixels = sky(512)
    for rank, (azimuth, elevation) in enumerate(places):
        paint_disc(pixels, direction(azimuth, elevation), 1.5, 9000 - 200 * rank, fine=3)
    settings = ConversionSettings(lights=len(places), share=0.9)
    conversion = convert(environment(pixels), settings)
    mask = marks(thumbnail(conversion))
    # Some lights share a wide sun, whose circle is far from its middle.
    small = [(n, sun) for n, sun in enumerate(conversion.suns) if sun.angular_diameter < 0.1]
    assert small[-1][0] > MARKED
    for rank, sun in small:
        assert (reach(mask, sun.to_light).min() < 7) == (rank < MARKED)


@pytest.mark.parametrize("bright", [1e-30, 1.0, 3.4028235e38])
def test_any_scale(bright):
    pixels = np.zeros((288 * 3, 288 * 6, 3), np.float32)
    pixels[:9] = bright
    seen = pixels_of(thumbnail(convert(environment(pixels), ConversionSettings(share=0.0))))
    assert seen[0].min() > 100
    assert seen[-10:].max() < 20
