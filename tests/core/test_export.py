"""From a conversion to what renderers are given: suns shared out, files written together."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import (
    ConversionSettings,
    ExportSettings,
    convert,
    export_conversion,
    load,
    read_skylight,
    save,
    skylight_of,
    sphere,
)
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.errors import CannotWrite, UnusableInput
from sunsplit.core.export.axes import Y_UP, Y_UP_LEFT, Z_UP
from sunsplit.core.export.emitters import covered_by, emitters_of, rays_of_disc, with_suns
from sunsplit.core.export.lookup import look_up, widened
from sunsplit.core.export.skylight import Skylight
from sunsplit.core.export.stage import STAGE, Ball, mesh_of
from sunsplit.core.settings import BadSetting
from sunsplit.core.suns import Sun, disc_sun, point_sun
from tests.files import noise, sunsplit

HALVES = 1e-3
"""What a map as half floats may be wrong by (see `tolerances.ACCOUNT_HALF`)."""


def sun(diameter: float, to_light=(0.36, 0.48, 0.8), flux=(3.0, 2.0, 1.0)) -> Sun:
    """Of this angular diameter in degrees."""
    if not diameter:
        return point_sun(np.array(flux), np.array(to_light), 1)
    shortfall = np.sin(np.radians(diameter) / 4) ** 2
    return disc_sun(np.array(flux), np.array(to_light), shortfall, 1)


def sky(*suns: Sun, radiance=None, has_cells=False) -> Skylight:
    return Skylight("sky", suns, radiance, has_cells, np.eye(3))


def light_of(emitters) -> np.ndarray:
    """Scalar irradiance of everything, (3,)."""
    total = np.zeros(3) if emitters.radiance is None else scalar_irradiance(emitters.radiance)
    for rays in emitters.rays:
        total = total + len(rays.to_light) * rays.irradiance
    return total + sum((disc.scalar_irradiance for disc in emitters.discs), np.zeros(3))


@pytest.fixture(scope="module")
def conversion(sunrise):
    return convert(load(sunrise))


@pytest.fixture(scope="module")
def written(conversion, tmp_path_factory):
    return save(conversion, tmp_path_factory.mktemp("conversion")).lights


@pytest.mark.parametrize("discs", ["auto", "lights", "map"])
@pytest.mark.parametrize("narrow", ["discs", "many rays"])
def test_no_light_is_lost(narrow, discs):
    given = sky(sun(0), sun(0.5), sun(20), sun(150), radiance=noise(64))
    emitters = emitters_of(given, narrow, discs)
    assert light_of(emitters) == pytest.approx(given.scalar_irradiance, rel=1e-6)


def test_what_becomes_of_suns():
    given = sky(sun(0), sun(0.5), sun(20))
    auto = emitters_of(given, "many rays", "auto")
    assert [len(rays.to_light) for rays in auto.rays] == [1, 61]
    assert auto.painted == 1
    assert auto.radiance.shape == (512, 1024, 3)
    assert [len(r.to_light) for r in emitters_of(given, "many rays", "lights").rays] == [1, 61, 61]
    painted = emitters_of(given, "many rays", "map")
    assert [len(rays.to_light) for rays in painted.rays] == [1]  # a point is nothing in a map
    native = emitters_of(given, "discs", "auto")
    assert len(native.discs) == 3
    assert native.radiance is None
    assert not native.losses


def test_losses_are_said():
    many = emitters_of(sky(sun(0.5), sun(20)), "many rays", "auto").losses
    assert any("61" in line for line in many)
    assert any("Suns in the map: 1." in line for line in many)
    (sharp,) = emitters_of(sky(sun(0), sun(0.5)), "one ray", "auto").losses
    assert sharp.startswith("Suns that have lost their width: 1.")
    assert not emitters_of(sky(sun(0)), "many rays", "auto").losses


@given(
    diameter=st.floats(0.01, 180),
    angles=st.tuples(st.floats(0, 360), st.floats(-90, 90)),
)
def test_rays_of_a_disc_have_its_moments(diameter, angles):
    """All lie inside, and their mean is that of the disc."""
    turn, up = np.radians(angles)
    middle = np.array([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.sin(up)])
    half = np.radians(diameter) / 2
    found = rays_of_disc(middle, half)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(61), abs=1e-12)
    assert sphere.angle_between(found, middle).max() < half
    assert found.mean(axis=0) == pytest.approx((1 + np.cos(half)) / 2 * middle, abs=1e-12)


def test_rays_fill_a_disc_evenly():
    """The second moment about the middle is that of a uniform disc, within 3 %."""
    half = np.radians(0.3)
    found = rays_of_disc(np.array([0.0, 0, 1]), half)
    assert (found[:, 0] ** 2).mean() == pytest.approx(half**2 / 4, rel=0.03)
    assert (found[:, 1] ** 2).mean() == pytest.approx(half**2 / 4, rel=0.03)
    assert (found[:, 0] * found[:, 1]).mean() == pytest.approx(0, abs=half**2 * 1e-3)


@pytest.mark.parametrize("to_light", [(0, 0, 1), (0.6, 0, 0.8), (-1, 0, 0), (0.36, 0.48, -0.8)])
@pytest.mark.parametrize("diameter", [6, 40, 179])
def test_a_painted_disc_is_where_and_as_wide_as_the_sun(to_light, diameter):
    given = sun(diameter, np.array(to_light, float))
    painted = with_suns(None, [given], np.eye(3), False)
    assert scalar_irradiance(painted) == pytest.approx(given.scalar_irradiance, rel=1e-6)
    solid = sphere.row_solid_angles(1024, 512)[:, None, None]
    directions = sphere.pixel_directions(np.arange(painted[..., 0].size), 1024, 512)
    weight = (painted * solid)[..., 0].ravel()
    mean = (directions * weight[:, None]).sum(axis=0) / weight.sum()
    length = (1 + np.cos(np.radians(diameter) / 2)) / 2
    assert mean == pytest.approx(length * given.to_light, abs=2e-4)
    inside = look_up(painted, given.to_light[None], True)
    assert inside == pytest.approx(given.radiance[None], rel=5e-3)


@pytest.mark.parametrize("diameter", [1e-4, 0.01, 0.03, 0.1, 0.4])
def test_discs_narrower_than_pixels_are_painted(diameter):
    """Wherever they lie between the places that are looked at."""
    places = np.random.default_rng(5).normal(size=(40, 3))
    places = np.vstack([places / np.linalg.norm(places, axis=1)[:, None], np.eye(3), -np.eye(3)])
    for place in places:
        given = sun(diameter, place)
        painted = with_suns(None, [given], np.eye(3), False)
        assert scalar_irradiance(painted) == pytest.approx(given.scalar_irradiance, rel=1e-6)
        found = sphere.pixel_centres(np.flatnonzero(painted[..., 0].ravel()), 1024, 512)
        assert sphere.angle_between(found, place).max() < np.radians(diameter / 2 + 0.36)


def test_the_rim_of_a_painted_disc_is_not_jagged():
    top, covered = covered_by(np.array([0.0, 1, 0]), np.radians(5), 256, 128)
    area = (covered.T @ sphere.row_solid_angles(256, 128)[top : top + len(covered)]).sum()
    assert area == pytest.approx(4 * np.pi * np.sin(np.radians(2.5)) ** 2, rel=0.01)
    assert ((covered > 0.05) & (covered < 0.95)).sum() > 16


def test_a_painted_disc_follows_the_map_s_turn():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    given = replace(sky(sun(30), radiance=noise(8)), turn=turn)
    emitters = emitters_of(given, "many rays", "auto")
    place = (turn.T @ given.suns[0].to_light)[None]
    assert look_up(emitters.radiance, place, False) == pytest.approx(
        given.suns[0].radiance[None], abs=1.1
    )


def test_a_map_made_wider_keeps_its_light():
    small = noise(16)
    wide = widened(small, 1024, False)
    assert wide.shape == (512, 1024, 3)
    assert scalar_irradiance(wide) == pytest.approx(scalar_irradiance(small), rel=1e-6)
    assert widened(small, 16, False) is small


def test_looking_up_blends_over_seam_and_poles():
    """Radiance that is linear in the direction is found as it is, everywhere."""
    middles = sphere.to_directions(
        (np.arange(256) + 0.5)[None, :] / 256, (np.arange(128) + 0.5)[:, None] / 128
    )
    radiance = 2 + middles
    found = np.random.default_rng(3).normal(size=(500, 3))
    found = np.vstack([found, [[0, 0, 1], [0, 0, -1], [-1, 0, 0], [-1, 1e-9, 0]]])
    unit = found / np.linalg.norm(found, axis=1)[:, None]
    assert look_up(radiance, found, False) == pytest.approx(2 + unit, abs=4e-4)


@pytest.mark.parametrize("axes", [Z_UP, Y_UP, Y_UP_LEFT], ids=lambda axes: axes.name)
def test_axes(axes):
    up = axes.of(np.array([0.0, 0, 1]))
    assert up["XYZ".index(axes.name.split()[-2])] == 1
    handed = 1 if axes.name.startswith("right") else -1
    assert np.linalg.det(axes.matrix) == pytest.approx(handed)


def test_things_of_the_scene_look_outwards():
    for thing in STAGE.things.values():
        mesh = mesh_of(thing)
        a, b, c = mesh.points[mesh.triangles].transpose(1, 0, 2)
        facing = np.cross(b - a, c - a)
        assert (np.linalg.norm(facing, axis=1) > 0).all()
        assert (np.sum(facing * mesh.normals[mesh.triangles].mean(axis=1), axis=1) > 0).all()
        if isinstance(thing, Ball):
            assert np.linalg.norm(mesh.points - thing.centre, axis=1) == pytest.approx(thing.radius)


def test_from_files_and_from_memory(conversion, written):
    ours, read = skylight_of(conversion), read_skylight(written)
    assert read.name == ours.name == "spruit_sunrise_1k"
    assert read.scalar_irradiance == pytest.approx(ours.scalar_irradiance, rel=HALVES)
    assert ours.scalar_irradiance == pytest.approx(conversion.account.source, rel=1e-6)
    for a, b in zip(ours.suns, read.suns, strict=True):
        assert a.to_light == pytest.approx(b.to_light, abs=1e-15)


@pytest.mark.parametrize("kind", ["pbrt", "mitsuba"])
def test_the_files_hold_the_conversion_s_light(tmp_path, conversion, kind):
    files = export_conversion(conversion, tmp_path, ExportSettings(kind))
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in files.paths)
    with OpenEXR.File(str(files.map)) as file:
        radiance = file.channels()["RGB"].pixels
    if kind == "pbrt":
        in_map = radiance.mean(axis=(0, 1), dtype=np.float64) * 4 * np.pi
    else:  # every second row is the map's own
        in_map = scalar_irradiance(radiance[1::2])
    painted = sum(
        (s.scalar_irradiance for s in conversion.suns if s.angular_diameter >= np.radians(5)),
        np.zeros(3),
    )
    assert in_map == pytest.approx(conversion.account.residual + painted, rel=HALVES)


def test_a_wide_residual_keeps_its_pixels(tmp_path, sunrise):
    from sunsplit.core.environment import environment_from_pixels

    wide = np.repeat(np.repeat(load(sunrise).radiance, 2, axis=0), 2, axis=1)
    made = convert(environment_from_pixels(wide, "wide"), ConversionSettings(residual_width="own"))
    assert skylight_of(made).radiance.shape == (1024, 2048, 3)
    lights = save(made, tmp_path).lights
    assert read_skylight(lights).radiance.shape == (1024, 2048, 3)


def test_a_black_residual_is_light_of_nothing(tmp_path):
    """One lit pixel: all of it is a sun."""
    from sunsplit.core.environment import environment_from_pixels

    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[20, 30] = 1e4
    made = convert(environment_from_pixels(pixels, "spot"))
    lights = save(made, tmp_path).lights
    for kind in ("pbrt", "mitsuba"):
        export_conversion(lights, tmp_path / kind, ExportSettings(kind))
    assert read_skylight(lights).scalar_irradiance == pytest.approx(made.account.source, rel=1e-6)


def test_without_residual_and_without_suns(tmp_path, conversion):
    bare = replace(skylight_of(conversion), radiance=None)
    narrow = replace(bare, suns=tuple(s for s in bare.suns if s.angular_diameter < 0.08))
    for kind in ("pbrt", "mitsuba"):
        files = export_conversion(narrow, tmp_path, ExportSettings(kind))
        assert files.map is None
        assert ("infinite" in files.lights.read_text()) is False
        assert ("envmap" in files.lights.read_text()) is False
        none = export_conversion(replace(bare, suns=()), tmp_path, ExportSettings(kind))
        assert none.lights.is_file()


def test_an_older_map_goes_away(tmp_path, conversion):
    """Else it would be taken for a part of the new export."""
    settings = ExportSettings("mitsuba")
    first = export_conversion(conversion, tmp_path, settings)
    bare = replace(skylight_of(conversion), radiance=None, suns=())
    export_conversion(bare, tmp_path, settings)
    assert not first.map.exists()
    assert first.lights.is_file()


@pytest.mark.parametrize(
    "name", ['a "quoted" sky', "Himmel über Köln", "a -- b", "a---b-", "a&b<c>"]
)
def test_any_name_in_xml(tmp_path, name):
    export_conversion(
        replace(sky(sun(1), radiance=noise(8)), name=name), tmp_path, ExportSettings("mitsuba")
    )
    scene = ElementTree.parse(tmp_path / f"{name}.scene.xml").getroot()
    lights = scene.find("include").get("filename")
    found = ElementTree.parse(tmp_path / lights).getroot()
    assert (tmp_path / found.find("emitter/string").get("value")).is_file()


@pytest.mark.parametrize("name", ["a\nb", "a\x01b", "a\udcffb"])
@pytest.mark.parametrize("kind", ["pbrt", "mitsuba"])
def test_names_that_no_text_can_hold(tmp_path, kind, name):
    with pytest.raises(UnusableInput, match="cannot refer to files named"):
        export_conversion(replace(sky(sun(1)), name=name), tmp_path, ExportSettings(kind))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", ["pbrt", "mitsuba", "povray", "usd", "gltf"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1.0])
def test_what_is_no_light(tmp_path, kind, wrong):
    dark = sky(sun(1, flux=(1, wrong, 1)))
    spot = noise(8)
    spot[2, 3, 1] = wrong
    for wrong_sky in (dark, sky(radiance=spot)):
        with pytest.raises(UnusableInput, match="The light of sky is"):
            export_conversion(wrong_sky, tmp_path, ExportSettings(kind))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "wrong",
    [
        {"format": "maya"},
        {"format": "pbrt", "up": "x"},
        {"format": "pbrt", "discs": "round"},
        {"format": "gltf", "lux": 0.0},
        {"format": "gltf", "lux": float("nan")},
        {"format": "gltf", "up": "z"},
    ],
)
def test_wrong_settings(wrong):
    with pytest.raises(BadSetting):
        ExportSettings(**wrong)


def changed(written: Path, folder: Path, change) -> Path:
    """The conversion in another folder with its document changed."""
    document = json.loads(written.read_text())
    change(document)
    residual = written.with_name(document["residual"]["file"])
    if residual.is_file():
        (folder / residual.name).write_bytes(residual.read_bytes())
    path = folder / written.name
    path.write_text(json.dumps(document))
    return path


BROKEN = {
    "another version": (lambda d: d.update(version=2), "version 2; this Sunsplit reads 1"),
    "missing residual": (lambda d: d["residual"].update(file="gone.exr"), "is missing"),
    "another residual": (lambda d: d["residual"].update(sha256="0" * 64), "was changed"),
    "no suns": (lambda d: d.pop("suns"), "is damaged"),
    "a sun that is no number": (lambda d: d["suns"][0].update(to_light=["x"] * 3), "is damaged"),
    "not ours": (lambda d: d.update(format="?"), "was not written by Sunsplit"),
}


@pytest.mark.parametrize(("change", "sentence"), BROKEN.values(), ids=BROKEN.keys())
@pytest.mark.parametrize("kind", ["pbrt", "mitsuba"])
def test_bad_input(tmp_path, written, kind, change, sentence):
    path = changed(written, tmp_path, change)
    with pytest.raises(UnusableInput, match=sentence):
        export_conversion(path, tmp_path / "out", ExportSettings(kind))
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written(tmp_path, written):
    tmp_path.chmod(0o500)
    with pytest.raises(CannotWrite):
        export_conversion(written, tmp_path, ExportSettings("pbrt"))


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no system's folder to try it in")
def test_a_folder_that_nobody_may_write(written):
    with pytest.raises(CannotWrite, match="Cannot write into /proc"):
        export_conversion(written, "/proc/exported", ExportSettings("pbrt"))


def test_a_folder_that_is_a_file(tmp_path, written):
    place = tmp_path / "file"
    place.write_text("mine")
    with pytest.raises(CannotWrite, match="it is a file"):
        export_conversion(written, place, ExportSettings("pbrt"))
    assert place.read_text() == "mine"


def test_a_full_disk_leaves_the_older_export(tmp_path, conversion, monkeypatch):
    from sunsplit.core.files import exr

    settings = ExportSettings("mitsuba")
    first = export_conversion(conversion, tmp_path, settings)
    before = {path: path.read_bytes() for path in first.paths}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(exr, "write", full)
    with pytest.raises(CannotWrite, match="No space left"):
        export_conversion(replace(skylight_of(conversion), suns=()), tmp_path, settings)
    assert {path: path.read_bytes() for path in first.paths} == before


def test_the_command_line(tmp_path, written):
    result = sunsplit("export", written, "--format", "mitsuba", "-o", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert "axes: right-handed, Y up" in result.stdout
    assert "Suns in the map: 2." in result.stdout
    result = sunsplit(
        "export", written, "--format", "pbrt", "-o", tmp_path, "--json", "--discs", "lights"
    )
    found = json.loads(result.stdout)
    assert Path(found["lights"]).is_file()
    assert found["axes"] == "right-handed, Z up"
    assert found["losses"]


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (("nothing.lights.json", "--format", "pbrt"), 1, "does not exist"),
        (("nothing.lights.json", "--format", "maya"), 2, "invalid choice"),
        (("nothing.lights.json",), 2, "--format"),
        (("nothing.lights.json", "--format", "gltf", "--up", "z"), 2, "glTF is Y up"),
    ],
)
def test_the_command_line_s_sentences(tmp_path, arguments, status, sentence):
    result = sunsplit("export", *arguments, cwd=tmp_path)
    assert result.returncode == status
    assert sentence in result.stderr
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.iterdir())
