"""What places in a room get through its openings, and suns that are chosen for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sunsplit.core import sphere
from sunsplit.core.conversion import convert
from sunsplit.core.environment import luminance
from sunsplit.core.indoors import BOUNCED, Indoors
from sunsplit.core.openings import Opening
from sunsplit.core.patches import patches_of
from sunsplit.core.placement.choice import MOST_INDOORS
from sunsplit.core.prediction import Prediction
from sunsplit.core.region import light_of_map
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.tolerances import ACCOUNT
from sunsplit.core.visible import ROWS, VisiblePart, light_of_cells, to_indoors
from tests.maps import direction, environment, paint_disc, sky

X, Y, Z = np.eye(3)
WINDOW = Opening(np.array([2.0, 0, 1.4]), Y, Z, -X, 1.2, 1.0)
SKYLIGHT = Opening(np.array([0.0, 0.5, 2.6]), X, Y, -Z, 0.6, 0.8)
NO_LIGHT = np.zeros(8)
OPENINGS = {"window": (WINDOW,), "both": (WINDOW, SKYLIGHT)}


def turn(angle):
    return np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )


def floor(side=20, openings=(WINDOW,), light=NO_LIGHT):
    """Places all over a floor, 4 by 4."""
    at = ((np.arange(side) + 0.5) / side - 0.5) * 4
    x, y = (axis.ravel() for axis in np.meshgrid(at, at))
    places = np.stack([x, y, np.zeros_like(x)], axis=-1)
    return Indoors(places, np.tile(Z, (len(places), 1)), openings, light)


def in_disc(centre, diameter, count, seed):
    """Directions all over a disc, (count, 3)."""
    random = np.random.default_rng(seed)
    along = 1 - random.random(count) * (1 - np.cos(diameter / 2))
    aside = np.sqrt(1 - along**2) * np.exp(2j * np.pi * random.random(count))
    first = np.cross(centre, [0.1, 0.2, -0.97])
    first /= np.linalg.norm(first)
    second = np.cross(centre, first)
    return along[:, None] * centre + aside.real[:, None] * first + aside.imag[:, None] * second


def crossing(indoors, directions):
    """Mean irradiance of each place by light of 1 from all of these, ray by ray."""
    found = []
    for place, normal in zip(indoors.places, indoors.normals, strict=True):
        starts = np.tile(place, (len(directions), 1))
        out = [opening.is_crossed(starts, directions) for opening in indoors.openings]
        found.append((np.any(out, axis=0) * np.maximum(directions @ normal, 0)).mean())
    return np.array(found)


@pytest.mark.parametrize("openings", OPENINGS)
@pytest.mark.parametrize("size", [1, 12, 40])
def test_light_through_openings_is_what_rays_bring(openings, size):
    indoors = floor(12, OPENINGS[openings])
    directions = in_disc(direction(5, 50), np.radians(size), 2000, seed=3)
    half = np.full(2000, 1e-4)
    given = indoors.irradiance(directions, np.full(2000, 1 / 2000), half)
    expected = crossing(indoors, directions)
    assert expected.max() > 0.3
    assert given.mean() == pytest.approx(expected.mean(), rel=0.02)
    # Edges are a little softer than rays show them.
    assert np.sqrt(np.mean((given - expected) ** 2)) < 0.06 * expected.max()


def test_a_wide_piece_of_light_blurs_the_edges_as_wide_as_it_is():
    indoors = floor()
    centre, width = direction(0, 40), np.radians(8)
    one = indoors.irradiance(centre[None], np.ones(1), np.array([width / 2]))
    disc = crossing(indoors, in_disc(centre, width, 2000, seed=5))
    assert one.mean() == pytest.approx(disc.mean(), rel=0.05)
    assert np.sqrt(np.mean((one - disc) ** 2)) < 0.06 * disc.max()


def test_of_light_wider_than_the_opening_no_more_comes_in_than_has_room():
    slit = Opening(np.array([2.0, 0, 1.4]), Y, Z, -X, 0.2, 0.3)
    indoors = floor(40, (slit,))
    centre, width = direction(0, 40), np.radians(12)
    one = indoors.irradiance(centre[None], np.ones(1), np.array([width / 2]))
    disc = crossing(indoors, in_disc(centre, width, 4000, seed=5))
    assert one.mean() == pytest.approx(disc.mean(), rel=0.3)  # a square's corners, and a slope


def test_light_from_behind_or_beside_does_not_come_in():
    away = np.array([-X, direction(180, 30), -Z, direction(90, 2)])
    assert not floor().irradiance(away, np.ones(4), np.full(4, 0.01)).any()


def test_places_outside_get_nothing_through_an_opening():
    before = replace(floor(), places=floor().places + 10 * X)
    assert not before.irradiance(X[None], np.ones(1), np.full(1, 0.01)).any()


def test_all_is_the_same_in_other_axes():
    around, indoors = turn(0.7), floor(8, OPENINGS["both"])
    turned = Indoors(
        indoors.places @ around.T,
        indoors.normals @ around.T,
        tuple(one.turned(around) for one in indoors.openings),
        NO_LIGHT,
    )
    directions = in_disc(direction(5, 50), 0.5, 50, seed=1)
    pieces = np.ones(50), np.full(50, 0.05)
    given = indoors.irradiance(directions, *pieces)
    assert turned.irradiance(directions @ around.T, *pieces) == pytest.approx(given)
    assert turned.key != indoors.key
    assert floor(8, OPENINGS["both"]).key == indoors.key


def test_the_mean_of_a_whole_map_counts_what_is_known_of_it_once():
    """An even sky with a bright disc, of which some light is given."""
    pixels = sky(256, 1.0)
    paint_disc(pixels, direction(0, 40), 6, (300, 300, 300))
    found = environment(pixels)
    indoors = floor(8, light=light_of_cells(found))
    all_light = light_of_map(found.radiance)
    whole = indoors.irradiance(
        all_light.directions(), all_light.luminous_flux, np.full(len(all_light.pixels), 0.01)
    ).mean()
    bright = all_light.part(luminance(found.radiance).ravel() > 2)
    given = bright.directions(), bright.luminous_flux
    known = indoors.irradiance(*given, np.full(len(bright.pixels), 0.01))
    assert known.mean() > 0.5 * whole
    assert indoors.mean_irradiance(*given, known) == pytest.approx(whole, rel=0.02)


def odd_light():
    """Four bright panes, that one wide disc would be wrong of by far."""
    pixels = sky(512, 0.05)
    for azimuth, elevation in ((-12, 28), (12, 28), (-9, 46), (14, 50)):
        paint_disc(pixels, direction(azimuth, elevation), 7, (40, 38, 35))
    return environment(pixels)


def test_suns_are_right_where_light_comes_in():
    found = odd_light()
    indoors = floor(24, light=light_of_cells(found))
    conversion = convert(found, visible=to_indoors(None, indoors))
    assert conversion.is_indoors
    assert conversion.account.relative_error.max() < ACCOUNT
    assert 4 <= len(conversion.suns) < 20
    assert conversion.predicted_error < 0.01
    assert not conversion.ground_error
    assert conversion.standing_error is None
    # By other places, and by rays.
    random = np.random.default_rng(11)
    places = random.uniform([-2, -2, 0], [1.9, 2, 0], (300, 3))
    others = Indoors(places, np.tile(Z, (300, 1)), (WINDOW,), NO_LIGHT)
    flux = light_of_map(found.radiance - conversion.residual)
    truth = patches_of(flux, flux.luminous_flux)
    wanted = Prediction.indoors(truth, 1.0, replace(others, light=light_of_cells(found)))
    given = sum(
        luminance(sun.scalar_irradiance[None])[0]
        * crossing(others, in_disc(sun.to_light, sun.angular_diameter, 1000, seed=k))
        for k, sun in enumerate(conversion.suns)
    )
    wrong = np.sqrt(np.mean((given - wanted.irradiance) ** 2)) / wanted.mean
    # The tolerance, and half of it for what 300 places and 1,000 rays to each sun tell by chance.
    assert wrong < 1.5 * 0.01


def test_a_light_that_does_not_come_in_takes_no_more_than_one_sun():
    found = odd_light()
    behind = Opening(np.array([-2.0, 0, 1.4]), -Y, Z, X, 1.2, 1.0)
    indoors = floor(16, (behind,), light_of_cells(found))
    conversion = convert(found, visible=to_indoors(None, indoors))
    assert len(conversion.suns) <= 1


def test_a_sun_between_two_lights_that_do_not_come_in_is_no_wild_error():
    pixels = sky(256, 0.0)
    for azimuth in (100, -100):
        paint_disc(pixels, direction(azimuth, 20), 3, (50, 50, 50))
    found = environment(pixels)
    visible = to_indoors(None, floor(12, light=light_of_cells(found)))
    conversion = convert(found, ConversionSettings(lights=1), visible=visible)
    assert len(conversion.suns) == 1
    assert conversion.predicted_error < 10
    assert len(convert(found, visible=visible).suns) <= MOST_INDOORS


def test_a_light_that_is_known_not_to_reach_the_window_makes_none_bright():
    """A sun in the window's direction, but behind the house opposite."""
    pixels = odd_light().radiance.copy()
    paint_disc(pixels, direction(45, 15), 2, (30_000, 30_000, 30_000))
    found = environment(pixels)
    cells = np.ones((ROWS, 2 * ROWS), bool)
    cells.ravel()[sphere.pixels_at(direction(45, 15)[None], 2 * ROWS, ROWS)] = False
    visible = VisiblePart(cells)
    counts = []
    for counted in (None, visible):
        indoors = floor(16, light=light_of_cells(found, counted))
        suns = convert(found, visible=to_indoors(visible, indoors)).suns
        counts.append(len(suns))
    assert counts[0] < counts[1]
    assert 4 <= counts[1] < 20


