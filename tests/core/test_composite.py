"""The paper's composite system, whole: regions, lights, Voronoi maps, clustering."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import ConversionSettings, convert, load, save, sphere
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.errors import UnusableInput
from sunsplit.core.files import samples_json
from sunsplit.core.files.conversion import account_of_files
from sunsplit.core.tolerances import ACCOUNT, ACCOUNT_HALF
from sunsplit.core.voronoi import label_map
from tests.core.test_conversion import hdr_maps, unoccluded_error
from tests.maps import direction, environment, paint_disc, sky

METHODS = ["penrose", "median-cut", "variance", "kmeans"]


@st.composite
def choices(draw):
    return ConversionSettings(
        lights=draw(st.integers(1, 20)),
        share=draw(st.none() | st.floats(0, 1)),
        strata=draw(st.sampled_from([2, 4, 6])),
        method=draw(st.sampled_from(METHODS)),
        samples=draw(st.none() | st.integers(1, 60)),
        per_stratum=draw(st.booleans()),
        shape=draw(st.sampled_from(["disc", "point"])),
        position=draw(st.sampled_from(["centroid", "sample"])),
        frequency=draw(st.sampled_from(["one", "energy", "mean"])),
        residual=draw(st.sampled_from(["map", "voronoi"])),
        residual_samples=draw(st.integers(1, 50)),
        fill=draw(st.sampled_from([None, "surroundings", "black"])),
    )


@given(hdr_maps(), choices())
def test_the_account_closes_whatever_is_chosen(found, chosen):
    conversion = convert(found, chosen)
    assert conversion.account.relative_error.max() <= ACCOUNT
    assert len(conversion.suns) <= chosen.lights
    if 0 < len(conversion.suns) < chosen.lights:
        assert f"{len(conversion.suns)} of {chosen.lights} lights" in " ".join(conversion.notes)
    if chosen.share is not None and abs(conversion.strata.share - chosen.share) > 0.02:
        assert "was asked for" in conversion.notes[0]
    assert (conversion.residual is None) == (chosen.share == 1)
    if conversion.residual is not None:
        assert np.isfinite(conversion.residual).all()
        assert (conversion.residual >= 0).all()
    strengths = [sun.scalar_irradiance @ [0.2126, 0.7152, 0.0722] for sun in conversion.suns]
    assert strengths == sorted(strengths, reverse=True)
    for sun in conversion.suns:
        assert np.linalg.norm(sun.to_light) == pytest.approx(1, abs=1e-12)
        assert (sun.angular_diameter == 0) == (chosen.shape == "point")
        assert (sun.irradiance <= sun.scalar_irradiance).all()
        assert chosen.strata / 2 < sun.stratum <= chosen.strata or chosen.fill == "surroundings"


@given(hdr_maps(), choices(), st.integers(-6, 6))
def test_a_map_scaled_by_a_power_of_two_scales_to_the_bit(found, chosen, power):
    before = convert(found, chosen)
    after = convert(environment(found.radiance * np.float32(2.0**power)), chosen)
    assert len(after.suns) == len(before.suns)
    for old, new in zip(before.suns, after.suns, strict=True):
        assert (new.irradiance == old.irradiance * 2.0**power).all()
        assert (new.to_light == old.to_light).all()
    if chosen.share != 1:
        assert (after.residual == before.residual * np.float32(2.0**power)).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_the_share_goes_to_lights_and_the_rest_stays(sunrise, method, share):
    """X % to A, (100 - X) % to B (paper, section 3); on a real map as nearly as pixels allow."""
    conversion = convert(load(sunrise), ConversionSettings(share=share, lights=32, method=method))
    assert conversion.account.share == pytest.approx(conversion.strata.share, rel=1e-9)
    assert conversion.strata.share == pytest.approx(share, abs=0.12)
    assert not conversion.residual[conversion.strata.region_a].any()
    outside = ~conversion.strata.region_a
    assert (conversion.residual[outside] == conversion.environment.radiance[outside]).all()


@pytest.mark.parametrize("method", METHODS)
def test_all_lights_are_used_where_there_is_room(sunrise, method):
    chosen = ConversionSettings(share=1.0, lights=64, method=method, residual="none")
    conversion = convert(load(sunrise), chosen)
    assert len(conversion.suns) == 64
    assert conversion.account.relative_error.max() <= 1e-9
    # Whole maps as lights light plates as the map does.
    assert unoccluded_error(conversion.environment, conversion) < 0.05


def test_per_stratum_lights_stay_in_their_stratum():
    pixels = sky(128, 0.01)
    pixels += np.linspace(0, 0.05, 128)[None, :, None]
    paint_disc(pixels, direction(0, 0), 20, (1, 1, 1))
    paint_disc(pixels, direction(0, 0), 6, (9, 9, 9))
    chosen = ConversionSettings(
        share=0.8, strata=4, lights=20, method="penrose", per_stratum=True, frequency="one"
    )
    conversion = convert(environment(pixels), chosen)
    numbers = [sun.stratum for sun in conversion.suns]
    assert set(numbers) == {3, 4}
    for number in (3, 4):
        light = sum(s.scalar_irradiance[0] for s in conversion.suns if s.stratum == number)
        bounds = [-1, *conversion.strata.bounds, np.inf]
        lum = conversion.strata.luminance
        inside = (lum > bounds[number - 1]) & (lum <= bounds[number])
        solid = sphere.row_solid_angles(128, 64)[:, None]
        assert light == pytest.approx((lum * solid)[inside].sum(), rel=1e-6)


def test_fewer_lights_than_strata_are_placed_in_all_of_them(sunrise):
    chosen = ConversionSettings(share=0.95, strata=8, lights=2, method="kmeans", per_stratum=True)
    conversion = convert(load(sunrise), chosen)
    assert len(conversion.suns) == 2
    assert "strata" in " ".join(conversion.notes)
    assert conversion.account.relative_error.max() <= ACCOUNT


def test_at_the_sample_or_at_the_mean(sunrise):
    at = {
        position: convert(
            load(sunrise),
            ConversionSettings(method="penrose", share=1, lights=64, position=position),
        )
        for position in ("sample", "centroid")
    }
    apart = [
        np.degrees(sphere.angle_between(a.to_light, b.to_light))
        for a, b in zip(at["sample"].suns, at["centroid"].suns, strict=True)
    ]
    assert max(apart) > 1
    assert np.median(apart) < 15
    # The mean is the place that lights plates best: the reason why it is the default.
    errors = {key: plate_error(one) for key, one in at.items()}
    assert errors["centroid"] < 0.8 * errors["sample"]


def plate_error(conversion):
    """RMS error of a plate's irradiance over random normals, relative to the mean irradiance.

    The suns are taken as points, whatever their width: only where they stand counts.
    """
    found = conversion.environment
    pixels = np.arange(found.height * found.width)
    directions = sphere.pixel_directions(pixels, found.width, found.height)
    flux = found.radiance[..., 1].ravel() * np.repeat(
        sphere.row_solid_angles(found.width, found.height), found.width
    )
    normals = np.random.default_rng(0).normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    errors = []
    for normal in normals:
        given = sum(s.scalar_irradiance[1] * max(s.to_light @ normal, 0) for s in conversion.suns)
        errors.append(given - flux @ np.maximum(directions @ normal, 0))
    return np.sqrt(np.mean(np.square(errors))) / (flux.sum() / 4)


def test_points_give_all_their_light_and_discs_what_a_plate_gets(sunrise):
    chosen = {"method": "median-cut", "share": 1, "lights": 8}
    points = convert(load(sunrise), ConversionSettings(shape="point", **chosen)).suns
    discs = convert(load(sunrise), ConversionSettings(shape="disc", **chosen)).suns
    for point, disc in zip(points, discs, strict=True):
        assert point.angular_diameter == 0
        assert (point.irradiance == point.scalar_irradiance).all()
        half = disc.angular_diameter / 2
        assert disc.irradiance == pytest.approx(point.irradiance * (1 + np.cos(half)) / 2)


def test_samples_nearer_than_a_pixel_are_clustered(sunrise):
    """The paper's trouble: in a sun that holds most of the light, samples share pixels."""
    chosen = ConversionSettings(method="penrose", share=1, lights=64, samples=64)
    conversion = convert(load(sunrise), chosen)
    assert 10 < len(conversion.suns) < 50
    assert "clustered" in " ".join(conversion.notes)
    places = np.array([sun.to_light for sun in conversion.suns])
    apart = sphere.angle_between(places[:, None], places)[~np.eye(len(places), dtype=bool)]
    assert apart.min() > 0.9 * np.pi / 512


