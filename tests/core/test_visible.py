"""What of a map is visible, and suns for that alone."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.conversion import convert
from sunsplit.core.sampling import choose_sampling, contrast
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.tolerances import ACCOUNT
from sunsplit.core.visible import ROWS, Looks, VisiblePart, visible_part
from tests.maps import direction, environment, paint_disc, sky

UP, DOWN = direction(40, 35), direction(-100, -40)


def two_suns(below=900.0):
    pixels = sky(256, 0.3)
    paint_disc(pixels, UP, 2, (900, 800, 700))
    paint_disc(pixels, DOWN, 2, below)
    return environment(pixels)


def directions_above(count, seed=0):
    found = np.random.default_rng(seed).normal(size=(count, 3))
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    found[:, 2] = abs(found[:, 2])
    return found


def looks_from_ground(places=2000, reaches=lambda towards, count: towards[2] > 0):
    return Looks(directions_above(3000), 3000, places, reaches)


def test_on_the_ground_a_sun_below_is_not_visible():
    mask = visible_part(two_suns(), looks_from_ground()).pixels(256, 128)
    assert mask[:64].all()
    around = sphere.angle_between(sphere.pixel_centres(np.arange(mask.size), 256, 128), DOWN)
    assert not mask.ravel()[around < np.radians(2)].any()
    assert mask.ravel()[around > np.radians(25)].all()


def test_what_is_faint_may_reach_nothing():
    assert visible_part(environment(sky(256, 0.3)), looks_from_ground()) is None


@pytest.mark.parametrize(("width", "height"), [(256, 128), (50, 25), (8, 4)])
def test_pixels_lie_in_the_cells_of_their_directions(width, height):
    cells = np.random.default_rng(1).random((ROWS, 2 * ROWS)) < 0.5
    mask = VisiblePart(cells).pixels(width, height)
    rows, columns = np.indices(mask.shape)
    assert (mask == cells[rows * ROWS // height, columns * 2 * ROWS // width]).all()


def test_all_around_and_nothing_are_not_told():
    looks = looks_from_ground()
    around = np.concatenate([looks.escaped, -looks.escaped])
    assert visible_part(two_suns(), Looks(around, 6000, 2000, looks.reaches)) is None
    assert visible_part(two_suns(), Looks(np.empty((0, 3)), 6000, 2000, looks.reaches)) is None


def test_a_light_that_looks_missed_is_asked_for():
    asked = []

    def reaches(towards, count):
        asked.append(towards)
        return towards[2] > 0 or towards @ DOWN > 0.9

    assert visible_part(two_suns(), looks_from_ground(reaches=reaches)) is None
    assert max(towards @ DOWN for towards in asked) > 0.99


def test_a_light_too_bright_for_so_few_places_is_taken_as_visible():
    def never(towards, count):
        return False

    pixel = sphere.pixels_at(DOWN[None], 256, 128)
    for places, visible in ((50, True), (100_000, False)):
        found = visible_part(two_suns(), looks_from_ground(places, never))
        assert (found is None or found.pixels(256, 128).ravel()[pixel].all()) == visible


def test_suns_for_what_is_visible_and_all_light_in_the_account():
    world = two_suns()
    found = visible_part(world, looks_from_ground())
    conversion, whole = convert(world, visible=found), convert(world)
    assert min(sun.to_light[2] for sun in whole.suns) < 0
    assert min(sun.to_light[2] for sun in conversion.suns) > 0
    assert conversion.account.relative_error.max() <= ACCOUNT
    assert whole.invisible_part == 0
    lum, solid = world.luminance, sphere.row_solid_angles(256, 128)
    seen = (found.of(lum).sum(axis=1) @ solid) / (lum.sum(axis=1) @ solid)
    assert conversion.invisible_part == pytest.approx(1 - seen, rel=1e-9)
    assert 0.3 < conversion.invisible_part < 0.4
    # What reaches nothing stays as it was.
    assert (conversion.residual[96:] == world.radiance[96:]).all()


@pytest.mark.parametrize("settings", [{"share": 0.5}, {"target": "eevee"}])
def test_a_share_or_a_target_that_wants_the_whole_map_gets_it(settings):
    world = two_suns()
    found = visible_part(world, looks_from_ground())
    conversion = convert(world, ConversionSettings(**settings), visible=found)
    assert conversion.visible is None
    assert min(sun.to_light[2] for sun in conversion.suns) < 0


def test_what_is_not_visible_makes_no_noise():
    world = two_suns()
    found = visible_part(world, looks_from_ground())
    residual = convert(world, visible=found).residual
    assert contrast(residual, found)[0] == pytest.approx(1, abs=0.02)
    assert choose_sampling(residual, 0.5, visible=found).method == "NONE"
    assert choose_sampling(residual, 0.5).method != "NONE"
