from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import SphericalVoronoi

from sunsplit.core import sphere
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.voronoi import CellSums, cell_sums, label_map, nearest, voronoi_map
from tests.maps import direction, sky

SIZES = [(1, 1), (2, 1), (3, 5), (8, 4), (50, 25), (128, 64), (200, 60)]


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def uniform(count, seed=0):
    return unit(np.random.default_rng(seed).normal(size=(count, 3)))


def pixel_centres(width, height):
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return sphere.to_directions(u, v[:, None])


def compare_all(sites, width, height):
    """The definition: chords to all sites; the first of those that are equal but for rounding."""
    pixels = pixel_centres(width, height).reshape(-1, 1, 3)
    apart = np.linalg.norm(pixels - sites, axis=2)
    equal = apart <= apart.min(axis=1, keepdims=True) + 1e-14
    return equal.argmax(axis=1).reshape(height, width)


SITES = {
    "one": uniform(1),
    "two": uniform(2),
    "many": uniform(300),
    "crowded": unit(np.array([0.3, 0.5, -0.7]) + 0.01 * uniform(200)),
    "very crowded": unit(np.array([0.3, 0.5, -0.7]) + 1e-9 * uniform(20)),
    "crowded at a pole": unit(np.array([0, 0, 1]) + 0.01 * uniform(200)),
    "at the seam": np.array([direction(a, e) for a in (179, -179, 180) for e in (-1, 0, 30)]),
    "poles": np.array([[0, 0, 1.0], [0, 0, -1]]),
    "axes": np.concatenate([np.eye(3), -np.eye(3)]),
    "axes backwards": np.concatenate([np.eye(3), -np.eye(3)])[::-1],
    "antipodes": np.concatenate([uniform(20), -uniform(20)]),
    "duplicates": uniform(12)[[3, 1, 3, 4, 1, 1, 7, 8, 9, 3]],
    "nearly duplicates": unit(np.repeat(uniform(3), 3, axis=0) + 1e-15 * uniform(9, 1)),
    "a ring": np.array([direction(a, 0) for a in range(0, 360, 4)]),
    "a turned ring": np.array([direction(a + 1.4, 60) for a in range(0, 360, 4)]),
    "pixels": pixel_centres(16, 8).reshape(-1, 3),
}


@pytest.mark.parametrize("name", SITES)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_each_pixel_belongs_to_its_nearest_site(name, size):
    labels = label_map(SITES[name], *size)
    assert labels.dtype == np.int32
    assert labels.shape == size[::-1]
    assert (labels == compare_all(SITES[name], *size)).all()


@pytest.mark.parametrize("name", SITES)
def test_the_tree_and_the_map_agree(name):
    labels = label_map(SITES[name], 128, 64)
    found = nearest(pixel_centres(128, 64).reshape(-1, 3), SITES[name])
    assert found.dtype == np.intp
    assert (found.reshape(64, 128) == labels).all()


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200), st.integers(1, 90), st.integers(1, 45))
def test_any_size_of_map_and_any_number_of_sites(seed, count, width, height):
    sites = uniform(count, seed)
    assert (label_map(sites, width, height) == compare_all(sites, width, height)).all()


@pytest.mark.parametrize("count", [500, 20_000])
def test_a_large_map(count):
    """Against the tree, in a sample of its pixels and in the rows at the poles."""
    sites, rng = uniform(count), np.random.default_rng(1)
    labels = label_map(sites, 2048, 1024)
    row, column = rng.integers(0, 1024, 20_000), rng.integers(0, 2048, 20_000)
    row[:8000] = np.repeat([0, 1, 1022, 1023], 2000)
    pixels = sphere.to_directions((column + 0.5) / 2048, (row + 0.5) / 1024)
    assert (labels[row, column] == nearest(pixels, sites)).all()


def test_the_first_of_equal_sites_owns_the_cell():
    sites = np.array([direction(*angles) for angles in [(9, 9), (80, 5), (9, 9), (80, 5)]])
    assert set(np.unique(label_map(sites, 64, 32))) == {0, 1}
    assert set(nearest(uniform(50), sites)) == {0, 1}
    # As far from the one as from the other: the equator of a map with an odd number of rows.
    poles = np.array([[0, 0, -1.0], [0, 0, 1]])
    assert (label_map(poles, 9, 5)[2] == 0).all()
    assert (label_map(poles[::-1], 9, 5)[2] == 0).all()
    assert nearest(np.array([[1.0, 0, 0]]), poles).tolist() == [0]


