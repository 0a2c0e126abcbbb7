from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import sphere
from tests.maps import direction


@pytest.mark.parametrize("height", [1, 2, 3, 256, 8192])
def test_solid_angles_cover_the_sphere(height):
    solid = sphere.row_solid_angles(2 * height, height)
    assert solid.sum() * 2 * height == pytest.approx(4 * np.pi, rel=1e-13)


def test_the_pole_row_of_a_large_map_is_exact():
    # 1 - cos x = 2 sin^2(x / 2): the closed form that a difference of cosines loses.
    exact = (2 * np.pi / 16384) * 2 * np.sin(np.pi / 8192 / 2) ** 2
    assert sphere.row_solid_angles(16384, 8192)[0] == pytest.approx(exact, rel=1e-14)


@pytest.mark.parametrize(
    ("u", "v", "expected"),
    [
        (0.5, 0.5, (1, 0, 0)),
        (0.25, 0.5, (0, 1, 0)),
        (0.75, 0.5, (0, -1, 0)),
        (0.0, 0.5, (-1, 0, 0)),
        (0.5, 0.0, (0, 0, 1)),
        (0.5, 1.0, (0, 0, -1)),
    ],
)
def test_axes_are_those_of_cycles(u, v, expected):
    assert sphere.to_directions(u, v) == pytest.approx(expected, abs=1e-15)


@given(st.floats(0.001, 0.999), st.floats(0.001, 0.999))
def test_image_and_direction_are_inverses(u, v):
    assert sphere.to_image(sphere.to_directions(u, v)) == pytest.approx((u, v), abs=1e-12)


def test_pixels_are_found_at_their_centroids():
    """Against the mean direction of 400 x 400 points in each pixel, weighted by solid angle."""
    for width, row, column in [(8, 0, 3), (8, 2, 7), (64, 0, 0), (64, 31, 9), (64, 12, 40)]:
        height = width // 2
        fine = (np.arange(400) + 0.5) / 400
        v, u = (row + fine[:, None]) / height, (column + fine[None, :]) / width
        weight = np.sin(np.pi * v) / np.sin(np.pi * v).sum() / 400
        mean = np.einsum(
            "ij,ijk->k", np.broadcast_to(weight, (400, 400)), sphere.to_directions(u, v)
        )
        index = np.array([row * width + column])
        length = np.linalg.norm(mean)
        (found,) = sphere.pixel_directions(index, width, height)
        pixel = np.pi / height
        assert sphere.angle_between(found, mean / length) < 0.03 * pixel
        assert sphere.pixel_spread(index, width, height)[0] == pytest.approx(1 - length, rel=0.1)


@given(st.floats(1e-9, np.pi))
def test_angles_are_exact_at_both_ends(angle):
    b = np.array([np.cos(angle), np.sin(angle), 0])
    assert sphere.angle_between(np.array([1.0, 0, 0]), b) == pytest.approx(angle, rel=1e-12)


def test_a_group_crosses_the_seam():
    mask = np.zeros((8, 16), bool)
    mask[3, 0] = mask[4, 15] = True
    mask[3, 7] = True
    labels, count = sphere.connected_groups(mask)
    assert count == 2
    assert labels[3, 0] == labels[4, 15] != labels[3, 7]


@pytest.mark.parametrize("row", [0, -1])
def test_a_group_crosses_a_pole(row):
    mask = np.zeros((8, 16), bool)
    mask[row, 2] = mask[row, 10] = True
    _, count = sphere.connected_groups(mask)
    assert count == 1


def test_no_group_in_an_empty_mask_and_one_in_a_full_one():
    assert sphere.connected_groups(np.zeros((4, 8), bool))[1] == 0
    labels, count = sphere.connected_groups(np.ones((4, 8), bool))
    assert count == 1
    assert (labels == 1).all()


@given(st.integers(0, 2**32 - 1), st.integers(0, 15))
def test_groups_do_not_depend_on_where_the_seam_is(seed, shift):
    mask = np.random.default_rng(seed).random((8, 16)) < 0.3
    labels, count = sphere.connected_groups(mask)
    rolled, rolled_count = sphere.connected_groups(np.roll(mask, shift, axis=1))
    assert count == rolled_count
    pairs = set(zip(np.roll(labels, shift, axis=1).ravel(), rolled.ravel(), strict=True))
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def test_a_circle_lies_at_its_radius():
    centre = direction(77, 88.5)
    rim = sphere.circle(centre, np.radians(3.0))
    assert sphere.angle_between(rim, centre) == pytest.approx(np.radians(3.0), rel=1e-12)


@pytest.mark.parametrize("corners", [False, True])
@pytest.mark.parametrize("width", [2, 4, 16])
def test_neighbours_go_over_seam_and_poles(width, corners):
    height = width // 2
    steps = [(0, -1), (0, 1), (-1, 0), (1, 0)]
    if corners:
        steps += [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    found = sphere.neighbours(np.arange(width * height), width, height, corners)
    for pixel, others in enumerate(found):
        row, column = divmod(pixel, width)
        for (down, right), other in zip(steps, others, strict=True):
            over = not 0 <= row + down < height
            there = row if over else row + down
            beside = (column + right + (width // 2 if over else 0)) % width
            assert other == there * width + beside


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 8, 32]))
def test_grown_by_one_pixel_on_all_sides(seed, width):
    mask = np.random.default_rng(seed).random((width // 2, width)) < 0.1
    expected = mask.copy()
    around = sphere.neighbours(np.flatnonzero(mask), width, width // 2, corners=True)
    expected.ravel()[around] = True
    assert (sphere.grown(mask) == expected).all()
