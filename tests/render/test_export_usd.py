"""Exports to USD as Blender imports them: the same suns, the same world, the same picture."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sunsplit.core import ExportSettings, export_conversion, read_skylight, sphere
from sunsplit.core.export.lookup import look_up
from sunsplit.core.export.skylight import Skylight
from sunsplit.core.suns import Sun
from tests import exports_in_blender
from tests.blender import camera_towards, kept_by_cycles, render, to_light
from tests.exporting import MEAN, exported, shadows_agree
from tests.exports_in_blender import look_at_stage, plate_in, usd_scene
from tests.files import noise
from tests.maps import direction
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.render.compare import estimate, means_agree, pixels_agree

TURN = Rotation.from_euler("xyz", (20, -35, 110), degrees=True).as_matrix()
WIDTHS = np.radians([0.0, 0.01, 0.53, 20.0, 120.0, 180.0])


def lamps(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Brightest sun first."""
    found = exports_in_blender.lamps(scene)
    return sorted(found, key=lambda lamp: int(lamp.name.removeprefix("Sun_")))


def strength(lamp: bpy.types.Object) -> np.ndarray:
    """Irradiance of a surface that faces a sun, (3,)."""
    return np.array(lamp.data.color) * lamp.data.energy * 2.0**lamp.data.exposure


def all_widths() -> Skylight:
    """Suns of each width, one of them right above and one right below."""
    places = [direction(90 * n - 100, 90 - 36 * n) for n in range(len(WIDTHS))]
    suns = []
    for place, width in zip(places, WIDTHS, strict=True):
        strengths = np.array([9.0, 4.0, 0.01]) * (1 + place[2])
        suns.append(Sun(place, strengths, strengths, width, 1))
    return Skylight("all widths", tuple(suns), noise(), False, np.eye(3))


@pytest.mark.parametrize("up", ["usual", "y"])
@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["as it is", "turned"])
@pytest.mark.parametrize("which", ["lights", "scene"])
@pytest.mark.parametrize("source", ["sunrise", "all widths"])
def test_the_same_suns(tmp_path, lights, source, which, turn, up):
    made = (read_skylight(lights) if source == "sunrise" else all_widths()).turned(turn)
    settings = ExportSettings("usd", up, reader="blender")
    files = export_conversion(made, tmp_path, settings)
    found = lamps(usd_scene(getattr(files, which)))
    assert len(found) == len(made.suns) > 0
    for lamp, sun in zip(found, made.suns, strict=True):
        assert lamp.data.type == "SUN"
        assert sphere.angle_between(unit(to_light(lamp)), sun.to_light) < 1e-5
        assert strength(lamp) == pytest.approx(sun.irradiance, rel=1e-5)
        assert lamp.data.angle == pytest.approx(sun.angular_diameter, rel=1e-5)


def test_what_blender_makes_of_the_specification(tmp_path, lights):
    """Why there is a setting for it. Should a Blender do better one day, this says so."""
    made = read_skylight(lights)
    files = export_conversion(made, tmp_path, ExportSettings("usd"))
    for lamp, sun in zip(lamps(usd_scene(files.lights)), made.suns, strict=True):
        assert strength(lamp) == pytest.approx(4 * sun.irradiance, rel=1e-5)
        assert lamp.data.angle == pytest.approx(2 * sun.angular_diameter, rel=1e-5)


def seen_around(scene: bpy.types.Scene, folder: Path, width: int) -> np.ndarray:
    """The world in the layout of `sphere`, by a panoramic camera that looks along +X."""
    camera = camera_towards(scene, np.array([1.0, 0, 0]), 90, width)
    scene.render.resolution_y = width // 2
    camera.data.type = "PANO"
    camera.data.panorama_type = "EQUIRECTANGULAR"
    camera.rotation_mode = "XYZ"
    camera.rotation_euler = (np.pi / 2, 0, -np.pi / 2)
    # One ray through the middle of each pixel, or as near to it as Cycles goes.
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    return render(scene, folder, 1)


@pytest.mark.parametrize("up", ["usual", "y"])
@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["as it is", "turned"])
@pytest.mark.parametrize("which", ["lights", "scene"])
def test_the_same_world(tmp_path, which, turn, up):
    """In 2,048 directions, by a map whose colours say which direction they are of."""
    v, u = (np.arange(32) + 0.5) / 32, (np.arange(64) + 0.5) / 64
    around = sphere.to_directions(u[None, :], v[:, None])
    pixels = (1.5 + around).astype(np.float32)
    made = Skylight("it's @ name", all_widths().suns, pixels, False, np.eye(3)).turned(turn)
    files = export_conversion(made, tmp_path, ExportSettings("usd", up, reader="blender"))
    scene = usd_scene(getattr(files, which))
    for thing in scene.objects:
        thing.hide_render = thing.type in ("LIGHT", "MESH")
    found = seen_around(scene, tmp_path, 64).reshape(-1, 3)
    directions = around.reshape(-1, 3) @ made.turn
    wanted = look_up(pixels, directions, False)
    # Over the poles Cycles blends with the row itself.
    inner = np.abs(directions[:, 2]) < np.cos(np.pi / 64)
    print(f"{inner.sum()} directions, {np.abs(found / wanted - 1)[inner].max():.1e}")
    assert inner.sum() > 1900
    assert found[inner] == pytest.approx(wanted[inner], rel=1e-3)
    assert found == pytest.approx(1.5 + directions, abs=0.1)


def test_no_map_and_no_suns(tmp_path):
    bare = Skylight("bare", all_widths().suns, None, False, np.eye(3))
    files = export_conversion(bare, tmp_path, ExportSettings("usd", reader="blender"))
    assert len(lamps(usd_scene(files.scene))) == len(WIDTHS)
    sunless = Skylight("sunless", (), noise(), False, np.eye(3))
    files = export_conversion(sunless, tmp_path, ExportSettings("usd", reader="blender"))
    scene = usd_scene(files.scene)
    assert not lamps(scene)
    (texture,) = (n for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT")
    assert tuple(texture.image.size) == (32, 16)


@pytest.mark.parametrize("up", ["usual", "y"])
def test_the_scene_that_comes_with_it(tmp_path, sunrise, usual_lights, wanted, up):
    """Its camera, meshes and materials as they are imported."""
    folder = exported(usual_lights, tmp_path, "usd", "--up", up, "--reader", "blender")
    scene = usd_scene(folder / f"{sunrise.stem}.scene.usda")
    look_at_stage(scene)
    found = estimate(scene, tmp_path, 64)
    means_agree(wanted.picture, found, tmp_path, MEAN)
    pixels_agree(wanted.picture, found, tmp_path, slack=0.05, outliers=0.02)
    shadows_agree(wanted, found.mean)


def test_plates(tmp_path, sunrise, lights):
    folder = exported(lights, tmp_path, "usd", "--reader", "blender")
    scene = usd_scene(folder / f"{sunrise.stem}.lights.usda")
    with kept_by_cycles(scene):
        for name, normal in ORIENTATIONS.items():
            normal = unit(normal)
            seen = plate_in(scene, tmp_path, normal, samples=196)
            ratio = seen * np.pi / ALBEDO / irradiance(sunrise, normal) - 1
            print(name, ratio)
            assert np.abs(ratio).max() < MEAN, name
