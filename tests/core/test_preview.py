from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from sunsplit.core import sphere
from sunsplit.core.conversion import convert
from sunsplit.core.files.conversion import save
from sunsplit.core.files.preview import MARKER, REGION, SUN, WIDTH, draw_preview, tone_mapped
from sunsplit.core.settings import ConversionSettings
from tests.maps import direction, environment, paint_disc, sky


def lit_from(azimuth, elevation, radius=6.0, width=256):
    pixels = sky(width)
    paint_disc(pixels, direction(azimuth, elevation), radius, 5000, fine=2)
    return environment(pixels, "lit")


def sun_pixels(picture):
    """Where the map's part of the picture has the colour of suns."""
    return (np.asarray(picture)[: WIDTH // 2] == SUN).all(axis=-1)


def reach(mask, azimuth, elevation):
    """Angles in degrees of the marked pixels from a direction."""
    rows, columns = np.nonzero(mask)
    seen = sphere.to_directions((columns + 0.5) / WIDTH, (rows + 0.5) / (WIDTH / 2))
    return np.degrees(sphere.angle_between(seen, direction(azimuth, elevation)))


@pytest.mark.parametrize("width", [64, 256, 1536])
def test_a_png_of_the_promised_size(tmp_path, width):
    files = save(convert(lit_from(20, 30, width=width)), tmp_path, preview=True)
    with Image.open(files.preview) as picture:
        assert picture.format == "PNG"
        assert picture.mode == "RGB"
        assert picture.width == WIDTH
        assert picture.height > WIDTH // 2  # the legend is below
        rows = np.asarray(picture)[WIDTH // 2 :]
    assert (rows == SUN).all(axis=-1).any()


@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [(60, 40), (-120, -35), (0, 0), (180, 10), (179, -20), (-178, 45)],
)
def test_circle_and_marker_lie_around_the_sun(azimuth, elevation):
    conversion = convert(lit_from(azimuth, elevation), ConversionSettings(lights=1))
    (sun,) = conversion.suns
    mask = sun_pixels(draw_preview(conversion))
    angles = reach(mask, azimuth, elevation)
    radius = np.degrees(sun.angular_diameter) / 2
    # All of it is near the sun, and the circle runs all around it: also beyond the seam.
    assert angles.max() < MARKER[1] * 360 / WIDTH + 5
    on_circle = np.abs(angles - radius) < 0.4
    rows, columns = (index[on_circle] for index in np.nonzero(mask))
    v, u = (rows + 0.5) / (WIDTH / 2), (columns + 0.5) / WIDTH
    away = sphere.to_directions(u, v) - direction(azimuth, elevation)
    first, second = sphere.tangents(direction(azimuth, elevation))
    around = np.degrees(np.arctan2(away @ second, away @ first))
    assert np.diff(np.sort(around)).max() < 10


@pytest.mark.parametrize("azimuth", [180, 179.5, -179.5])
def test_the_marker_goes_on_beyond_the_seam(azimuth):
    mask = sun_pixels(draw_preview(convert(lit_from(azimuth, 5, radius=1))))
    assert mask[:, : WIDTH // 10].any()
    assert mask[:, -WIDTH // 10 :].any()
    assert not mask[:, WIDTH // 10 : -WIDTH // 10].any()


def test_a_sun_at_the_pole_is_drawn_along_the_whole_edge():
    mask = sun_pixels(draw_preview(convert(lit_from(0, 90))))
    assert mask.any(axis=0).mean() > 0.98  # its name covers a little
    assert not mask[WIDTH // 8 :].any()


def test_region_a_is_outlined_where_it_is():
    conversion = convert(lit_from(60, 40))
    mask = (np.asarray(draw_preview(conversion))[: WIDTH // 2] == REGION).all(axis=-1)
    angles = reach(mask, 60, 40)
    assert len(angles) > 50
    assert angles.min() > 5
    assert angles.max() < 10


def test_a_map_without_suns_has_no_marks():
    picture = draw_preview(convert(environment(sky(64))))
    assert not sun_pixels(picture).any()


def test_many_suns_are_all_drawn():
    pixels = sky(256)
    places = [(azimuth, elevation) for azimuth in range(0, 360, 36) for elevation in (-30, 20)]
    for azimuth, elevation in places:
        paint_disc(pixels, direction(azimuth + 5, elevation), 2, 5000, fine=2)
    conversion = convert(environment(pixels), ConversionSettings(lights=len(places)))
    assert len(conversion.suns) == len(places)
    mask = sun_pixels(draw_preview(conversion))
    for azimuth, elevation in places:
        assert reach(mask, azimuth + 5, elevation).min() < 3


def test_the_median_is_middle_grey_and_brighter_is_brighter():
    pixels = np.full((2, 4, 3), 0.02, np.float32)
    pixels[0, :, :] = [[0.001], [0.02], [0.2], [200]]
    grey = tone_mapped(pixels)
    assert (grey[..., 0] == grey[..., 2]).all()
    assert 110 < grey[1, 0, 0] < 135
    assert (np.diff(grey[0, :, 0].astype(int)) > 0).all()
    assert grey[0, 3, 0] == 255


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_any_scale_looks_the_same(scale):
    pixels = sky(32).astype(np.float32)
    pixels[3, 4] = 500
    assert (tone_mapped(pixels * np.float32(scale)) == tone_mapped(pixels)).all()


def test_a_mostly_black_map_can_be_seen():
    pixels = np.zeros((16, 32, 3), np.float32)
    pixels[8, 16] = 3e38
    assert tone_mapped(pixels)[8, 16].min() > 100
    picture = draw_preview(convert(environment(pixels)))
    assert sun_pixels(picture).any()
