"""Shadow edges against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.shadow_edges import cap_beyond, edges_across


def cap(to_centre: np.ndarray, half_angle: float, count: int = 200_000) -> np.ndarray:
    """Directions spread evenly over a cap."""
    index = np.arange(count) + 0.5
    along = 1 - index / count * (1 - np.cos(half_angle))
    turn = index * np.pi * (3 - np.sqrt(5))
    first, second = sphere.tangents(to_centre)
    aside = np.sqrt(1 - along**2)
    return (
        along[:, None] * to_centre
        + (aside * np.cos(turn))[:, None] * first
        + (aside * np.sin(turn))[:, None] * second
    )


@pytest.mark.parametrize("half_angle", [0.01, 0.049, 0.051, 0.3, 1.0, 1.5, np.pi / 2])
def test_part_of_a_cap_beyond_a_great_circle(half_angle):
    centre = np.array([0.6, 0.0, 0.8])
    first, _ = sphere.tangents(centre)
    directions = cap(centre, half_angle)
    for place in np.linspace(-1.2, 1.2, 9) * half_angle:
        normal = np.cos(place) * first + np.sin(place) * centre
        measured = np.mean(directions @ normal > 0)
        found = cap_beyond(np.array(normal @ centre), half_angle)
        assert found == pytest.approx(measured, abs=1e-3)


def test_a_point_is_seen_or_not():
    assert cap_beyond(np.array([-1e-6, 1e-6]), 0.0).tolist() == [0, 1]


def test_a_cap_and_its_rest_are_whole():
    height = np.linspace(-1, 1, 101)
    for half_angle in (0.02, 0.4, 1.57):
        both = cap_beyond(height, half_angle) + cap_beyond(-height, half_angle)
        assert both == pytest.approx(1, abs=1e-9)


def crossings(directions, half_width, owner, centres, turns=6, places=48):
    light = np.ones((len(directions), 1))
    owner = np.asarray(owner, np.intp)
    return edges_across(directions, half_width, light, owner, np.array(centres), turns, places)


def test_edges_stand_for_all_great_circles():
    """The mean over all great circles of what one lets through of a cap, squared."""
    centre = np.array([0.0, 0.6, 0.8])
    directions = cap(centre, 0.2, 3000)
    edges = crossings(directions, np.full(3000, 1e-3), np.zeros(3000), [centre])
    # All edges that pass within reach of the cap, out of all.
    reach = 0.2 + 0.03 * 0.4 + 0.004
    assert edges.part.sum() == pytest.approx(np.sin(reach), rel=0.01)
    seen = cap_beyond(edges.height[0], 0.2)
    assert edges.beyond[0, :, 0] / 3000 == pytest.approx(seen, abs=0.01)
    unseen = seen * (1 - seen)
    random = np.random.default_rng(1).normal(size=(400_000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    part = cap_beyond(random @ centre, 0.2)
    assert unseen @ edges.part[0] == pytest.approx(np.mean(part * (1 - part)), rel=0.02)


def test_a_piece_that_an_edge_crosses_is_let_through_in_part():
    piece, half_width = np.array([[1.0, 0, 0]]), 0.01
    edges = crossings(piece, np.array([half_width]), [0], piece)
    expected = np.clip(edges.height[0] / (2 * half_width) + 0.5, 0, 1)
    assert np.mean((expected > 0.1) & (expected < 0.9)) > 0.4
    assert edges.beyond[0, :, 0] == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("spread", [0.02, 0.5, 3.0])
def test_light_beyond_edges_is_as_if_each_piece_were_looked_at(spread):
    """Two cells, of pieces all around them where they are wide, behind the observer too."""
    random = np.random.default_rng(3)
    centres = np.array([[0.6, 0, 0.8], [0, -0.8, -0.6]])
    owner = np.repeat([0, 1], [400, 700])
    directions = centres[owner] + spread * random.normal(size=(1100, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    half_width = np.full(1100, 0.02 * min(spread, 1))
    turns, places = 4, 24
    edges = crossings(directions, half_width, owner, centres, turns, places)
    for cell, centre in enumerate(centres):
        first, second = sphere.tangents(centre)
        turn = np.repeat(np.arange(turns) * np.pi / turns, places)[:, None]
        angle = np.arcsin(-edges.height[cell])[:, None]
        across = np.cos(turn) * first + np.sin(turn) * second
        normals = np.cos(angle) * across - np.sin(angle) * centre
        mine = directions[owner == cell]
        seen = np.clip(mine @ normals.T / (2 * half_width[0]) + 0.5, 0, 1).sum(axis=0)
        wrong = (edges.beyond[cell, :, 0] - seen) / len(mine)
        # Strips begin and end at the nearest step: half of one holds about a hundredth.
        assert np.abs(wrong).max() < 0.015
        assert np.sqrt(np.mean(wrong**2)) < 0.003
