"""What a region's surroundings would show in its place."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import cores, sphere, surroundings

HEIGHT, WIDTH = 64, 128


def map_with_holes(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A rough map, and a region that shines: over a pole, over the seam, a large one, and specks
    that may touch those at their corners."""
    random = np.random.default_rng(seed)
    region = random.random((HEIGHT, WIDTH)) < 0.02
    region[:3, 10:70] = True
    region[30:38, :6] = region[30:38, -4:] = True
    region[20:44, 40:60] = True
    region[50:62, 80:100] = True
    radiance = random.random((HEIGHT, WIDTH, 3)).astype(np.float32)
    radiance[region] += 100
    return radiance, region


@pytest.fixture
def in_many_parts(monkeypatch):
    monkeypatch.setattr(surroundings, "A_PART", 1)


@pytest.mark.parametrize("seed", [0, 1])
def test_all_that_is_filled_is_the_mean_of_its_neighbours(in_many_parts, seed):
    radiance, region = map_with_holes(seed)
    filled = radiance.copy()
    filled[region] = surroundings.surroundings(radiance, region)
    near = sphere.neighbours(np.flatnonzero(region), WIDTH, HEIGHT)
    wanted = filled.reshape(-1, 3)[near].mean(axis=1, dtype=np.float64)
    np.testing.assert_allclose(filled[region], wanted, rtol=1e-6)  # as single precision holds it


def test_what_is_filled_does_not_hang_on_the_number_of_cores(in_many_parts, monkeypatch):
    made = []
    for number in "14":
        monkeypatch.setenv(cores.LIMIT, number)
        made.append(surroundings.surroundings(*map_with_holes()))
    np.testing.assert_array_equal(*made)


def test_a_large_group_gets_the_mean_of_its_rim(in_many_parts, monkeypatch):
    radiance, region = map_with_holes()
    usual = surroundings.surroundings(radiance, region)
    monkeypatch.setattr(surroundings, "LARGE", 470)
    labels, count = sphere.connected_groups(region)
    size = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    [large] = np.flatnonzero(size > 470)
    mine = labels == large + 1
    rim = np.setdiff1d(
        sphere.neighbours(np.flatnonzero(mine), WIDTH, HEIGHT), np.flatnonzero(region)
    )
    found = surroundings.surroundings(radiance, region)
    # A pixel of the rim counts as often as it touches.
    least, most = (radiance.reshape(-1, 3)[rim].mean(axis=0) * part for part in (0.8, 1.2))
    flat = found[mine[region]]
    assert np.all(flat == flat[0])
    assert np.all((least < flat[0]) & (flat[0] < most))
    np.testing.assert_array_equal(found[~mine[region]], usual[~mine[region]])


def test_no_region_and_nothing_but_region():
    radiance, region = map_with_holes()
    assert surroundings.surroundings(radiance, np.zeros_like(region)).shape == (0, 3)
    assert not surroundings.surroundings(radiance, np.ones_like(region)).any()


def test_the_largest_group_is_of_the_first_part_and_no_part_is_empty(in_many_parts):
    sizes = np.array([0, 5, 300, 7, 0, 5, 6, 90, 4, 3])
    parts = surroundings._parts(sizes)
    used = np.bincount(parts[sizes > 0])
    assert parts[2] == 0
    assert used.all()
    assert len(used) > 2
    assert surroundings._parts(np.zeros(3, int)).tolist() == [0, 0, 0]
