"""Blender's importer of glTF reads what is exported, and Cycles renders it as the plain HDRI."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sunsplit.core import ExportSettings, export_conversion, read_skylight
from sunsplit.core.export.stage import STAGE
from tests.blender import kept_by_cycles, to_light
from tests.exporting import MEAN, exported, shadows_agree
from tests.exports_in_blender import (
    add_gltf_widths,
    add_gltf_world,
    gltf_scene,
    lamps,
    look_at_stage,
    plate_in,
)
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.render.compare import estimate, means_agree

TURN = Rotation.from_euler("xyz", (20, -35, 110), degrees=True).as_matrix()


@pytest.mark.parametrize(("mode", "lux"), [("SPEC", 683.0), ("COMPAT", 1.0), ("RAW", 1.0)])
@pytest.mark.parametrize("kind", ["lights", "scene"])
def test_lamps_are_the_suns(tmp_path, lights, mode, lux, kind):
    sky = read_skylight(lights).turned(TURN)
    files = export_conversion(sky, tmp_path, ExportSettings("gltf", discs="lights", lux=lux))
    found = lamps(gltf_scene(getattr(files, kind), mode))
    assert len(found) == len(sky.suns) > 2
    for lamp, sun in zip(found, sky.suns, strict=True):
        assert lamp.data.type == "SUN"
        assert to_light(lamp) == pytest.approx(sun.to_light, abs=1e-5)
        strength = lamp.data.energy * np.array(lamp.data.color)
        assert strength == pytest.approx(sun.irradiance, rel=1e-5)
        assert lamp.data["angular_diameter"] == pytest.approx(sun.angular_diameter, rel=1e-12)


def test_the_camera_is_the_stages(tmp_path, lights):
    scene = gltf_scene(export_conversion(lights, tmp_path, ExportSettings("gltf")).scene)
    (camera,) = (thing for thing in scene.objects if thing.type == "CAMERA")
    place = np.array(camera.matrix_world)
    assert place[:3, 3] == pytest.approx(STAGE.camera.place, abs=1e-5)
    assert place[:3, :3] == pytest.approx(STAGE.camera.frame, abs=1e-5)
    assert np.degrees(camera.data.angle_y) == pytest.approx(
        STAGE.camera.field_of_view_of_height, abs=1e-4
    )


def test_things_are_the_stages(tmp_path, lights):
    scene = gltf_scene(export_conversion(lights, tmp_path, ExportSettings("gltf")).scene)
    ball = scene.objects["ball"]
    corners = [np.array(ball.matrix_world)[:3] @ (*corner, 1) for corner in ball.bound_box]
    assert np.min(corners, axis=0) == pytest.approx([-0.8, -1.8, 0], abs=1e-5)
    assert np.max(corners, axis=0) == pytest.approx([0.8, -0.2, 1.6], abs=1e-5)


@pytest.mark.parametrize("options", [(), ("--discs", "map")])
def test_the_scene_that_comes_with_it(tmp_path, sunrise, usual_lights, wanted, options):
    folder = exported(usual_lights, tmp_path, "gltf", *options)
    scene = gltf_scene(folder / f"{sunrise.stem}.scene.gltf")
    look_at_stage(scene)
    add_gltf_world(scene, folder)
    add_gltf_widths(scene)
    found = estimate(scene, tmp_path, samples=48)
    means_agree(wanted.picture, found, tmp_path, MEAN)
    shadows_agree(wanted, found.mean)


@pytest.mark.parametrize("turned", [False, True])
def test_plates(tmp_path, sunrise, lights, turned):
    turn = TURN if turned else np.eye(3)
    files = export_conversion(read_skylight(lights).turned(turn), tmp_path, ExportSettings("gltf"))
    scene = gltf_scene(files.lights)
    add_gltf_world(scene, tmp_path)
    with kept_by_cycles(scene):
        for name, normal in ORIENTATIONS.items():
            normal = unit(normal)
            seen = plate_in(scene, tmp_path, turn @ normal, samples=256)
            ratio = seen * np.pi / ALBEDO / irradiance(sunrise, normal) - 1
            print(name, ratio)
            assert np.abs(ratio).max() < MEAN, name


def test_extras_are_plain_json(tmp_path, lights):
    """What scripts read without Blender."""
    files = export_conversion(lights, tmp_path, ExportSettings("gltf"))
    (scene,) = json.loads(files.lights.read_text(encoding="utf-8"))["scenes"]
    told = gltf_scene(files.lights)["sunsplit"].to_dict()
    assert told == scene["extras"]["sunsplit"]
