"""Maps and choices at their ends: what must hold of any conversion holds of these.

The maps and the choices are in `tests.stress`, what must hold is in `tests.conversion_checks`.
"""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sunsplit.core import ConversionSettings, convert, save
from sunsplit.core.environment import environment_from_pixels
from sunsplit.core.errors import UnusableInput
from sunsplit.core.files.conversion import account_of_files
from sunsplit.core.tolerances import ACCOUNT_FLOAT32, ACCOUNT_HALF, EQUIVARIANCE
from tests.conversion_checks import check_conversion, converted, fingerprint
from tests.core.test_files_saving import type_of_pixels
from tests.maps import environment
from tests.stress import BRIGHTEST, CHOICES, FAINTEST, any_choices, corpus, even, extreme_maps, lit

MAPS = corpus()
SCALED = {n: m for n, m in MAPS.items() if m[m > 0].min() > 2**-60 and m.max() < 2**60}
"""What can be made 2^30 times as bright or as faint without a value that float32 must round."""

METHODS = ("edge", "penrose", "median-cut", "variance", "kmeans")


@pytest.mark.parametrize("name", MAPS)
def test_any_map_by_default(name):
    converted(MAPS[name], ConversionSettings(lights=4))


@pytest.mark.parametrize("name", ["even 4", "antipodes", "one row"])
def test_as_many_lights_as_it_takes_or_as_there_may_be(name):
    for lights in (None, 64):
        converted(MAPS[name], ConversionSettings(lights=lights))


@pytest.mark.parametrize("method", METHODS)
def test_any_method_for_all_of_a_map_of_all_decades(method):
    """A variance was worked out from differences of sums once, and overflowed for three rows."""
    for name in ("24 decades", "all decades", "all decades, three rows"):
        converted(MAPS[name], ConversionSettings(method=method, share=1, lights=4))


@pytest.mark.parametrize(("number", "choice"), list(enumerate(CHOICES)))
def test_any_choice(number, choice):
    """An eighth of the maps each, the next choice another eighth."""
    for pixels in list(MAPS.values())[number % 8 :: 8]:
        converted(pixels, CHOICES[choice])


@settings(max_examples=25)
@given(extreme_maps(), any_choices())
def test_any_map_by_any_choice(pixels, chosen):
    converted(pixels, chosen)


@settings(max_examples=10)
@given(extreme_maps(), any_choices())
def test_again_is_the_same_to_the_bit(pixels, chosen):
    first, second = (convert(environment(pixels), chosen) for _ in range(2))
    assert fingerprint(first) == fingerprint(second)


def in_threads(count):
    """Fingerprints of a few conversions, made in a process with so many threads."""
    number = {key: str(count) for key in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    code = "from tests.conversion_checks import write_fingerprints; write_fingerprints()"
    return subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
        env=os.environ | number | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    ).stdout.splitlines()


def test_any_number_of_threads_gives_the_same_to_the_bit():
    one, two = in_threads(1), in_threads(2)
    assert len(one) == 2
    assert one == two


@pytest.mark.parametrize("name", SCALED)
def test_a_map_scaled_far_scales_to_the_bit(name):
    for method in METHODS:
        chosen = ConversionSettings(method=method, lights=4, share=0.5)
        before = convert(environment(SCALED[name]), chosen)
        for scale in (2.0**-30, 2.0**30):
            after = convert(environment(SCALED[name] * np.float32(scale)), chosen)
            assert after.predicted_error == before.predicted_error
            assert (after.account.suns == before.account.suns * scale).all()
            assert (after.residual == before.residual * np.float32(scale)).all()
            for old, new in zip(before.suns, after.suns, strict=True):
                assert (new.scalar_irradiance == old.scalar_irradiance * scale).all()
                assert (new.to_light == old.to_light).all()
                assert new.angular_diameter == old.angular_diameter


def moved(pixels, columns, mirrored):
    return np.roll(pixels[:, ::-1] if mirrored else pixels, columns, axis=1)


