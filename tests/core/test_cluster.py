from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sunsplit.core import sphere
from sunsplit.core.cluster import Clusters, merge
from sunsplit.core.sphere import angle_between
from tests.maps import direction

FREQUENCIES = ("one", "energy", "mean")


def samples(rng, count, spread=1.0):
    """Sites, energies over some decades, areas; spread out from one direction or all around."""
    sites = rng.normal(size=(count, 3)) * spread + (0 if spread == 1 else rng.normal(size=3))
    sites /= np.linalg.norm(sites, axis=1)[:, None]
    return sites, rng.pareto(0.7, count), rng.uniform(0.1, 1, count)


def all_pairs(sites, energy, area, frequency, nearer_than, down_to=None) -> Clusters:
    """The definition: compare all pairs after each merge. Cost, then angle, then order."""
    centres, members = list(sites), [[i] for i in range(len(sites))]
    energies = [1.0] * len(sites) if frequency == "one" else list(energy)
    areas = list(area) if frequency == "mean" else [1.0] * len(sites)

    def cost(i, j, reach):
        angle = float(angle_between(centres[i], centres[j]))
        f, g = (energies[k] / areas[k] if areas[k] else 0.0 for k in (i, j))
        return (f * g / (f + g) * angle**2 if f + g else 0.0, angle) if angle < reach else None

    for reach, least in [(nearer_than, 1), (np.pi / 2 + 1e-12, down_to or len(sites))]:
        while len(centres) > least:
            pairs = [(i, j) for i in range(len(centres)) for j in range(i + 1, len(centres))]
            costs = {(cost(i, j, reach), i, j) for i, j in pairs if cost(i, j, reach)}
            if not costs:
                break
            _, i, j = min(costs)
            f, g = (energies[k] / areas[k] if areas[k] else 0.0 for k in (i, j))
            mean = (f * centres[i] + g * centres[j]) if f + g else centres[i] + centres[j]
            centres[i] = mean / np.linalg.norm(mean)
            energies[i] += energies[j]
            areas[i] += areas[j] if frequency == "mean" else 0
            members[i] += members[j]
            for values in (centres, energies, areas, members):
                del values[j]
    order = sorted(range(len(members)), key=lambda k: min(members[k]))
    label = np.empty(len(sites), int)
    for number, k in enumerate(order):
        label[members[k]] = number
    return Clusters(label, np.array([centres[k] for k in order]))


def assert_same(found, expected, exactly=False):
    assert found.label.tolist() == expected.label.tolist()
    if exactly:
        assert (found.centres == expected.centres).all()
    assert found.centres == pytest.approx(expected.centres, abs=1e-12)


@pytest.mark.parametrize("frequency", FREQUENCIES)
@pytest.mark.parametrize("seed", range(12))
def test_it_merges_what_comparing_all_pairs_merges(frequency, seed):
    rng = np.random.default_rng(seed)
    sites, energy, area = samples(rng, int(rng.integers(10, 22)), [1.0, 0.1][seed % 2])
    if seed % 3 == 0:
        energy[rng.random(len(energy)) < 0.4] = 0
    if seed % 4 == 0:
        sites[1], sites[3], area[5] = sites[0], -sites[2], 0
        energy[5] = 0
    arguments = (
        sites,
        energy,
        area,
        frequency,
        [0, 0.1, 0.4][seed % 3],
        [None, 1, 4][seed % 4 % 3],
    )
    assert_same(merge(*arguments), all_pairs(*arguments))


