"""Wide maps: narrowed with nothing lost, whatever the rows that are read at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import cores, reduction, sphere
from sunsplit.core import environment as environments
from sunsplit.core.conversion import convert
from sunsplit.core.environment import (
    LUMINANCE_WEIGHTS,
    environment_from_pixels,
    environment_from_strips,
    scalar_irradiance,
    working_width,
)
from sunsplit.core.errors import UnusableInput
from sunsplit.core.pixels import HeldPixels, copy_as_float64, highest_light, planes_of
from sunsplit.core.reduction import narrowed, reduced
from sunsplit.core.repairs import repair
from sunsplit.core.residual import levels_of
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.tolerances import ACCOUNT
from tests.files import noise
from tests.maps import direction, paint_disc, sky


@dataclass(frozen=True)
class Raw:
    """Unrepaired pixels as a file gives them, of its own type."""

    radiance: np.ndarray
    least_rows: int = 1
    packed_rows: int = 1
    asked: list[int] = field(default_factory=list)

    @property
    def width(self) -> int:
        return self.radiance.shape[1]

    @property
    def height(self) -> int:
        return self.radiance.shape[0]

    def strips(self, rows: int) -> Iterator[tuple[np.ndarray, ...]]:
        self.asked.append(rows)
        for top in range(0, self.height, rows):
            yield tuple(np.moveaxis(self.radiance[top : top + rows], -1, 0).copy())


@pytest.fixture(params=[1, 5000])
def few_rows(request, monkeypatch) -> None:
    monkeypatch.setattr(reduction, "ROWS", request.param)
    monkeypatch.setattr(reduction, "PIXELS", request.param)


@pytest.mark.parametrize(("width", "step"), [(64, 2), (96, 3), (128, 16), (64, 1)])
@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_means_and_directions_are_those_of_the_pixels(width, step, kind, few_rows):
    pixels = noise(width // 2).astype(kind)
    pixels[3, 5] = 900
    found = reduced(Raw(pixels), width // step)
    radiance = pixels.astype(np.float64)
    solid = np.repeat(sphere.row_solid_angles(width, width // 2), width)
    size = width, width // 2
    directions = sphere.pixel_directions(np.arange(width * width // 2), *size)
    shape = width // 2 // step, step, width // step, step

    def sums(values: np.ndarray) -> np.ndarray:
        return values.reshape(*shape, -1).sum(axis=(1, 3))

    light = solid[:, None] * radiance.reshape(-1, 3)
    assert found.radiance == pytest.approx(sums(light) / sums(solid[:, None]), rel=1e-6)
    luminous = light @ LUMINANCE_WEIGHTS
    expected = sums(luminous[:, None] * directions) / sums(luminous[:, None])
    assert found.direction == pytest.approx(expected, abs=1e-7)
    assert found.scalar_irradiance == pytest.approx(light.sum(axis=0), rel=1e-14)


def test_sums_do_not_depend_on_how_many_rows_are_read(monkeypatch):
    pixels = Raw(noise(96))
    expected = reduced(pixels, 24)
    for rows, most in ((1, 1), (8, 4000), (4096, 1 << 24)):
        monkeypatch.setattr(reduction, "ROWS", rows)
        monkeypatch.setattr(reduction, "PIXELS", most)
        found = reduced(pixels, 24)
        assert (found.radiance == expected.radiance).all()
        assert (found.direction == expected.direction).all()
        assert (found.scalar_irradiance == expected.scalar_irradiance).all()


@pytest.mark.parametrize("packed", [1, 32, 256])
def test_what_is_packed_together_is_unpacked_once_and_keeps_two_cores_busy(packed):
    pixels = Raw(noise(1024), packed_rows=packed)
    reduced(pixels, 64)
    (rows,) = pixels.asked
    assert rows % packed == 0
    assert rows >= max(2 * packed, reduction.ROWS)
    narrowed(pixels, 64)
    assert pixels.asked[1] % packed == 0


def test_sums_do_not_depend_on_how_many_cores_there_are(monkeypatch):
    pixels = Raw(noise(96))
    monkeypatch.setattr(reduction, "PIXELS", 1)
    expected = reduced(pixels, 24)
    for number in (1, 7):
        monkeypatch.setenv(cores.LIMIT, str(number))
        found = reduced(pixels, 24)
        assert (found.radiance == expected.radiance).all()
        assert (found.direction == expected.direction).all()


BAD = st.sampled_from([np.nan, np.inf, -np.inf, -2.5, -0.0])
PLACES = st.tuples(st.integers(0, 15), st.integers(0, 31), st.integers(0, 2))


@given(st.dictionaries(PLACES, BAD, max_size=40), st.sampled_from([np.float16, np.float32]))
def test_rows_are_repaired_as_a_whole_map_is(places, kind):
    pixels = noise(16).astype(kind)
    for place, value in places.items():
        pixels[place] = value
    planes = planes_of(tuple(np.moveaxis(pixels, -1, 0)))
    repairs = repair(planes)
    whole = np.moveaxis(planes, 0, -1)
    before = reduction.ROWS, reduction.PIXELS
    try:
        reduction.ROWS = reduction.PIXELS = 2
        found = reduced(Raw(pixels), 16)
    finally:
        reduction.ROWS, reduction.PIXELS = before
    assert found.radiance == pytest.approx(narrowed(HeldPixels.of(whole), 16), rel=1e-6)
    assert str(found.repairs) == str(repairs)
    assert found.repairs.negative_energy == pytest.approx(repairs.negative_energy, rel=1e-12)
    again = [np.stack(strip, axis=-1) for strip in found.pixels.strips(4)]
    assert (np.concatenate(again).astype(np.float32) == whole).all()


@pytest.mark.parametrize(
    ("width", "expected"),
    [
        *((2, 2), (1000, 1000), (1024, 1024), (1026, 1026), (2048, 1024), (3072, 1024)),
        *((16384, 1024), (10000, 1000), (6054, 2018), (12022, 12022)),
    ],
)
def test_a_map_is_narrowed_to_a_whole_part(width, expected):
    assert working_width(width) == expected


def sunny(width: int) -> np.ndarray:
    """A sun of .5 degrees in a sky that is not even."""
    pixels = sky(width, 0.3)
    pixels *= 1 + 0.2 * noise(width // 2)[..., :1]
    paint_disc(pixels, direction(61, 37), 0.25, 40000.0, fine=3)
    return pixels.astype(np.float32)


@pytest.fixture(scope="module")
def wide() -> environments.EnvironmentMap:
    return environment_from_pixels(sunny(4096), "wide")


def test_a_wide_map_keeps_its_sun(wide):
    """Place and width of a sun that is narrower than two of the pixels that are looked at."""
    conversion = convert(wide, ConversionSettings(lights=1))
    assert wide.radiance.shape == (512, 1024, 3)
    assert len(conversion.suns) == 1
    sun = conversion.suns[0]
    apart = np.degrees(sphere.angle_between(sun.to_light, direction(61, 37)))
    assert apart < 0.005
    assert np.degrees(sun.angular_diameter) == pytest.approx(0.5, rel=0.05)
    expected = np.pi * np.radians(0.25) ** 2 * 40000
    assert sun.scalar_irradiance == pytest.approx([expected] * 3, rel=0.01)


def test_the_account_of_a_wide_map_is_that_of_all_its_pixels(wide):
    conversion = convert(wide)
    whole = scalar_irradiance(sunny(4096))
    assert conversion.account.source == pytest.approx(whole, rel=1e-13)
    assert conversion.account.relative_error.max() <= ACCOUNT


def test_a_residual_with_all_pixels_closes_everywhere(wide):
    """And shows the map where no light was taken, and no speck where it was."""
    conversion = convert(wide, ConversionSettings(residual_width="own"))
    levelled = conversion.levelled
    rows = [np.stack(strip, axis=-1) for strip in levelled.strips(256)]
    whole = np.concatenate(rows)
    assert whole.shape == (2048, 4096, 3)
    assert narrowed(HeldPixels.of(whole), 1024) == pytest.approx(conversion.residual, rel=2e-6)
    before = sunny(4096)
    assert (whole <= before).all()
    assert (whole < before).any(axis=-1).mean() < 1e-3
    assert whole.max() < 1


@pytest.mark.parametrize("width", [2048, 512])
def test_a_residual_of_another_width_keeps_the_account(wide, width):
    conversion = convert(wide, ConversionSettings(residual_width=width))
    assert conversion.levelled is None
    assert conversion.residual.shape == (width // 2, width, 3)
    assert conversion.account.relative_error.max() <= ACCOUNT


def test_a_width_that_is_no_part_of_the_map_is_refused(wide):
    with pytest.raises(UnusableInput, match="a map 4096 wide"):
        convert(wide, ConversionSettings(residual_width=1000))


@given(st.lists(st.floats(0, 1e6, width=32), min_size=4, max_size=4), st.floats(0, 1))
def test_a_level_leaves_the_mean_that_is_asked_for(values, part):
    values = np.array([values], np.float32)
    weight = np.array([1.0, 2.0, 2.0, 0.5])
    wanted = np.float32(part * (values @ weight)[0] / weight.sum())
    level = levels_of(values, weight, np.array([wanted]))
    left = np.minimum(values, level[:, None]).astype(np.float64)
    assert (left @ weight)[0] / weight.sum() == pytest.approx(wanted, rel=1e-5, abs=1e-30)


def test_every_half_float_is_copied_exactly():
    halfs = np.arange(0x7C00, dtype=np.uint16).view(np.float16).reshape(1, -1)
    doubles = np.empty(halfs.shape)
    copy_as_float64(halfs, doubles)
    assert (doubles == halfs).all()
    for signed in (halfs, -halfs):
        found = planes_of((signed, signed, signed))
        assert (found == signed).all()
        assert (np.signbit(found) == np.signbit(signed)).all()
    assert highest_light(halfs) == 65504


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("bad", [np.nan, -1e-7, np.inf, -np.inf])
def test_what_is_no_light_is_noticed(kind, bad):
    plane = np.ones((4, 8), kind)
    assert highest_light(plane) == 1
    plane[2, 3] = bad
    assert np.isnan(highest_light(plane))


def test_pixels_by_rows_make_the_same_map_as_pixels_in_memory(wide):
    pixels = sunny(4096)
    found = environment_from_strips(Raw(pixels), "wide")
    assert (found.radiance == wide.radiance).all()
    assert (found.reduction.direction == wide.reduction.direction).all()


def test_a_wide_black_map_is_refused():
    with pytest.raises(UnusableInput, match="holds no light"):
        environment_from_strips(Raw(np.zeros((1024, 2048, 3), np.float32)), "black")