def test_clustering_down_to_the_lights(sunrise):
    few = ConversionSettings(method="penrose", share=1, lights=40, samples=400, residual="none")
    conversion = convert(load(sunrise), few)
    assert len(conversion.suns) == 40
    assert conversion.account.relative_error.max() <= 1e-9


def test_frequencies_cluster_differently(sunrise):
    found = load(sunrise)
    places = {
        frequency: convert(
            found,
            ConversionSettings(
                method="penrose", share=1, lights=40, samples=400, frequency=frequency
            ),
        )
        for frequency in ("one", "energy", "mean")
    }
    brightest = {key: one.suns[0].to_light.tolist() for key, one in places.items()}
    lights = {tuple(sorted(s.scalar_irradiance[1] for s in one.suns)) for one in places.values()}
    assert len(lights) == 3, brightest


@pytest.mark.parametrize("method", [*METHODS, "edge"])
def test_a_voronoi_map_shows_the_mean_of_its_cells(sunrise, method):
    found = load(sunrise)
    chosen = ConversionSettings(
        method=method, share=0.5, residual="voronoi", residual_samples=200, lights=8
    )
    conversion = convert(found, chosen)
    rest = convert(found, ConversionSettings(method=method, share=0.5, lights=8)).residual
    samples = conversion.samples
    assert 150 < len(samples.sites) <= 200
    assert (conversion.residual == samples.radiance).all()
    labels = label_map(samples.sites, found.width, found.height)
    solid = sphere.row_solid_angles(found.width, found.height)
    assert samples.area.sum() == pytest.approx(4 * np.pi)
    assert samples.flux.sum(axis=0) == pytest.approx(scalar_irradiance(rest), rel=1e-6)
    for cell in (0, 17, len(samples.sites) - 1):
        inside = labels == cell
        area = (inside * solid[:, None]).sum()
        flux = np.einsum("ijk,i,ij->k", rest, solid, inside)
        assert samples.area[cell] == pytest.approx(area)
        assert samples.flux[cell] == pytest.approx(flux, rel=1e-5)
        assert samples.radiance[inside] == pytest.approx(np.tile(flux / area, (inside.sum(), 1)))


