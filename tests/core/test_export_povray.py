"""Files for POV-Ray, read by POV-Ray itself: where light is, how much, and under which names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sunsplit.core import ExportSettings, export_conversion, sphere
from sunsplit.core.export.axes import Y_UP_LEFT, Z_UP
from sunsplit.core.export.emitters import with_suns
from sunsplit.core.export.lookup import look_up
from sunsplit.core.export.povray import WIDE_DISC, plain_name
from sunsplit.core.export.skylight import Skylight
from sunsplit.core.suns import Sun, disc_sun, point_sun
from tests.files import noise, sunny
from tests.plates import ALBEDO, ORIENTATIONS, irradiance_by, unit
from tests.povray_renders import directions_seen, picture, plate, renderer, sky_seen, together

TURN = Rotation.from_euler("xyz", (20, -35, 110), degrees=True).as_matrix()

AXES = {"usual": Y_UP_LEFT, "y": Y_UP_LEFT, "z": Z_UP}

HALVES = 2e-3
"""What the pictures, which are half floats, made of a map of half floats, may be wrong by."""

ALONE = "#declare Sunsplit_Radiosity = false;"


@pytest.fixture(scope="module", autouse=True)
def povray():
    return renderer()


def sun(diameter: float, to_light=(0.36, 0.48, 0.8), flux=(3000.0, 2.0, 0.5)) -> Sun:
    """Of this angular diameter in degrees."""
    if not diameter:
        return point_sun(np.array(flux), np.array(to_light), 1)
    shortfall = np.sin(np.radians(diameter) / 4) ** 2
    return disc_sun(np.array(flux), np.array(to_light), shortfall, 1)


def sky(*suns: Sun, radiance=None, has_cells=False, turn=None, name="sky") -> Skylight:
    return Skylight(name, suns, radiance, has_cells, np.eye(3) if turn is None else turn)


def written(given: Skylight, folder: Path, up: str = "usual", discs: str = "auto") -> Path:
    return export_conversion(given, folder, ExportSettings("povray", up, discs)).lights


@pytest.mark.parametrize("has_cells", [False, True], ids=["blended", "cells"])
@pytest.mark.parametrize("up", ["usual", "z"])
def test_the_map_lies_where_it_should(tmp_path, up, has_cells):
    """All of the sphere, of a map in which no two pixels are alike, turned about no axis in
    particular: an offset of a twentieth of a pixel would fail."""
    given = sky(radiance=noise(16), has_cells=has_cells, turn=TURN)
    lights = written(given, tmp_path, up)
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    seen = together(lambda backwards: sky_seen(lights, backwards, AXES[up].of, 48), sides)
    for backwards, shown in zip(sides, seen, strict=True):
        found = shown.reshape(-1, 3)
        inner = directions_seen(backwards, 48).reshape(-1, 3) @ TURN
        expected = look_up(given.radiance, inner, has_cells)
        _, v = sphere.to_image(inner)
        if has_cells:
            far = np.abs(found / expected - 1).max(axis=-1) > HALVES
            assert far.mean() < 0.003  # on the very edges of pixels
            continue
        for row, at in ((0, v < 0.5 / 16), (-1, v > 1 - 0.5 / 16)):
            expected[at] = given.radiance[row].mean(axis=0)
        assert found == pytest.approx(expected, rel=HALVES)


@pytest.mark.parametrize("factor", [1e7, 1e-6])
def test_a_map_beyond_what_halfs_hold(tmp_path, factor):
    """POV-Ray reads every EXR as half floats."""
    wanted = noise(8) * np.float32(factor)
    lights = written(sky(radiance=wanted), tmp_path)
    # Its pictures are halfs, too: what it reads of the map is told at a bearable brightness.
    text = lights.read_text()
    before, after = text.rsplit("emission rgb ", 1)
    scale, rest = after.split("\n", 1)
    lights.write_text(f"{before}emission rgb {float(scale) / factor:.10g}\n{rest}")
    found = sky_seen(lights, np.array([0.0, 1, 0]), Y_UP_LEFT.of, 16)
    expected = look_up(noise(8), directions_seen(np.array([0.0, 1, 0]), 16).reshape(-1, 3), False)
    assert found.reshape(-1, 3) == pytest.approx(expected, rel=HALVES)


@pytest.mark.parametrize("diameter", [0, 0.5, 9.9])
@pytest.mark.parametrize("up", ["usual", "z"])
def test_a_sun_gives_its_irradiance(tmp_path, up, diameter):
    """On plates that face it, and do not; nothing is clipped at 1."""
    given = sun(diameter)
    lights = written(sky(given), tmp_path, up)
    assert ("area_light" in lights.read_text()) is bool(diameter)
    normals = (given.to_light, unit((0, 0, 1)), unit((1, 0, 0)), -given.to_light)
    *lit, dark = together(lambda normal: plate(lights, normal, AXES[up].of, ALONE), normals)
    for normal, found in zip(normals[:-1], lit, strict=True):
        expected = ALBEDO / np.pi * given.irradiance * (normal @ given.to_light)
        assert found == pytest.approx(np.broadcast_to(expected, found.shape), rel=HALVES)
    assert dark.max() == 0


@pytest.mark.parametrize("diameter", [40, 179])
def test_a_wide_sun_as_lights(tmp_path, diameter):
    given = sun(diameter, flux=(3.0, 2.0, 1.0))
    lights = written(sky(given), tmp_path, discs="lights")
    assert lights.read_text().count("light_source") == 61
    found = plate(lights, given.to_light, Y_UP_LEFT.of, ALONE)
    assert found.mean((0, 1)) == pytest.approx(ALBEDO / np.pi * given.irradiance, rel=HALVES)


def test_wide_suns_are_painted(tmp_path):
    wide, narrow = sun(np.degrees(WIDE_DISC) + 0.1), sun(np.degrees(WIDE_DISC) - 0.1)
    files = export_conversion(sky(wide, narrow), tmp_path, ExportSettings("povray"))
    assert files.lights.read_text().count("light_source") == 1
    assert any("Suns in the map: 1." in line for line in files.losses)
    assert any("17 x 17" in line for line in files.losses)
    assert any("radiosity" in line for line in files.losses)


def test_narrow_suns_in_the_map_are_said_to_be_lost(tmp_path):
    for discs, lost in (("map", True), ("auto", False), ("lights", False)):
        settings = ExportSettings("povray", discs=discs)
        files = export_conversion(sky(sun(0.5), sun(30)), tmp_path, settings)
        assert any("by luck" in line for line in files.losses) is lost


def test_a_disc_s_shadow_fades_as_it_should(tmp_path):
    """Behind the straight edge of a roof, a sun of 8 degrees: the part of a disc beside a chord."""
    half = np.radians(4)
    lights = written(sky(sun(8, (0.0, 0, 1))), tmp_path)
    roof = "box { <-50, 0.7, -50>, <0, 0.701, 50> pigment { rgb 1 } }"
    scene = lights.with_name("roof.pov")
    scene.write_text(
        "#version 3.7; global_settings { assumed_gamma 1.0 }\n"
        "#default { finish { ambient 0 diffuse 1 } }\n"
        f'{ALONE}\n#include "{lights.name}"\n{roof}\n'
        "camera { orthographic location <0, 0.5, 0> direction -y right 0.14 * x up 0.01 * z }\n"
        "plane { y, 0 pigment { rgb 1 } }\n"
    )
    found = picture(scene, 200, 8)[..., 0].mean(axis=0)
    place = ((np.arange(200) + 0.5) / 200 - 0.5) * 0.14 / 0.7
    chord = np.clip(place / np.tan(half), -1, 1)
    expected = 0.5 + (np.arcsin(chord) + chord * np.sqrt(1 - chord**2)) / np.pi
    off = found / found.max() - expected
    assert np.sqrt((off**2).mean()) < 0.02
    assert abs(off.mean()) < 0.002  # the shadow's middle is where it should be


@pytest.mark.parametrize("normal", ORIENTATIONS.values(), ids=ORIENTATIONS.keys())
def test_a_plate_gets_what_is_exported(tmp_path, normal):
    """By lights and radiosity together, a wide sun in the map among them."""
    radiance = noise(32) * np.array([1, 0.5, 0.2], np.float32)
    suns = [sun(0.5, flux=(1.0, 0.5, 0.2)), sun(30, (0.0, -0.6, 0.8), (2.0, 1.0, 0.5))]
    normal = unit(normal)
    given = sky(*suns, radiance=radiance, turn=TURN)
    lights = {up: written(given, tmp_path / up, up) for up in ("usual", "z")}
    wide = with_suns(radiance, suns[1:], TURN, False)
    expected = irradiance_by(wide, TURN.T @ normal)
    expected += suns[0].irradiance * max(normal @ suns[0].to_light, 0)
    for found in together(lambda up: plate(lights[up], normal, AXES[up].of), lights):
        print(found.mean((0, 1)) / (ALBEDO / np.pi * expected) - 1)
        assert found.mean((0, 1)) == pytest.approx(ALBEDO / np.pi * expected, rel=0.005)


def test_both_axes_show_the_same_scene(tmp_path):
    given = sky(sun(0.5, (0.48, 0.36, 0.8)), radiance=sunny(64, 20.0), turn=TURN)
    for up in ("usual", "z"):
        export_conversion(given, tmp_path / up, ExportSettings("povray", up))
    scenes = [tmp_path / up / "sky.scene.pov" for up in ("usual", "z")]
    found = together(lambda scene: picture(scene, 96, 54), scenes)
    # Radiosity gathers along other directions where axes are others.
    assert found[1].mean((0, 1)) == pytest.approx(found[0].mean((0, 1)), rel=0.003)
    far = np.abs(found[1] - found[0]).max(axis=-1) > 0.1 * found[0].mean()
    assert far.mean() < 0.01


def test_radiosity_can_be_left_to_the_scene(tmp_path):
    lights = written(sky(radiance=np.full((8, 16, 3), (0.5, 1, 2), np.float32)), tmp_path)
    up = np.array([0.0, 0, 1])
    assert plate(lights, up, Y_UP_LEFT.of, ALONE).max() == 0
    own = f"{ALONE} global_settings {{ radiosity {{ count 1600, 100000 brightness 1 }} }}"
    found = plate(lights, up, Y_UP_LEFT.of, own)
    assert found.mean((0, 1)) == pytest.approx(ALBEDO * np.array([0.5, 1, 2]), rel=HALVES)


@pytest.mark.parametrize("bare", [sky(), sky(sun(0)), sky(sun(2)), sky(radiance=noise(8))])
def test_without_suns_and_without_a_map(tmp_path, bare):
    files = export_conversion(bare, tmp_path, ExportSettings("povray"))
    assert (files.map is None) is (bare.radiance is None)
    assert ("sky_sphere" in files.lights.read_text()) is (bare.radiance is not None)
    found = picture(files.scene, 32, 18)
    assert bool(found.max() > 0) is (bool(bare.suns) or bare.radiance is not None)


@pytest.mark.parametrize(
    "name",
    [
        "sky_1k",
        "with spaces",
        'a "quoted" sky',
        "it's",
        "back\\slash",
        "Himmel über Köln",
        "空",
        "a // b */",
        "new\nline",
        "-D+W9",
        "a=b",
    ],
)
def test_any_name(tmp_path, name):
    """Slashes are in no file's name; all else may be."""
    given = sky(sun(1), radiance=noise(8), name=name)
    files = export_conversion(given, tmp_path, ExportSettings("povray"))
    assert picture(files.scene, 16, 9).max() > 0
    renamed = any("cannot read a file of this name" in line for line in files.losses)
    assert renamed is (files.scene.name != f"{name}.scene.pov")


def test_names_stay_apart():
    names = ["sky_1k", "a b", "a_b", "a'b", "ä", "ö", "Sky-1.5+2"]
    plain = [plain_name(name) for name in names]
    assert len(set(plain)) == len(names)
    assert plain[0] == "sky_1k"
    assert plain[-1] == "Sky-1.5+2"
    assert plain_name("ä") == plain_name("ä")


def test_cells_are_not_blended(tmp_path):
    given = sky(radiance=noise(8), has_cells=True)
    assert "interpolate" not in written(given, tmp_path).read_text()
    # With a disc painted over them, they are pixels like others.
    painted = replace(given, suns=(sun(30),))
    assert "interpolate" in written(painted, tmp_path).read_text()