@settings(max_examples=20)
@given(extreme_maps(), st.sampled_from(METHODS), st.integers(0, 40), st.booleans())
def test_turned_or_mirrored_the_light_goes_along(pixels, method, columns, mirrored):
    chosen = ConversionSettings(method=method, lights=1, share=0.5)
    before = convert(environment(pixels), chosen)
    after = convert(environment(moved(pixels, columns, mirrored)), chosen)
    assert after.account.source == pytest.approx(before.account.source, rel=EQUIVARIANCE)
    assert after.account.suns == pytest.approx(
        before.account.suns, rel=EQUIVARIANCE, abs=EQUIVARIANCE * before.account.source.max()
    )
    turn = 2 * np.pi * columns / pixels.shape[1]
    for old, new in zip(before.suns, after.suns, strict=True):
        assert new.angular_diameter == pytest.approx(old.angular_diameter, abs=EQUIVARIANCE)
        if old.angular_diameter < np.pi:  # light from all sides has no one direction
            x, y, z = old.to_light * [1, -1 if mirrored else 1, 1]
            turned = [
                x * np.cos(turn) + y * np.sin(turn),
                y * np.cos(turn) - x * np.sin(turn),
                z,
            ]
            assert new.to_light == pytest.approx(turned, abs=EQUIVARIANCE)


BROKEN = {
    "NaN": np.nan,
    "inf": np.inf,
    "-inf": -np.inf,
    "negative": -1.0,
    "beyond float32": 1e300,
}


@pytest.mark.parametrize("value", BROKEN.values(), ids=BROKEN)
@pytest.mark.parametrize("channel", [0, 1, 2, slice(None)], ids=["red", "green", "blue", "all"])
def test_broken_values_are_repaired_anywhere(value, channel):
    """In each corner, over a pole, along the seam and in whole rows at once."""
    sky = even(16, 0.5).astype(np.float64)
    for place in [(0, 0), (-1, -1), (0, 7), (slice(None), 0), (0,), (slice(2, 4), slice(3, 6))]:
        at = (*place, ..., channel)
        found = environment(lit(sky, value, at))
        broken = np.zeros(sky.shape, bool)
        broken[at] = True
        assert found.repairs.pixels == broken.any(axis=-1).sum()
        assert (found.radiance[~broken] == 0.5).all()
        check_conversion(convert(found, ConversionSettings(lights=2)))


@pytest.mark.parametrize("value", [np.nan, -np.inf, -1.0, 0.0, 1e-60])
def test_a_map_without_any_light_is_one_sentence(value):
    with pytest.raises(UnusableInput, match=r"^map holds no light: every pixel is black\.$"):
        environment_from_pixels(np.full((4, 8, 3), value), "map")


def test_a_map_of_nothing_but_infinity_is_even():
    found = environment(np.full((4, 8, 3), np.inf))
    assert found.repairs.infinite == 32
    assert convert(found).suns == ()


@pytest.mark.parametrize("shape", [(1, 1), (1, 3), (2, 3), (3, 5), (5, 1), (1, 16384), (7, 15)])
def test_any_size_that_is_not_two_to_one_is_one_sentence(shape):
    with pytest.raises(UnusableInput, match=rf"^map is {shape[1]} x {shape[0]}, not 2:1\. .*\.$"):
        environment_from_pixels(np.ones((*shape, 3)), "map")


LIMITS = {
    65504.0: "float16",
    np.nextafter(np.float32(65504), np.float32(np.inf)): "float32",
    65519.0: "float32",  # a half would round it down to its limit
    65520.0: "float32",  # and this one to infinity
    BRIGHTEST: "float32",
    2.0**-14: "float16",  # the smallest normal half
    2.0**-24: "float16",  # the smallest of all
    2.0**-25: "float32",
    FAINTEST: "float32",
}


@pytest.mark.parametrize(("value", "kind"), LIMITS.items())
def test_a_residual_at_the_limits_of_half_is_read_as_it_was(value, kind, tmp_path):
    for name, pixels in (("even", even(16, value)), ("one", lit(even(16, 0), value, (3, 4)))):
        conversion = convert(environment(pixels, name), ConversionSettings(share=0))
        files = save(conversion, tmp_path)
        assert type_of_pixels(files.residual) == {kind}
        most = ACCOUNT_HALF if kind == "float16" else ACCOUNT_FLOAT32
        assert account_of_files(files.lights).relative_error.max() <= most