@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_larger_sets_than_a_tree_finds_at_once(frequency):
    arguments = (*samples(np.random.default_rng(5), 60), frequency, 0.05, 5)
    assert_same(merge(*arguments), all_pairs(*arguments))


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from(FREQUENCIES), st.sampled_from([None, 1, 7]))
def test_the_order_of_samples_does_not_matter(seed, frequency, down_to):
    rng = np.random.default_rng(seed)
    sites, energy, area = samples(rng, 40)
    # Many ties: a grid, equal and no energies, and equal samples.
    sites = np.round(sites * 2)
    sites[:, 2] += 0.1
    sites /= np.linalg.norm(sites, axis=1)[:, None]
    energy, area = np.floor(energy), np.ones(40)
    order = rng.permutation(40)
    straight = merge(sites, energy, area, frequency, 0.3, down_to)
    shuffled = merge(sites[order], energy[order], area[order], frequency, 0.3, down_to)
    pairs = set(zip(straight.label[order].tolist(), shuffled.label.tolist(), strict=True))
    # Equal samples may change places among each other, so clusters are compared as a set.
    if len(np.unique(np.column_stack([sites, energy]), axis=0)) == 40:
        assert len(pairs) == len(straight.centres)
    assert sorted(straight.centres.tolist()) == sorted(shuffled.centres.tolist())


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from(FREQUENCIES), st.integers(-40, 40))
def test_brightness_does_not_matter(seed, frequency, power):
    sites, energy, area = samples(np.random.default_rng(seed), 30)
    dim = merge(sites, energy, area, frequency, 0.2, 6)
    bright = merge(sites, energy * 2.0**power, area, frequency, 0.2, 6)
    assert_same(bright, dim, exactly=True)
    # With other factors all costs are rounded anew, which is the same for samples in general.
    assert_same(merge(sites, energy * 3.7, area, frequency, 0.2, 6), dim)


def test_clusters_are_numbered_by_their_first_samples():
    sites = np.array([direction(a, 0) for a in (80, 0, 81, 1, 40)])
    found = merge(sites, np.ones(5), np.ones(5), "one", np.radians(2))
    assert found.label.tolist() == [0, 1, 0, 1, 2]
    expected = [direction(a, 0) for a in (80.5, 0.5, 40)]
    assert found.centres == pytest.approx(np.array(expected), abs=1e-12)


@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_without_a_distance_nothing_merges_not_even_equals(frequency):
    sites = np.array([direction(10, 20)] * 3 + [direction(50, 60)])
    found = merge(sites, np.ones(4), np.ones(4), frequency, 0.0)
    assert found.label.tolist() == [0, 1, 2, 3]
    assert (found.centres == sites).all()
    assert merge(sites, np.ones(4), np.ones(4), frequency, 1e-9).label.tolist() == [0, 0, 0, 1]


def test_no_two_centres_are_left_nearer_than_asked():
    sites, energy, area = samples(np.random.default_rng(3), 1000)
    for frequency in FREQUENCIES:
        found = merge(sites, energy, area, frequency, 0.1)
        apart = angle_between(found.centres[:, None], found.centres[None])
        assert apart[~np.eye(len(apart), dtype=bool)].min() >= 0.1
        assert len(found.centres) == found.label.max() + 1 < 1000


@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_it_goes_down_to_one_and_not_over_right_angles(frequency):
    sites, energy, area = samples(np.random.default_rng(2), 100, 0.1)
    for down_to in (1, 2, 50, 100, 1000):
        found = merge(sites, energy, area, frequency, 0, down_to)
        assert len(found.centres) == min(down_to, 100)
    poles = np.array([[0, 0, 1.0], [0, 0, -1.0]])
    both = merge(poles, np.ones(2), np.ones(2), frequency, np.pi, 1)
    assert both.label.tolist() == [0, 1]
    corner = merge(np.eye(3)[:2], np.ones(2), np.ones(2), frequency, 0, 1)
    assert corner.centres == pytest.approx(np.array([[np.sqrt(0.5), np.sqrt(0.5), 0]]))


@pytest.mark.parametrize("frequency", ["energy", "mean"])
def test_samples_without_light_join_the_nearest_and_do_not_move_it(frequency):
    sites = np.array([direction(a, 0) for a in (0, 30, 31, 75)])
    energy = np.array([5.0, 0, 0, 1])
    found = merge(sites, energy, np.ones(4), frequency, 0, 2)
    assert found.label.tolist() == [0, 0, 0, 1]
    if frequency == "energy":
        assert (found.centres == sites[[0, 3]]).all()
    dark = merge(sites[:3], np.zeros(3), np.zeros(3), frequency, 0, 2)
    assert dark.label.tolist() == [0, 1, 1]
    assert dark.centres[1] == pytest.approx(direction(30.5, 0))


