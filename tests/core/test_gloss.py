"""What rough gloss mirrors of lights, and cells that are cut for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from sunsplit.core import sphere
from sunsplit.core.conversion import convert
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.gloss import Gloss
from sunsplit.core.patches import patches_of
from sunsplit.core.placement.edge import edge_suns
from sunsplit.core.placement.edge_light import EdgeLight
from sunsplit.core.placement.gloss_cuts import MOST_IN_GLOSS, cut_for_gloss, owners, shown_light
from sunsplit.core.placement.placement import ON_GLOSS
from sunsplit.core.region import light_of_map
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.suns import disc_sun
from sunsplit.core.tolerances import ACCOUNT
from sunsplit.core.visible import VisiblePart, in_gloss
from tests.maps import direction, environment, paint_disc, sky

UP = np.array([0.0, 0.0, 1.0])


def floor(azimuths, elevations, roughness=0.3, facing=0.04, rays=None):
    """Points of a level floor, each seen from where it mirrors one of these directions."""
    mirrored = np.array([direction(a, e) for a in azimuths for e in elevations])
    to_viewer = mirrored * (-1, -1, 1)
    count = len(mirrored)
    normals, rough = np.tile(UP, (count, 1)), np.full(count, roughness)
    return Gloss(to_viewer, normals, rough, np.full(count, facing), rays or count)


def all_around(width=512):
    """Pieces of light from everywhere, and their solid angles."""
    pixels = np.arange(width * width // 2)
    solid = sphere.row_solid_angles(width, width // 2)[pixels // width]
    return sphere.pixel_directions(pixels, width, width // 2), solid, np.sqrt(solid) / 2


@pytest.mark.parametrize("roughness", [0.25, 0.4, 0.6])
@pytest.mark.parametrize("elevation", [90, 45, 20])
def test_a_metal_reflects_what_its_facets_do_not_hide(roughness, elevation):
    """Against facets drawn by chance: of those that the viewer sees, each mirrors one direction,
    of whose light what the surface hides is lost."""
    gloss = floor([0], [elevation], roughness, facing=1.0)
    directions, solid, half = all_around()
    shown = float((gloss.shown(directions, half) @ solid)[0])
    random, alpha = np.random.default_rng(0), roughness**2
    viewer = gloss.to_viewer[0]
    slope = alpha * np.sqrt(1 / (1 - random.random(400_000)) - 1)
    turn = random.uniform(0, 2 * np.pi, len(slope))
    facets = np.stack([slope * np.cos(turn), slope * np.sin(turn), np.ones_like(slope)], axis=-1)
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    seen = facets @ viewer
    mirrored = 2 * seen[:, None] * facets - viewer

    def hides(cosine):
        cosine = np.maximum(cosine, 1e-3)
        return (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2

    weight = np.maximum(seen, 0) / (facets[:, 2] * viewer[2])
    weight *= (mirrored[:, 2] > 0) / (1 + hides(viewer[2]) + hides(mirrored[:, 2]))
    assert shown == pytest.approx(weight.mean(), rel=0.01)
    assert shown < 1.001


def test_what_is_faced_shows_less_of_what_is_grazed():
    """Schlick: 4 % where light is faced, all where it is grazed."""
    directions, solid, half = all_around()
    faced, grazed = (
        float((floor([0], [e], 0.25).shown(directions, half) @ solid)[0]) for e in (90, 3)
    )
    assert faced == pytest.approx(0.04, rel=0.02)
    assert grazed > 0.25


def test_a_light_behind_the_surface_is_not_shown():
    gloss = floor([0], [30])
    below = np.array([direction(0, -10)])
    assert not gloss.shown(below, np.array([0.01])).any()


@given(
    some.floats(0.25, 0.8),
    some.floats(5, 90),
    some.floats(0, 360),
    some.floats(-90, 90),
    some.floats(0, np.pi),
)
def test_any_disc_is_shown_as_a_number(roughness, elevation, azimuth, height, diameter):
    sun = disc_sun(np.ones(3), direction(azimuth, height), np.sin(diameter / 4) ** 2, 2)
    shown = floor([0, 70], [elevation], roughness).shown_of([sun])
    assert np.isfinite(shown).all()
    assert (shown >= 0).all()


def test_no_suns_show_nothing():
    assert not floor([0], [30]).shown_of([]).any()


def test_discs_of_pieces_show_what_their_light_does():
    """Few points for a disc against thousands."""
    gloss = floor(range(-30, 31, 10), (5, 15, 40), 0.3)
    for diameter in np.radians([1, 10, 40]):
        sun = disc_sun(np.ones(3), direction(3, 25), np.sin(diameter / 4) ** 2, 2)
        fine = sphere.spirals(
            sun.to_light[None], np.array([2 * np.sin(diameter / 4) ** 2]), np.array([20_000])
        )
        wanted = gloss.shown(fine, np.full(20_000, 1e-4)) @ np.full(20_000, 1 / 20_000)
        assert gloss.shown_of([sun]) == pytest.approx(wanted, rel=0.03, abs=0.02 * wanted.max())


@pytest.fixture(scope="module")
def windows():
    """Long windows above the horizon all around: each much wider than high."""
    pixels = sky(512, 0.2)
    for azimuth in range(0, 360, 60):
        columns = int((180 - azimuth) / 360 * 512) % 512
        pixels[96:118, columns : columns + 50] = (40, 44, 50)
    return environment(pixels)


def seen_through(gloss):
    return in_gloss(None, gloss)


LOOK = floor(np.arange(-25, 26, 2.5), (4, 8, 12, 18, 25, 35), 0.3, rays=250)
"""A floor that is half of a picture."""


def test_what_gloss_shows_is_made_true(windows):
    plain = convert(windows, ConversionSettings())
    found = convert(windows, ConversionSettings(), visible=seen_through(LOOK))
    assert plain.gloss_error is None
    before = LOOK.error(LOOK.shown_of(plain.suns) - wanted(windows, plain), plain.strata.light)
    print(f"{len(plain.suns)} suns wrong by {before:.2%}, {len(found.suns)} by {found.gloss_error}")
    assert before > 0.02
    assert found.gloss_error <= 0.01 * ON_GLOSS
    assert len(plain.suns) < len(found.suns) <= MOST_IN_GLOSS
    assert found.account.relative_error.max() < ACCOUNT
    assert found.predicted_error < 0.01
    assert not any("more than" in note for note in found.notes)


def wanted(env, conversion):
    """What the light that suns took shows, pixel by pixel."""
    light = light_of_map(env.radiance - conversion.residual)
    lit = light.part(light.luminous_flux > 1e-9)
    patches = patches_of(lit, lit.luminous_flux, 10**7)
    return shown_light(LOOK, patches).sum(axis=1)


def test_where_gloss_shows_little_nothing_changes(windows):
    plain = convert(windows, ConversionSettings())
    dull = replace(LOOK, rays=10_000 * LOOK.rays)
    found = convert(windows, ConversionSettings(), visible=seen_through(dull))
    assert [tuple(sun.to_light) for sun in found.suns] == [tuple(s.to_light) for s in plain.suns]
    assert found.gloss_error < 0.01


def test_only_what_is_seen_is_cut(windows):
    """Windows at the viewer's back stay as few suns as they were."""
    plain = convert(windows, ConversionSettings())
    found = convert(windows, ConversionSettings(), visible=seen_through(LOOK))

    def behind(suns):
        return sum(sun.to_light[0] < -0.3 for sun in suns)

    assert behind(found.suns) <= behind(plain.suns) + 2
    assert len(found.suns) - len(plain.suns) > 4


