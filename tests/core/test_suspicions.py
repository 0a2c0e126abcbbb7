"""Maps that are not what they should be are suspected, and others are not."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import cores, reduction, sphere
from sunsplit.core import environment as environments
from sunsplit.core.brightest import MOST, brightest_of_map
from sunsplit.core.cli import main
from sunsplit.core.conversion import convert
from sunsplit.core.environment import EnvironmentMap, environment_from_pixels
from sunsplit.core.files.conversion import describe
from sunsplit.core.files.maps import load
from sunsplit.core.suspicions import clipped, map_warnings, upside_down
from tests.files import from_rgbe, noise, to_rgbe, write_exr, write_hdr
from tests.maps import direction, environment, paint_disc, sky


def add_sun(pixels: np.ndarray, radius: float, azimuth: float = 61, elevation: float = 37) -> None:
    """Add a disc of this angular radius (degrees), dark towards its limb as the sun is, which gives
    a bit more than a sky of 1: its peak is 2700 / radius^2, 0.9 and 0.7 of it."""
    height, width = pixels.shape[:2]
    to_light, fine = direction(azimuth, elevation), 4
    near = np.abs(90 - 180 * (np.arange(height) + 0.5) / height - elevation) < radius + 360 / width
    rows = np.flatnonzero(near)[:, None]
    light = np.zeros((len(rows), width))
    for down in range(fine):
        for right in range(fine):
            u = (np.arange(width)[None, :] + (right + 0.5) / fine) / width
            seen = sphere.to_directions(u, (rows + (down + 0.5) / fine) / height)
            apart = np.linalg.norm(seen - to_light, axis=-1) / np.radians(radius)
            up = np.sqrt(np.maximum(1 - apart**2, 0))
            light += np.where(apart < 1, 0.4 + 0.6 * up, 0)
    light *= 2700 / radius**2 / light.max()
    pixels[rows[:, 0]] += light[..., None] * [1, 0.9, 0.7]


def outdoors(width: int = 256, ground: float = 0.15, radius: float = 3.0) -> np.ndarray:
    """A sky that is brighter towards the horizon, a ground that sends back a part of its light, and
    a sun."""
    pixels = sky(width, (0.5, 0.7, 1.0))
    up = np.cos(np.pi * (np.arange(width // 2) + 0.5) / (width // 2))
    pixels *= (1.5 - np.abs(up))[:, None, None]
    add_sun(pixels, radius)
    lit = (pixels * np.maximum(up, 0)[:, None, None] * np.sqrt(1 - up**2)[:, None, None]).sum(
        (0, 1)
    )
    whole = width * (np.maximum(up, 0) * np.sqrt(1 - up**2)).sum()
    pixels[up < 0] = ground * lit / whole
    return pixels.astype(np.float32)


def clipped_at(part: float, pixels: np.ndarray) -> np.ndarray:
    """Of the peak."""
    return np.minimum(pixels, part * pixels.max())


# The disc is a few pixels wide, as the sun is in maps of 4096 and more.
@pytest.mark.parametrize(("width", "radius"), [(256, 3), (512, 1.5), (1024, 1), (2048, 1)])
@pytest.mark.parametrize("store", ["float", "half", "rgbe"])
def test_a_sun_clipped_at_half_of_its_peak_is_found_and_one_with_its_peak_is_not(
    width, radius, store
):
    pixels = sky(width, 0.3)
    add_sun(pixels, radius)
    for part in (1.0, 0.5, 0.1):
        cut = clipped_at(part, pixels)
        if store == "half":
            cut = cut.astype(np.float16)
        elif store == "rgbe":
            cut = from_rgbe(to_rgbe(cut))
        said = clipped(environment(cut))
        assert bool(said) == (part < 1), said
        assert not said or "flat" in said


@pytest.mark.parametrize("elevation", [-80, -30, 0, 60, 88, 90])
def test_clipping_is_found_anywhere_on_the_sphere(elevation):
    pixels = sky(512, 0.3)
    add_sun(pixels, 2, azimuth=179.5, elevation=elevation)  # over the seam, too
    assert not clipped(environment(pixels))
    assert clipped(environment(clipped_at(0.3, pixels)))


def test_the_sentence_tells_how_much_is_flat_and_where():
    pixels = sky(256, 0.3)
    add_sun(pixels, 3)
    pixels *= 40000 / pixels.max()
    pixels[..., 0] = np.minimum(pixels[..., 0], 32000)
    said = clipped(environment(pixels))
    flat = int((pixels[..., 0] == 32000).sum())
    assert f"The brightest {flat} pixels, " in said
    assert "degrees wide, are flat at 32,000 in red: " in said
    width = float(said.split("pixels, ")[1].split(" degrees")[0])
    assert 3.5 < width < 5.5
    assert "flat at 0.5:" in clipped(environment(np.minimum(pixels / 10000, 0.5)))


def test_several_lamps_clipped_alike_are_found_by_the_largest():
    pixels = sky(512, 0.3)
    for azimuth in (10, 100, 200):
        add_sun(pixels, 1.5, azimuth=azimuth)
    assert not clipped(environment(pixels))
    cut = clipped_at(0.4, pixels)
    flat = int((cut[..., 0] == cut.max()).sum())
    assert f"The brightest {flat} pixels, " in clipped(environment(cut))


def soft_box(width: int) -> np.ndarray:
    pixels = sky(width, 0.01)
    pixels[width // 8 : width // 5, width // 4 : width // 3] = 50
    return pixels


def one_pixel(width: int) -> np.ndarray:
    pixels = sky(width, 0.0)
    pixels[width // 3, 7] = 1000
    return pixels


@pytest.mark.parametrize("width", [256, 2048])
@pytest.mark.parametrize(
    "make",
    [
        lambda width: sky(width, 1.0),
        lambda width: noise(width // 2),
        lambda width: np.minimum(noise(width // 2), 0.8),
        soft_box,
        one_pixel,
    ],
    ids=["furnace", "noise", "clipped noise", "soft box", "one pixel"],
)
def test_what_is_even_or_small_or_no_light_is_not_suspected(make, width):
    pixels = make(width)
    assert map_warnings(environment(pixels)) == ()
    assert map_warnings(environment(pixels[::-1])) == ()


def test_an_even_disc_may_be_meant_and_the_sentence_says_so():
    pixels = sky(256, 0.3)
    paint_disc(pixels, direction(60, 40), 3, 900)
    assert "unless that light is even" in clipped(environment(pixels))


@pytest.mark.parametrize("times", [2, 3, 4])
def test_a_map_enlarged_by_repeating_its_pixels_is_not_suspected(times, sunrise):
    pixels = load(sunrise).radiance[:, 256:-256].repeat(times, axis=0).repeat(times, axis=1)
    assert clipped(environment(np.concatenate([pixels, pixels], axis=1))) == ""


def test_an_overcast_sky_keeps_nothing():
    pixels = sky(2048, 1.0)
    pixels[512:] = 0.2
    pixels *= 0.9 + 0.2 * noise(1024)[..., :1]
    assert environment(pixels).reduction.brightest.values.size == 0
    assert pixels[:128].size > MOST


def wide_and_whole(pixels: np.ndarray, monkeypatch) -> tuple[EnvironmentMap, EnvironmentMap]:
    """The same map read by rows and narrowed, and all of it looked at at once."""
    wide = environment_from_pixels(pixels, "map")
    with monkeypatch.context() as patch:
        patch.setattr(environments, "WIDE", pixels.shape[1])
        whole = environment_from_pixels(pixels, "map")
    assert wide.reduction
    assert whole.reduction is None
    return wide, whole


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("damage", [None, -1.0, np.nan])
def test_a_map_read_by_rows_gives_the_same_sentence(kind, damage, monkeypatch):
    pixels = clipped_at(0.5, outdoors(2048, radius=0.5)).astype(kind)
    if damage is not None:
        pixels[::200, ::300] = damage
    wide, whole = wide_and_whole(pixels, monkeypatch)
    assert clipped(wide) == clipped(whole) != ""
    found, expected = wide.reduction.brightest, brightest_of_map(whole.radiance)
    assert (found.highest == expected.highest).all()
    assert sorted(zip(found.pixels, found.channels, found.values, strict=True)) == sorted(
        zip(expected.pixels, expected.channels, expected.values, strict=True)
    )


def test_the_brightest_numbers_do_not_depend_on_how_many_cores_there_are(monkeypatch):
    pixels = clipped_at(0.5, outdoors(2048, radius=0.5))
    monkeypatch.setattr(reduction, "PIXELS", 1 << 16)
    expected = environment(pixels)
    for number in (1, 7):
        monkeypatch.setenv(cores.LIMIT, str(number))
        found = environment(pixels)
        assert map_warnings(found) == map_warnings(expected)
        assert (found.reduction.brightest.pixels == expected.reduction.brightest.pixels).all()


def test_a_narrower_version_of_a_map_is_suspected_alike():
    for part in (1.0, 0.5):
        pixels = clipped_at(part, outdoors(1024, radius=3))
        for width in (1024, 512, 256):
            found = environment(environment(pixels).narrowed(width)[::-1])
            assert bool(clipped(found)) == (part < 1)
            assert upside_down(found)


@given(
    st.integers(0, 255),
    st.floats(1e-3, 1e3),
    st.sampled_from([1.0, 0.5, 0.1]),
    st.booleans(),
    st.floats(5, 80),
)
def test_neither_turning_nor_scaling_changes_more_than_the_value(
    turn, factor, part, flipped, elevation
):
    pixels = sky(256, (0.5, 0.7, 1.0))
    pixels[64:] = 0.05
    add_sun(pixels, 3, elevation=elevation)
    pixels = clipped_at(part, pixels)[:: -1 if flipped else 1]
    before = map_warnings(environment(pixels))
    assert len(before) == (part < 1) + flipped
    assert map_warnings(environment(np.roll(pixels, turn, axis=1))) == before
    scaled = map_warnings(environment(pixels * factor))
    assert [_without_value(said) for said in scaled] == [_without_value(said) for said in before]


def _without_value(said: str) -> str:
    before, _, after = said.partition(" flat at ")
    return before + after.partition(": ")[2]


@pytest.mark.parametrize("ground", [0.0, 0.1, 0.2])
def test_an_outdoor_map_upside_down_is_suspected(ground):
    pixels = outdoors(ground=ground)
    assert upside_down(environment(pixels)) == ""
    assert "stored upside down" in upside_down(environment(pixels[::-1]))


def test_a_real_map_upside_down_is_suspected_and_nothing_else(sunrise):
    found = load(sunrise)
    assert map_warnings(found) == ()
    said = map_warnings(environment(found.radiance[::-1]))
    assert len(said) == 1
    assert said[0].startswith("94% of the light on level surfaces comes from below the horizon")


def mirrored() -> np.ndarray:
    pixels = outdoors()
    pixels[64:] = pixels[63::-1]
    return pixels


def lamps_below() -> np.ndarray:
    """A dark studio that is lit from below."""
    pixels = sky(256, 0.01)
    for azimuth in (20, 140, 260):
        add_sun(pixels, 4, azimuth=azimuth, elevation=-50)
    return pixels


@pytest.mark.parametrize(
    "make", [lambda: outdoors(ground=0.85), mirrored, lamps_below], ids=["snow", "mirror", "lamps"]
)
def test_light_from_below_that_may_be_so_is_not_suspected(make):
    pixels = make()
    assert upside_down(environment(pixels)) == ""
    assert upside_down(environment(pixels[::-1])) == ""


def test_few_harmless_repairs_are_no_warning():
    pixels = outdoors()
    pixels[3, 4:14] = np.nan
    pixels[100, 4:14] = -1e-4
    assert map_warnings(environment(pixels)) == ()


def test_repairs_that_change_the_light_are_a_warning():
    pixels = outdoors()
    pixels[60, 4] = -3000
    (said,) = map_warnings(environment(pixels))
    added = environment(pixels).repaired_share
    assert said.startswith(
        f"1 pixel (0.00%) held no light and was repaired, which changed all light by {added:.2%}"
    )


def test_many_repairs_are_a_warning():
    pixels = outdoors()
    pixels[:, ::20] = np.nan
    (said,) = map_warnings(environment(pixels))
    assert said.startswith("1,664 pixels (5.08%) held no light and were repaired")


def test_infinite_light_is_said_once():
    pixels = outdoors()
    pixels[pixels > 0.5 * pixels.max()] = np.inf
    (said,) = map_warnings(environment(pixels))
    count = int(np.isinf(pixels).any(axis=-1).sum())
    assert said.startswith(f"Where the map is infinite ({count} pixels)")


def test_a_conversion_has_the_warnings_of_its_map():
    world = environment(clipped_at(0.5, outdoors()))
    conversion = convert(world)
    assert map_warnings(conversion) == map_warnings(world) != ()
    assert describe(conversion)["notes"] == [*map_warnings(world), *conversion.notes]


@pytest.mark.parametrize("ending", ["hdr", "exr"])
def test_warnings_are_said_by_the_command_line_and_stand_in_the_notes_once(
    ending, tmp_path, capsys
):
    pixels = clipped_at(0.5, outdoors(1024, radius=2))[::-1]
    write = write_hdr if ending == "hdr" else write_exr
    path = write(tmp_path / f"map.{ending}", np.ascontiguousarray(pixels))
    for command in (["info", str(path)], ["convert", str(path), "-o", str(tmp_path / "out")]):
        assert main(command) == 0
        said = capsys.readouterr().out
        assert said.count("warning: The brightest ") == 1
        assert said.count("stored upside down") == 1
    notes = json.loads((tmp_path / "out" / "map.lights.json").read_text())["notes"]
    assert sum("are flat at" in note for note in notes) == 1
    assert sum("stored upside down" in note for note in notes) == 1
