"""Outlines: sides of pixels as runs, told in u and v; which light became which sun."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays

from sunsplit.core import ConversionSettings, convert, load, sphere
from sunsplit.core.cells import HALVES, OUTSIDE
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.outlines import (
    MOST_RUNS,
    Outlines,
    lines_in_image,
    outlines_of,
    runs_between,
)
from tests.maps import direction, environment, paint_disc, sky

LABELS = arrays(
    np.int32, some.tuples(some.integers(1, 9), some.integers(2, 12)), elements=some.integers(-1, 3)
)


def inside(text: str) -> np.ndarray:
    """A region drawn in letters, as labels: OUTSIDE and 0."""
    rows = text.split()
    return np.array([[0 if letter == "x" else OUTSIDE for letter in row] for row in rows], np.int32)


def lengths(runs: np.ndarray) -> np.ndarray:
    ends = runs.astype(int).reshape(-1, 2, 2)
    return np.abs(np.diff(ends, axis=1)).sum(axis=(1, 2))


def test_a_rectangle_has_four_sides():
    runs = runs_between(inside("...... .xxx.. .xxx.. ......"), outer=True)
    found = {tuple(run) for run in runs.tolist()}
    assert found == {(1, 1, 1, 3), (4, 1, 4, 3), (1, 1, 4, 1), (1, 3, 4, 3)}


def test_across_the_seam_there_is_no_border_and_at_a_pole_neither():
    runs = runs_between(inside("x....x x....x ......"), outer=True)
    found = {tuple(run) for run in runs.tolist()}
    assert found == {(1, 0, 1, 2), (5, 0, 5, 2), (0, 2, 1, 2), (5, 2, 6, 2)}


def test_a_border_at_the_seam_is_told_at_both_ends():
    runs = runs_between(inside("x.... x...."), outer=True)
    assert {tuple(run) for run in runs.tolist()} == {(0, 0, 0, 2), (1, 0, 1, 2), (5, 0, 5, 2)}


def test_between_cells_is_not_around_them():
    labels = np.array([[-1, 0, 1, -1], [-1, 0, 0, -1]], np.int32)
    between = runs_between(labels, outer=False)
    assert {tuple(run) for run in between.tolist()} == {(2, 0, 2, 1), (2, 1, 3, 1)}
    around = runs_between(labels, outer=True)
    assert {tuple(run) for run in around.tolist()} == {(1, 0, 1, 2), (3, 0, 3, 2)}


@given(LABELS)
def test_runs_are_as_long_as_sides_of_pixels_where_labels_differ(labels):
    across = labels != np.roll(labels, 1, axis=1)
    down = labels[1:] != labels[:-1]
    # A border at the seam counts at both ends of the map.
    expected = across.sum() + across[:, 0].sum() + down.sum()
    runs = np.concatenate([runs_between(labels, outer) for outer in (True, False)])
    assert lengths(runs).sum() == expected
    assert (lengths(runs) > 0).all()


@given(LABELS)
def test_a_region_painted_from_its_outline_is_the_region(labels):
    region = labels == OUTSIDE
    runs = runs_between(np.where(region, OUTSIDE, 0).astype(np.int32), outer=True).astype(int)
    crossed = np.zeros((labels.shape[0], labels.shape[1] + 1), bool)
    for x, top, end, bottom in runs:
        if x == end:
            crossed[top:bottom, x] ^= True
    # Along a row each border turns inside to outside.
    painted = np.logical_xor.accumulate(crossed[:, 1:-1], axis=1)
    painted = np.concatenate([np.zeros((len(painted), 1), bool), painted], axis=1)
    assert (painted == (region ^ region[:, :1])).all()


def test_text_and_back(sunrise):
    outlines = outlines_of(convert(load(sunrise)))
    text = outlines.to_text()
    assert text.isascii()
    assert len(text) < 20_000
    again = Outlines.from_text(text)
    assert (again.region == outlines.region).all()
    assert (again.cells == outlines.cells).all()
    assert again.region_size == outlines.region_size
    assert again.cells_size == outlines.cells_size


@pytest.mark.parametrize("text", ["", "x", "MQ==", "MnicAwAAAAAB", "MXicAwAAAAAB", "ü"])
def test_what_is_no_outline_is_refused(text):
    with pytest.raises(ValueError, match="outlines"):
        Outlines.from_text(text)


def test_a_map_of_specks_stays_small():
    random = np.random.default_rng(3)
    pixels = sky(512, 0.1)
    pixels[random.random(pixels.shape[:2]) < 0.2] = 50
    conversion = convert(environment(pixels), ConversionSettings(share=0.9, lights=4))
    exact = runs_between(conversion.strata.region_a.astype(np.int32) - 1, outer=True)
    assert len(exact) > MOST_RUNS
    outlines = outlines_of(conversion)
    assert len(outlines.region) <= MOST_RUNS
    assert outlines.region_size[0] < 512
    assert outlines.region_lines().max() == 1


def test_region_a_is_outlined_where_it_is(sunrise):
    conversion = convert(load(sunrise))
    outlines = outlines_of(conversion)
    lines = outlines.region_lines()
    rows, columns = np.nonzero(conversion.strata.region_a)
    height, width = conversion.strata.region_a.shape
    assert lines[..., 0].min() * width == columns.min()
    assert lines[..., 0].max() * width == columns.max() + 1
    assert lines[..., 1].min() * height == rows.min()
    assert lines[..., 1].max() * height == rows.max() + 1


def two_suns(width: int = 256) -> np.ndarray:
    pixels = sky(width, 0.3)
    paint_disc(pixels, direction(178, 20), 6, (900, 700, 400))
    paint_disc(pixels, direction(0, 85), 7, (300, 400, 900))
    return pixels


METHODS = ["edge", "penrose", "median-cut", "variance", "kmeans"]


@pytest.mark.parametrize("per_stratum", [False, True])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("share", [0.8, None])
def test_cells_hold_what_their_suns_give(method, share, per_stratum):
    """The light of each cell, summed over its pixels, is what its sun gives: no other label."""
    settings = ConversionSettings(
        method=method, share=share, lights=9, per_stratum=per_stratum and method != "edge"
    )
    env = environment(two_suns())
    conversion = convert(env, settings)
    labels = conversion.cells.labels()
    flux = (env.radiance - conversion.residual).astype(np.float64)
    # A quarter of a pixel has a quarter of what it gives, but for what the pixel's height changes.
    height, width = env.height, env.width
    fine = flux.repeat(HALVES, axis=0).repeat(HALVES, axis=1)
    fine *= sphere.row_solid_angles(HALVES * width, HALVES * height)[:, None, None]
    given = np.zeros((len(conversion.suns), 3))
    np.add.at(given, labels[labels != OUTSIDE], fine[labels != OUTSIDE])
    expected = np.array([sun.scalar_irradiance for sun in conversion.suns])
    assert given == pytest.approx(expected, rel=1e-5, abs=1e-5 * expected.max())
    assert (labels[(flux @ LUMINANCE_WEIGHTS == 0).repeat(2, 0).repeat(2, 1)] == OUTSIDE).all()


def test_a_large_region_in_blocks_holds_what_its_suns_give():
    random = np.random.default_rng(1)
    pixels = two_suns(512) + random.random((256, 512, 3)) * 0.1
    pixels[130, 200] = 40_000
    env = environment(pixels)
    conversion = convert(env, ConversionSettings(share=1, lights=12))
    labels = conversion.cells.labels()
    assert (labels != OUTSIDE).all()
    sides = np.unique(conversion.cells.taken.squares[:, 2])
    assert sides.min() == 1  # quarters of pixels
    assert sides.max() >= 16  # blocks
    solid = sphere.row_solid_angles(1024, 512)[:, None]
    for channel in range(3):
        light = env.radiance[..., channel].repeat(HALVES, 0).repeat(HALVES, 1) * solid
        given = np.bincount(labels.ravel(), light.ravel())
        expected = [sun.scalar_irradiance[channel] for sun in conversion.suns]
        assert given == pytest.approx(expected, rel=1e-6)


def test_without_suns_there_are_no_cells():
    conversion = convert(environment(sky(64)))
    assert conversion.cells is None
    outlines = Outlines.from_text(outlines_of(conversion).to_text())
    assert len(outlines.cells) == len(outlines.region) == 0


@pytest.mark.parametrize(
    ("azimuth", "elevation", "radius", "pieces"),
    [(30, 20, 10, 1), (180, 20, 10, 2), (177, -60, 10, 2), (0, 90, 10, 1), (50, 85, 10, 2)],
)
def test_a_circle_on_the_map(azimuth, elevation, radius, pieces):
    centre = direction(azimuth, elevation)
    lines = lines_in_image(sphere.circle(centre, np.radians(radius)))
    assert len(lines) <= pieces + 1  # where it begins, a piece may be cut once more
    for line in lines:
        assert line.min() >= 0
        assert line.max() <= 1
        angle = sphere.angle_between(sphere.to_directions(*line.T), centre)
        # Points that were put in at the seam lie on the straight line between two of the circle.
        assert np.degrees(angle) == pytest.approx(radius, abs=0.01)
        # No line across the map.
        assert np.abs(np.diff(line[:, 0])).max() < 0.3
    u = np.concatenate([line[:, 0] for line in lines])
    if abs(elevation) + radius > 90 or elevation == 90:
        assert u.min() < 0.01
        assert u.max() > 0.99
