"""Cuts that are shared by all numbers of cells."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core.patches import patches_of
from sunsplit.core.placement.edge_cells import cells_of, squared_errors
from sunsplit.core.placement.edge_cuts import Cuts
from sunsplit.core.placement.edge_light import EdgeLight
from sunsplit.core.placement.edge_split import EdgeSplit, edge_split
from sunsplit.core.region import light_of_map
from tests.maps import direction, paint_disc, sky


def patches():
    random = np.random.default_rng(5)
    pixels = sky(256, (0.2, 0.3, 0.5)) * (0.5 + random.random((128, 256, 1)))
    for k in range(5):
        paint_disc(pixels, direction(70 * k, 12 * k - 20), 3 + k, (30, 20, 10))
    light = light_of_map(pixels.astype(np.float32))
    return patches_of(light, light.luminous_flux, 2000)


def cuts_of(some) -> Cuts:
    light = EdgeLight.of(some, "disc")
    return Cuts(light, squared_errors)


def test_cells_do_not_depend_on_what_was_asked_for_before():
    some = patches()
    at_once, bit_by_bit = cuts_of(some), cuts_of(some)
    at_once.grow(60)
    for count in (2, 19, 23, 40, 41, 60):
        bit_by_bit.grow(count)
        assert (bit_by_bit.owner(count) == at_once.owner(count)).all()
    split = EdgeSplit(some, "disc")
    after_many = [split.cells(count) for count in (30, 7)][-1]
    assert (after_many.owner == edge_split(patches(), 7, "disc").owner).all()


def test_a_smaller_number_of_cells_is_cut_into_the_larger_one():
    cuts = cuts_of(patches())
    cuts.grow(50)
    for fewer, more in ((1, 2), (6, 7), (20, 33), (33, 50)):
        small, large = cuts.owner(fewer), cuts.owner(more)
        assert sorted(set(small)) == list(range(fewer))
        assert sorted(set(large)) == list(range(more))
        # Each of the larger number lies in one of the smaller.
        assert len(set(zip(small.tolist(), large.tolist(), strict=True))) == more


def test_what_is_wrong_of_each_number_is_the_sum_over_its_cells():
    some = patches()
    light, cuts = EdgeLight.of(some, "disc"), cuts_of(some)
    cuts.grow(40)
    for count in (1, 5, 22, 40):
        owner = cuts.owner(count)
        order = np.argsort(owner, kind="stable")
        each = squared_errors(light, order, owner[order], count)
        assert cuts.wrong(np.array([count]))[0] == pytest.approx(each.sum(axis=0), rel=1e-9)


def test_moments_are_those_of_sums_over_patches():
    """Mean direction and shortfall by their definitions, against one product of sums."""
    some = patches()
    light, cuts = EdgeLight.of(some, "disc"), cuts_of(some)
    cuts.grow(12)
    cells = cells_of(light, cuts.owner(12))
    colours = np.array([1.0, 0.01, 1.2])
    for cell in range(12):
        mine = cells.owner == cell
        relative = light.relative[mine]
        weight = relative @ (colours * relative.sum(axis=0))
        vector = (weight * (1 - some.spread[mine])) @ some.directions[mine]
        assert cells.to_light[cell] == pytest.approx(vector / np.linalg.norm(vector), abs=1e-12)
        shortfall = 1 - np.linalg.norm(vector) / weight.sum()
        assert cells.shortfall[cell] == pytest.approx(shortfall, rel=1e-9)
        assert cells.flux[cell] == pytest.approx(some.flux[mine].sum(axis=0), rel=1e-12)
