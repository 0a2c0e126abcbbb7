"""Shadow edges against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.shadow_edges import cap_beyond, edges_across, let_through


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


def test_edges_stand_for_all_great_circles():
    """The mean over all great circles of what one lets through of a cap, squared."""
    centre = np.array([0.0, 0.6, 0.8])
    directions = cap(centre, 0.2, 3000)
    normals, parts = edges_across(directions, np.ones(3000), centre, 6, 48)
    # All edges that pass within reach of the cap, out of all.
    reach = np.arcsin(np.sin(0.2)) + 0.03 * 0.4 + 0.004
    assert parts.sum() == pytest.approx(np.sin(reach), rel=0.01)
    seen = cap_beyond(normals @ centre, 0.2)
    unseen = seen * (1 - seen)
    random = np.random.default_rng(1).normal(size=(400_000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    part = cap_beyond(random @ centre, 0.2)
    assert unseen @ parts == pytest.approx(np.mean(part * (1 - part)), rel=0.02)


def test_a_piece_that_an_edge_crosses_is_let_through_in_part():
    piece = np.array([[1.0, 0, 0]])
    normals = np.array([[np.sin(a), np.cos(a), 0] for a in (-0.02, -0.005, 0, 0.005, 0.02)])
    seen = let_through(piece, np.array([0.01]), normals)[0]
    assert seen == pytest.approx([0, 0.25, 0.5, 0.75, 1], abs=1e-4)