def test_the_mean_radiance_is_not_additive():
    """A large dim cell and a small bright one: the paper's third F pulls to the bright one."""
    sites = np.array([direction(0, 0), direction(10, 0)])
    energy, area = np.array([3.0, 1]), np.array([3.0, 0.1])
    azimuths = {
        f: np.degrees(np.arctan2(*merge(sites, energy, area, f, 0, 1).centres[0, 1::-1]))
        for f in FREQUENCIES
    }
    assert azimuths["one"] == pytest.approx(5)
    assert azimuths["energy"] == pytest.approx(2.5, rel=0.01)
    assert azimuths["mean"] == pytest.approx(10 * 10 / 11, rel=0.01)


@pytest.mark.parametrize("frequency", ["one", "energy"])
def test_additive_centres_are_the_means_of_their_samples(frequency):
    """In a small patch, where a sphere is a plane, whatever the order of the merges was."""
    sites, energy, area = samples(np.random.default_rng(8), 500, 1e-5)
    found = merge(sites, energy, area, frequency, 0, 20)
    weight = np.ones(500) if frequency == "one" else energy
    sums = np.zeros((20, 3))
    np.add.at(sums, found.label, weight[:, None] * sites)
    means = sums / np.linalg.norm(sums, axis=1)[:, None]
    assert angle_between(found.centres, means).max() < 1e-13


def test_nothing_and_one_sample():
    none = merge(np.empty((0, 3)), np.empty(0), np.empty(0), "one", 0.1, 1)
    assert none.label.shape == (0,)
    assert none.centres.shape == (0, 3)
    one = merge(np.eye(3)[:1], np.zeros(1), np.zeros(1), "mean", 0.1, 1)
    assert one.label.tolist() == [0]


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_energy_that_is_no_energy_is_refused(bad):
    with pytest.raises(ValueError, match="energy"):
        merge(np.eye(3), np.array([1, bad, 1]), np.ones(3), "energy", 0.1)


def test_twenty_thousand_samples():
    """A fifth of them crowded, as around a sun."""
    rng = np.random.default_rng(1)
    sites, energy, area = samples(rng, 20_000)
    sites[:4_000] = [0, 0, 1] + 0.01 * sites[:4_000]
    sites /= np.linalg.norm(sites, axis=1)[:, None]
    found = merge(sites, energy, area, "energy", 2 * np.pi / 1024)
    assert 14_000 < len(found.centres) < 16_000
    assert len(np.unique(found.label)) == len(found.centres)


def test_a_reach_that_narrows_towards_the_poles():
    """Against all pairs, each of which counts where it is near at both its places."""
    random = np.random.default_rng(1)
    sites = random.normal(size=(40, 3))
    sites /= np.linalg.norm(sites, axis=1)[:, None]
    energy = random.random(40) ** 3
    found = merge(sites, energy, np.ones(40), "energy", 0.6, narrowed=sphere.pixel_narrowing)
    centres, weight, members = [*sites], [*energy], [[i] for i in range(40)]
    while True:
        costs = {
            (i, j): weight[i] * weight[j] / (weight[i] + weight[j]) * angle**2
            for i in range(len(centres))
            for j in range(i + 1, len(centres))
            if (angle := float(sphere.angle_between(centres[i], centres[j])))
            < 0.6 * min(np.hypot(*centres[i][:2]), np.hypot(*centres[j][:2]))
        }
        if not costs:
            break
        i, j = min(costs, key=costs.get)
        mean = weight[i] * centres[i] + weight[j] * centres[j]
        centres[i] = mean / np.linalg.norm(mean)
        weight[i] += weight[j]
        members[i] += members[j]
        del centres[j], weight[j], members[j]
    parts = [np.flatnonzero(found.label == k).tolist() for k in range(len(found.centres))]
    assert sorted(parts) == sorted(sorted(one) for one in members)
    assert 10 < len(parts) < 35