@pytest.mark.parametrize("turn", [1, 17, 64])
def test_turning_the_sites_turns_the_labels(turn):
    angle = -2 * np.pi * turn / 128
    cos, sin = np.cos(angle), np.sin(angle)
    turned = uniform(60) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    expected = np.roll(label_map(uniform(60), 128, 64), turn, axis=1)
    assert (label_map(turned, 128, 64) == expected).all()


@pytest.mark.parametrize("count", [4, 30, 200])
def test_areas_are_those_of_the_exact_cells(count):
    """Only pixels that a border crosses may count wrongly, and less so the smaller they are."""
    sites = uniform(count, 7)
    cells = SphericalVoronoi(sites)
    cells.sort_vertices_of_regions()
    corners = [cells.vertices[region] for region in cells.regions]
    borders = [sphere.angle_between(c, np.roll(c, 1, axis=0)).sum() for c in corners]
    worst = []
    for width in (256, 1024):
        labels = label_map(sites, width, width // 2)
        area = cell_sums(np.ones((*labels.shape, 3), np.float32), labels, count).area
        error = np.abs(area - cells.calculate_areas())
        pixel = 2 * np.pi / width
        assert (error < np.array(borders) * pixel / 4 + pixel**2).all()
        worst.append(error.max())
    assert worst[1] < worst[0] / 2


@pytest.mark.parametrize("count", [1, 7, 500])
def test_the_account_closes(count):
    radiance = np.random.default_rng(3).pareto(1.1, (100, 200, 3)).astype(np.float32)
    labels = label_map(uniform(count), 200, 100)
    sums = cell_sums(radiance, labels, count)
    total = scalar_irradiance(radiance)
    assert sums.area.sum() == pytest.approx(4 * np.pi, rel=1e-13)
    assert sums.flux.sum(axis=0) == pytest.approx(total, rel=1e-12)
    filled = voronoi_map(sums.mean_radiance, labels)
    assert filled.dtype == np.float32
    assert scalar_irradiance(filled) == pytest.approx(total, rel=1e-6)
    again = cell_sums(filled, labels, count)
    assert again.flux == pytest.approx(sums.flux, rel=1e-6)


def test_a_constant_map_stays_constant():
    radiance = sky(128, [0.3, 2.0, 7.0]).astype(np.float32)
    labels = label_map(uniform(40), 128, 64)
    filled = voronoi_map(cell_sums(radiance, labels, 40).mean_radiance, labels)
    assert filled == pytest.approx(radiance, rel=1e-7)


def test_brightness_scales_the_sums():
    radiance = np.random.default_rng(0).random((32, 64, 3), dtype=np.float32)
    labels = label_map(uniform(9), 64, 32)
    sums, bright = (cell_sums(map_, labels, 9) for map_ in (radiance, radiance * 8))
    assert (bright.flux == 8 * sums.flux).all()
    assert (bright.area == sums.area).all()


def test_a_cell_without_a_pixel_holds_nothing():
    labels = np.zeros((4, 8), np.int32)
    sums = cell_sums(np.ones((4, 8, 3), np.float32), labels, 2)
    assert sums.area == pytest.approx([4 * np.pi, 0])
    assert sums.mean_radiance == pytest.approx(np.array([[1.0] * 3, [0.0] * 3]))
    assert CellSums(np.zeros((1, 3)), np.zeros(1)).mean_radiance.tolist() == [[0, 0, 0]]


def test_no_site_is_no_map():
    with pytest.raises(ValueError, match="no site"):
        label_map(np.empty((0, 3)), 8, 4)
    with pytest.raises(ValueError, match="no site"):
        nearest(uniform(3), np.empty((0, 3)))


@pytest.mark.parametrize("bad", [[0, 0, 0], [np.nan, 0, 1], [0, 0, 2.0]])
def test_sites_are_directions(bad):
    with pytest.raises(ValueError, match="unit"):
        label_map(np.array([[1.0, 0, 0], bad]), 8, 4)