@pytest.mark.parametrize("chosen", [{"share": 0.5}, {"lights": 3}, {"tolerance": 4.0}])
def test_what_the_user_asks_for_is_judged_indoors_too(chosen):
    found = odd_light()
    visible = to_indoors(None, floor(16, light=light_of_cells(found)))
    conversion = convert(found, ConversionSettings(**chosen), visible=visible)
    assert conversion.is_indoors
    assert len(conversion.suns) <= chosen.get("lights", 256)
    assert conversion.predicted_error <= chosen.get("tolerance", 100) / 100


def test_no_target_but_cycles_is_judged_indoors():
    found = odd_light()
    visible = to_indoors(None, floor(8, light=light_of_cells(found)))
    for target in ("eevee", "export"):
        conversion = convert(found, ConversionSettings(target=target), visible=visible)
        assert not conversion.is_indoors


def test_a_picture_of_a_room_is_brighter_than_what_falls_in():
    found = odd_light()
    indoors = floor(8, light=light_of_cells(found))
    some = light_of_map(found.radiance)
    patches = patches_of(some, some.luminous_flux)
    prediction = Prediction.indoors(patches, float(some.luminous_flux.sum()), indoors)
    assert prediction.mean == pytest.approx(BOUNCED * prediction.irradiance.mean(), rel=0.02)
    assert prediction.part == pytest.approx(1)
