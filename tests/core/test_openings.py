"""Openings of boxes with holes in their walls, whose rays are known in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sunsplit.core.openings import Inside, Opening, are_inside, find_openings, part_seen
from sunsplit.core.portal_noise import (
    LightInside,
    mean_square_told,
    mean_square_untold,
    openings_pay,
    square_through,
    told_at_its_best,
    untold_at_its_best,
)

SIZE = np.array([4.0, 6.0, 3.0])
LOOKS = 3


@dataclass(frozen=True)
class Hole:
    """In the wall across an axis, at its lower or upper end: a rectangle in the two other axes."""

    axis: int
    upper: bool
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def corners(self) -> np.ndarray:
        """(2, 3): opposite ones."""
        others = [k for k in range(3) if k != self.axis]
        corners = np.full((2, 3), SIZE[self.axis] if self.upper else 0.0)
        corners[0, others], corners[1, others] = self.low, self.high
        return corners


def meet(holes, starts, directions):
    """Where rays from inside leave the box, (n, 3), the inward normals there, and whether that is
    through a hole."""
    with np.errstate(divide="ignore"):
        ends = np.where(directions > 0, (SIZE - starts) / directions, -starts / directions)
    axis = np.argmin(ends, axis=1)
    rows = np.arange(len(starts))
    points = starts + ends[rows, axis, None] * directions
    upper = directions[rows, axis] > 0
    normals = np.zeros_like(points)
    normals[rows, axis] = np.where(upper, -1, 1)
    out = np.zeros(len(starts), bool)
    for hole in holes:
        low, high = hole.corners
        within = ((points >= low - 1e-9) & (points <= high + 1e-9)).all(axis=1)
        out |= within & (axis == hole.axis) & (upper == hole.upper)
    return points, normals, out


def look_around(holes, turn=None, count=1500, seed=0):
    """Looks from everywhere on the walls of a box with holes, in turned axes."""
    random = np.random.default_rng(seed)
    turn = Rotation.identity() if turn is None else turn
    towards = random.normal(size=(4 * count, 3))
    places, normals, out = meet(holes, np.tile(SIZE / 2, (4 * count, 1)), towards)
    places, normals = places[~out][:count], normals[~out][:count]
    directions = random.normal(size=(count, LOOKS, 3))
    directions *= np.sign(np.einsum("pld,pd->pl", directions, normals))[..., None]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    starts = np.repeat(places + 1e-6 * normals, LOOKS, axis=0)
    directions = directions.reshape(-1, 3)
    points, facing, out = meet(holes, starts, directions)

    def are_open(starts, directions):
        return meet(holes, turn.inv().apply(starts), turn.inv().apply(directions))[2]

    return Inside(
        turn.apply(places + 1e-6 * normals),
        LOOKS,
        turn.apply(directions[out]),
        np.flatnonzero(out) // LOOKS,
        turn.apply(points[~out]),
        turn.apply(facing[~out]),
        are_open,
    )


def covers(opening, hole, turn=None):
    """How much of a hole an opening covers, and the area of both in that of the hole."""
    turn = Rotation.identity() if turn is None else turn
    low, high = hole.corners
    where = np.random.default_rng(1).random((2000, 3))
    points = turn.apply(low + where * (high - low)) - opening.centre
    assert np.abs(points @ opening.inwards).max() < 0.01
    within = np.abs(points @ opening.across) <= opening.width / 2
    within &= np.abs(points @ opening.up) <= opening.height / 2
    return within.mean(), opening.width * opening.height / np.prod(np.delete(high - low, hole.axis))


WINDOW = Hole(0, True, (2.0, 1.0), (3.5, 2.2))


def test_a_window_is_found_with_its_edges():
    (found,) = find_openings(look_around([WINDOW]))
    covered, size = covers(found, WINDOW)
    assert covered > 0.95
    assert size < 1.05
    np.testing.assert_allclose(found.inwards, [-1, 0, 0], atol=1e-6)
    frame = np.stack([found.across, found.up, found.inwards])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-6)


@settings(max_examples=15, deadline=None)
@given(
    axis=st.sampled_from([0, 1, 2]),
    upper=st.booleans(),
    left=st.floats(0.05, 0.5),
    width=st.floats(0.2, 0.45),
    bottom=st.floats(0.05, 0.5),
    height=st.floats(0.2, 0.45),
    seed=st.integers(0, 99),
)
def test_any_window_of_any_turned_room_is_found(axis, upper, left, width, bottom, height, seed):
    sides = np.delete(SIZE, axis)
    low = sides * (left, bottom)
    hole = Hole(axis, upper, tuple(low), tuple(low + sides * (width, height)))
    turn = Rotation.random(random_state=seed)
    (found,) = find_openings(look_around([hole], turn, count=3000, seed=seed))
    covered, size = covers(found, hole, turn)
    assert covered > 0.9
    assert size < 1.15


def test_two_windows_in_one_wall_and_a_skylight_are_three():
    second = Hole(0, True, (0.4, 1.0), (1.4, 2.2))
    skylight = Hole(2, True, (1.0, 4.0), (2.0, 5.0))
    holes = [WINDOW, second, skylight]
    found = find_openings(look_around(holes, count=4000))
    assert len(found) == 3
    for hole in holes:
        middle = hole.corners.mean(axis=0)
        nearest = min(found, key=lambda one, to=middle: np.linalg.norm(one.centre - to))
        covered, size = covers(nearest, hole)
        assert covered > 0.9
        assert size < 1.15


def test_a_missing_wall_is_an_opening():
    small_side = Hole(1, False, (0.0, 0.0), (SIZE[0], SIZE[2]))
    (found,) = find_openings(look_around([small_side]))
    covered, size = covers(found, small_side)
    assert covered > 0.9
    assert size < 1.1


def test_an_open_scene_has_none():
    roof = Hole(2, True, (0.0, 0.0), (SIZE[0], SIZE[1]))
    assert find_openings(look_around([roof])) == ()


def test_a_closed_scene_and_one_with_a_crack_have_none():
    assert find_openings(look_around([])) == ()
    assert find_openings(look_around([Hole(0, True, (2.0, 1.0), (2.001, 2.0))])) == ()


def test_where_nothing_stops_light_there_are_none():
    """A glass ball before the map: half of the looks get out straight, the others are bent."""
    inside = look_around([WINDOW])
    nothing = np.empty((0, 3))
    assert find_openings(replace(inside, points=nothing, normals=nothing)) == ()


def test_uneven_walls_cost_no_more_than_even_ones():
    """Many surfaces of as many directions: a few of them are looked at."""
    inside = look_around([WINDOW])
    normals = np.random.default_rng(3).normal(size=(100_000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = np.random.default_rng(4).random((100_000, 3)) * SIZE
    seen = inside.thinned(300, 3000)
    assert len(replace(inside, points=points, normals=normals).thinned(300, 3000).points) <= 3000
    assert len(seen.places) == len(inside.places)


def test_a_garden_before_the_window_does_not_count():
    """What is outside is lit by all of the sky and explained by no opening."""
    inside = look_around([WINDOW], count=2000)
    random = np.random.default_rng(5)
    garden = np.column_stack(
        [random.uniform(4.5, 30, 500), random.uniform(-9, 9, 500), [0.0] * 500]
    )
    up = random.normal(size=(1500, 3))
    up[:, 2] = np.abs(up[:, 2])
    up /= np.linalg.norm(up, axis=1)[:, None]
    more = Inside(
        np.concatenate([inside.places, garden]),
        LOOKS,
        np.concatenate([inside.escaped, up]),
        np.concatenate([inside.started, 2000 + np.arange(1500) // LOOKS]),
        inside.points,
        inside.normals,
        inside.are_open,
    )
    (found,) = find_openings(more)
    covered, size = covers(found, WINDOW)
    assert covered > 0.9
    assert size < 1.1


def light(sky, suns, lit=0.02, out=0.02):
    """Places of which a part sees a sun of so much irradiance, and a part of the looks the sky."""
    looks, places = 3000, 1000
    facing = np.full((places, 1), suns)
    given = np.where(np.arange(places) < lit * places, suns, 0.0)[:, None]
    escaped = np.full(int(out * looks), sky)
    through = 5 * (np.pi * out * sky) ** 2
    return LightInside(
        escaped, np.full(len(escaped), 0.5), looks, through, facing, given, sky, facing.shape[1]
    )


def pays(inside):
    return openings_pay(inside, inside, has_table=False)


def test_openings_pay_where_the_sky_gives_the_light():
    assert pays(light(sky=1.0, suns=0.0))
    assert pays(light(sky=1.0, suns=1.0))


def test_openings_do_not_pay_where_the_suns_give_it_or_rays_find_the_sky():
    assert not pays(light(sky=0.05, suns=10.0))
    assert not pays(light(sky=1.0, suns=0.0, out=0.9))


def test_what_is_seldom_lit_but_strong_outside_is_drawn_by_lot_inside():
    """By its strength a sun that no place sees is drawn nearly always, and the sky hardly ever."""
    dazzling = light(sky=1.0, suns=100.0, lit=0.0)
    assert not told_at_its_best(dazzling).by_tree
    by_lot = replace(dazzling, by_tree=False)
    assert mean_square_told(by_lot) < 0.1 * mean_square_told(dazzling)
    of_use = light(sky=0.01, suns=100.0, lit=0.5)
    assert told_at_its_best(of_use).by_tree


def test_suns_of_which_few_give_the_light_are_drawn_by_strength():
    few = np.array([100.0, 1.0, 1.0, 1.0])
    alike = np.full(4, 25.0)
    for strengths, by_tree in ((few, True), (alike, False)):
        facing = np.tile(strengths, (100, 1))
        inside = LightInside(np.array([0.1]), np.array([0.5]), 1000, 0.1, facing, facing, 0.1, 4)
        assert untold_at_its_best(inside, has_table=False).by_tree == by_tree


def test_of_the_sky_alone_rays_find_its_square_by_how_rarely_they_get_out():
    rare, often = (light(1.0, 0.0, out=out) for out in (0.01, 0.1))
    ratio = mean_square_told(often) / mean_square_told(rare)
    assert ratio == pytest.approx(100)
    assert mean_square_untold(often, False) / mean_square_untold(rare, False) == pytest.approx(10)


def test_the_part_that_a_window_takes_of_the_half_sphere():
    """From the middle of the opposite wall it takes about 3.7 %; from all places half of that."""
    inside = look_around([WINDOW], count=4000)
    part = part_seen(inside, find_openings(inside))
    assert part == pytest.approx(len(inside.escaped) / (LOOKS * 4000), rel=0.03)


def test_what_lies_before_one_opening_may_be_behind_another():
    x, y, z = np.eye(3)
    east = Opening(np.array([2, 0, 1.5]), y, z, -x, 1.0, 1.0)
    west = Opening(np.array([-2, 0, 1.5]), y, z, x, 1.0, 1.0)
    places = np.array([[0, 0, 1.0], [5, 0, 1], [-5, 0, 1]])
    nothing = np.empty((0, 3))
    inside = Inside(places, 3, nothing, np.empty(0, np.intp), nothing, nothing, None)
    assert are_inside(inside, [east]).tolist() == [True, False, True]
    assert are_inside(inside, [east, west]).tolist() == [True, False, False]


def test_what_samples_through_openings_find():
    """Against directions over the whole sphere, of which few go through them."""
    x, y, z = np.eye(3)
    openings = (
        Opening(np.array([0, 2, 1.5]), x, z, -y, 1.5, 1.0),
        Opening(np.array([-2, 0, 1.0]), y, z, x, 0.5, 2.0),
        Opening(np.array([0, 0, 9.0]), x, y, z, 2.0, 2.0),  # all places are behind this one
    )
    random = np.random.default_rng(7)
    places = random.uniform([-1, -1, 0], [1.5, 1.5, 1], (6, 3))
    normals = random.normal(size=(6, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    away = random.normal(size=(400_000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)

    def radiance(directions):
        return 1.5 + directions[:, 2] + directions[:, 0]

    expected = 0.0
    for place, normal in zip(places, normals, strict=True):
        square = (radiance(away) * np.maximum(away @ normal, 0)) ** 2
        for opening in openings[:2]:
            out = opening.is_crossed(np.tile(place, (len(away), 1)), away)
            expected += 2 * (4 * np.pi) ** 2 * out.mean() * (square * out).mean() / len(places)
    found = square_through(openings, places, normals, radiance)
    assert found == pytest.approx(expected, rel=0.04)


def test_a_place_in_an_opening_gets_no_more_than_all_of_a_half_sphere():
    opening = Opening(np.zeros(3), *np.eye(3), 4.0, 4.0)
    places = np.random.default_rng(3).uniform([-2, -2, 1e-9], [2, 2, 0.3], (500, 3))
    places[:36, :2] = opening.points(6)[0][:, :2]  # straight before what is summed over
    towards = np.tile([0, 0, -1.0], (500, 1))
    found = [
        square_through((opening,), place[None], normal[None], lambda away: np.ones(len(away)))
        for place, normal in zip(places, towards, strict=True)
    ]
    assert max(found) <= 1.05 * (2 * np.pi) ** 2  # points beside the nearest add a little


def test_no_opening_lets_nothing_through():
    assert square_through((), np.zeros((1, 3)), np.eye(3)[:1], lambda away: away[:, 0]) == 0
