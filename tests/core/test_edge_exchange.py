"""Cells that move to where they are needed."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.patches import patches_of
from sunsplit.core.placement.edge_cells import cells_of, judged
from sunsplit.core.placement.edge_exchange import exchanged, filled
from sunsplit.core.placement.edge_light import EdgeLight
from sunsplit.core.region import light_of_map
from tests.maps import direction, sky

FIRST, SECOND = direction(20, 10), direction(160, 10)


@pytest.fixture(scope="module")
def light() -> EdgeLight:
    """Two grained bars of light, alike: no disc is like one."""
    pixels = sky(256, 0.0)
    for place in (FIRST, SECOND):
        row, column = np.divmod(sphere.pixels_at(place[None], 256, 128)[0], 256)
        pixels[row - 4 : row + 4, column - 14 : column + 14] = 1
    pixels *= 0.5 + np.random.default_rng(3).random((128, 256, 1))
    found = light_of_map(pixels.astype(np.float32))
    return EdgeLight.of(patches_of(found, found.luminous_flux), "disc")


def cut_badly(light: EdgeLight):
    """The first in eight parts, the second whole."""
    directions = light.directions
    in_second = directions @ SECOND > directions @ FIRST
    azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0]))
    eighth = np.clip((azimuth // 5).astype(int), 0, 7)
    return judged(light, cells_of(light, np.where(in_second, 8, eighth)))


def near(cells, place) -> int:
    return int((cells.to_light @ place > np.cos(np.radians(30))).sum())


def test_a_cell_goes_to_where_more_is_wrong(light):
    before = cut_badly(light)
    after = judged(light, exchanged(light, before, 9))
    assert (near(before, FIRST), near(before, SECOND)) == (8, 1)
    assert (near(after, FIRST), near(after, SECOND)) == (7, 2)
    assert after.error < 0.8 * before.error
    assert after.flux.sum(axis=0) == pytest.approx(before.flux.sum(axis=0), rel=1e-12)


def test_lost_cells_come_back(light):
    before = cut_badly(light)
    moved = judged(light, exchanged(light, before, 12))
    more = judged(light, filled(light, before, 12))
    assert len(moved.flux) == len(more.flux) == 12
    assert more.error < before.error


def test_a_single_patch_is_not_cut(light):
    owner = np.arange(len(light))
    cells = judged(light, cells_of(light, owner))
    assert len(filled(light, cells, len(owner) + 5).flux) == len(owner)
    assert len(exchanged(light, cells, len(owner)).flux) == len(owner)


def test_two_cells_have_none_to_give(light):
    directions = light.directions
    cells = judged(light, cells_of(light, (directions @ SECOND > directions @ FIRST).astype(int)))
    assert exchanged(light, cells, 2) is cells