@pytest.mark.parametrize("lights", [6, 12, 30])
def test_no_more_suns_than_were_asked_for(windows, lights):
    settings = ConversionSettings(lights=lights, tolerance=1.0)
    found = convert(windows, settings, visible=seen_through(LOOK))
    assert len(found.suns) <= lights
    assert found.gloss_error is not None


@pytest.mark.parametrize(
    "settings",
    [
        ConversionSettings(method="kmeans", lights=8),
        ConversionSettings(shape="point", lights=8),
        ConversionSettings(target="eevee"),
    ],
)
def test_what_gloss_does_not_tell(windows, settings):
    found = convert(windows, settings, visible=seen_through(LOOK))
    assert found.gloss_error is None


def test_what_cannot_be_made_true_enough_is_said(windows):
    close = replace(LOOK, rays=len(LOOK.roughness), facing=np.full(len(LOOK.roughness), 0.6))
    found = convert(windows, ConversionSettings(), visible=seen_through(close))
    [note] = [note for note in found.notes if "rough gloss" in note]
    assert f"{100 * found.gloss_error:.2g} %" in note
    assert found.predicted_error < 0.01
    few = ConversionSettings(lights=8)
    found = convert(windows, few, visible=seen_through(close))
    assert not any("rough gloss" in note for note in found.notes)  # as many as were asked for