def test_share_nought_makes_a_voronoi_map_of_the_whole_map(sunrise):
    chosen = ConversionSettings(share=0, residual="voronoi", residual_samples=500)
    conversion = convert(load(sunrise), chosen)
    assert conversion.suns == ()
    assert conversion.account.relative_error.max() <= ACCOUNT
    assert conversion.strata.share == 0
    assert not conversion.strata.region_a.any()


def test_a_map_without_a_rest_has_no_voronoi_map():
    found = environment(sky(32, 0.0) + np.eye(16, 32)[..., None])
    chosen = {"method": "kmeans", "residual": "voronoi", "lights": 40}
    conversion = convert(found, ConversionSettings(share=1, **chosen))
    assert conversion.residual is None
    assert conversion.samples is None
    # All that shines is one level of brightness, so nearly all is all, and the rest is black.
    conversion = convert(found, ConversionSettings(share=0.99, **chosen))
    assert not conversion.residual.any()
    assert "holds no light" in " ".join(conversion.notes)


@pytest.mark.parametrize("elevation", [1, 20, 45, 70, 87])
@pytest.mark.parametrize("method", METHODS)
def test_each_of_a_row_of_pixels_can_have_its_light(method, elevation):
    """Wherever they lie: near the poles pixels are narrow, but as good as others."""
    pixels = sky(256, 0.0)
    pixels[round((90 - elevation) / 180 * 128), 40:48] = 3
    for lights, made in ((8, 8), (30, 8), (5, 5)):
        chosen = ConversionSettings(method=method, share=1, lights=lights)
        conversion = convert(environment(pixels), chosen)
        assert len(conversion.suns) == made
    assert "only 8 pixels that shine" in " ".join(
        convert(environment(pixels), ConversionSettings(method=method, share=1, lights=9)).notes
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("lights", [3, 5, 8, 17])
def test_a_small_region_gives_as_many_lights_as_it_has_room_for(method, lights):
    """A sun of few pixels, one of which holds most of its light."""
    pixels = sky(512, 0.0)
    paint_disc(pixels, direction(10, 66), 2, (50, 40, 30))
    pixels[pixels[..., 0].argmax() // 512, pixels[..., 0].argmax() % 512] *= 30
    chosen = ConversionSettings(method=method, share=1, lights=lights)
    assert len(convert(environment(pixels), chosen).suns) == lights


def test_a_strong_sun_on_a_tiny_map_is_no_reason_to_wait():
    """A hundred thousand samples crowd into one pixel; this took half a minute once."""
    pixels = sky(32, 1.0)
    pixels[7, 9] = 1e5
    chosen = {"method": "penrose", "residual_samples": 500}
    whole = convert(environment(pixels), ConversionSettings(share=1, lights=400, **chosen))
    assert len(whole.suns) == 400
    cells = convert(environment(pixels), ConversionSettings(share=0, residual="voronoi", **chosen))
    assert len(cells.samples.sites) == 500


def test_a_share_that_cannot_be_is_named(sunrise):
    flat = environment(sky(32, 1.0))
    for share in (0.3, 0.6):
        for method in ("edge", "kmeans"):
            notes = convert(flat, ConversionSettings(share=share, method=method)).notes
            assert f"{share:.2%} was asked for" in notes[0]
            assert "needs no sun" not in " ".join(notes)


def test_edge_says_what_it_does_not_do(sunrise):
    notes = convert(load(sunrise), ConversionSettings(per_stratum=True)).notes
    assert "edge has none" in " ".join(notes)


def test_a_map_of_samples_is_written_and_read_again(sunrise, tmp_path):
    chosen = ConversionSettings(
        method="penrose", share=0.5, residual="voronoi", residual_samples=100, residual_width=512
    )
    conversion = convert(load(sunrise), chosen)
    files = save(conversion, tmp_path)
    assert files.samples == tmp_path / "spruit_sunrise_1k.samples.json"
    again = samples_json.read_samples(files.samples)
    assert (again.sites == conversion.samples.sites).all()
    assert (again.flux == conversion.samples.flux).all()
    assert (again.area == conversion.samples.area).all()
    assert again.radiance == pytest.approx(conversion.samples.radiance, rel=ACCOUNT_HALF)
    # What was written is enough to make the cells anew.
    labels = label_map(again.sites, 512, 256)
    assert (np.unique(labels) == np.arange(len(again.sites))).all()
    assert account_of_files(files.lights).relative_error.max() <= ACCOUNT_HALF


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"format": "sunsplit.samples", "version": 1, "samples": [], "map": {"file": 5}}', "dam"),
        ("{", "not readable JSON"),
        ("{}", "its format is missing"),
        ('{"format": "sunsplit.samples", "version": 9}', "version 9"),
        ('{"format": "sunsplit.samples", "version": 1, "samples": [{}]}', "damaged"),
    ],
)
def test_a_damaged_list_of_samples_is_refused(tmp_path, text, why):
    path = tmp_path / "sky.samples.json"
    with pytest.raises(UnusableInput, match="does not exist"):
        samples_json.read_samples(path)
    path.write_text(text)
    with pytest.raises(UnusableInput, match=why):
        samples_json.read_samples(path)


def test_a_list_of_samples_without_its_map_is_refused(sunrise, tmp_path):
    chosen = ConversionSettings(share=0, residual="voronoi", residual_samples=9)
    files = save(convert(load(sunrise), chosen), tmp_path)
    files.residual.unlink()
    with pytest.raises(UnusableInput, match="missing"):
        samples_json.read_samples(files.samples)