def test_a_faint_light_that_is_shown_true_is_not_complained_of():
    pixels = sky(512, 0.5)
    pixels[100:118, 200:300] = 3
    found = convert(environment(pixels), ConversionSettings(), visible=seen_through(LOOK))
    assert found.gloss_error is not None
    assert not any("more than" in note for note in found.notes)


def test_a_share_that_is_given_is_shown_as_true(windows):
    found = convert(windows, ConversionSettings(share=0.5), visible=seen_through(LOOK))
    assert found.gloss_error <= 0.01 * ON_GLOSS


def test_the_same_points_have_the_same_key():
    assert LOOK.key == replace(LOOK).key
    assert LOOK.key != replace(LOOK, roughness=LOOK.roughness + 0.1).key
    part = VisiblePart(np.ones((18, 36), bool))
    assert part.whole_key != in_gloss(part, LOOK).whole_key
    assert in_gloss(part, None) is part


def blobs(seed):
    random = np.random.default_rng(seed)
    pixels = sky(128, 0.0)
    for _ in range(4):
        where = direction(random.uniform(-40, 40), random.uniform(8, 40))
        paint_disc(pixels, where, random.uniform(6, 14), random.uniform(5, 20, 3))
    return environment(pixels)


@given(some.integers(0, 50), some.integers(2, 40))
def test_cuts_keep_all_light_and_get_no_worse(seed, most):
    env = blobs(seed)
    light = light_of_map(env.radiance).lit
    patches = patches_of(light, light.luminous_flux, 1024)
    parts, shown = EdgeLight.of(patches, "disc"), shown_light(LOOK, patches)
    total = float(light.luminous_flux.sum())
    begun = np.zeros(len(patches), np.intp)

    def error(owner):
        suns = []
        for cell in range(owner.max() + 1):
            mine = owner == cell
            flux = patches.flux[mine]
            weight = flux @ LUMINANCE_WEIGHTS * (1 - patches.spread[mine])
            vector = weight @ patches.directions[mine]
            length = np.linalg.norm(vector)
            short = max(1 - length / (flux @ LUMINANCE_WEIGHTS).sum(), 0)
            suns.append(disc_sun(flux.sum(axis=0), vector / length, short, 2))
        return LOOK.error(LOOK.shown_of(suns) - shown.sum(axis=1), total)

    owner = cut_for_gloss(parts, patches, begun, LOOK, shown, total, 0.01, most)
    cells = owner.max() + 1
    assert 1 <= cells <= most
    assert (np.bincount(owner) > 0).all()
    # Suns weigh colours a little otherwise than cuts do.
    assert error(owner) <= error(begun) * 1.1 + 0.002
    if cells == most:
        more = cut_for_gloss(parts, patches, begun, LOOK, shown, total, 0.01, most + 5)
        assert error(more) <= error(owner) * 1.1 + 0.002


def test_patches_know_the_suns_of_other_patches():
    env = blobs(3)
    light = light_of_map(env.radiance).lit
    strata = convert(env).strata
    coarse, fine = (patches_of(light, light.luminous_flux, most) for most in (64, 4096))
    chosen = edge_suns(coarse, strata, ConversionSettings(), 5)
    assert owners(chosen.taken, light, coarse).tolist() == chosen.taken.sun.tolist()
    owner = owners(chosen.taken, light, fine)
    for number, sun in enumerate(chosen.suns):
        flux = fine.flux[owner == number].sum(axis=0)
        assert flux == pytest.approx(sun.scalar_irradiance, rel=0.05)
