"""Blender's importer of glTF reads what is exported, and Cycles renders it as the plain HDRI."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import unquote

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion, Vector

from sunsplit.core import ExportSettings, export_conversion, read_skylight
from sunsplit.core.export.stage import STAGE
from tests.blender import (
    add_mapping,
    add_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    render,
    to_light,
)
from tests.exporting import HEIGHT, MEAN, WIDTH, converted, exported, reference, shadows_agree
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.render.compare import estimate, means_agree

TURN = np.array(Matrix.Rotation(0.7, 3, (1, 2, -3)))


def imported(path: Path, mode: str = "SPEC") -> bpy.types.Scene:
    """What Blender's importer makes of a file, and nothing else."""
    scene = fresh_scene()
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.import_scene.gltf(filepath=str(path), export_import_convert_lighting_mode=mode)
    bpy.context.view_layer.update()
    return scene


def lamps(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [thing for thing in scene.objects if thing.type == "LIGHT"]


def add_world(scene: bpy.types.Scene, folder: Path) -> None:
    """The map beside a file, as the file's extras say, which the importer keeps with the scene.

    The importer turns Y up into Z up, where an environment texture lies as they say of the map.
    """
    told = scene["sunsplit"]["map"]
    mapping = add_mapping(hdri_world(scene, folder / unquote(told["uri"])))
    x, y, z, w = told["rotation"]
    # The node turns directions of the scene into those of the picture.
    back = Quaternion((w, x, -z, y)).inverted()
    mapping.inputs["Rotation"].default_value = back.to_euler()


def add_width(scene: bpy.types.Scene) -> None:
    """The importer leaves every sun the width of a new lamp; what it has is kept with it."""
    for lamp in lamps(scene):
        lamp.data.angle = lamp.data["angular_diameter"]


@pytest.fixture(scope="module")
def lights(sunrise, tmp_path_factory):
    """A conversion whose plates are right within a tenth of what is asked here, as tests of the
    split show."""
    return converted(sunrise, tmp_path_factory.mktemp("conversion"), "--tolerance", "0.4")


@pytest.mark.parametrize(("mode", "lux"), [("SPEC", 683.0), ("COMPAT", 1.0), ("RAW", 1.0)])
@pytest.mark.parametrize("kind", ["lights", "scene"])
def test_lamps_are_the_suns(tmp_path, lights, mode, lux, kind):
    sky = read_skylight(lights).turned(TURN)
    files = export_conversion(sky, tmp_path, ExportSettings("gltf", discs="lights", lux=lux))
    found = lamps(imported(getattr(files, kind), mode))
    assert len(found) == len(sky.suns) > 2
    for lamp, sun in zip(found, sky.suns, strict=True):
        assert lamp.data.type == "SUN"
        assert to_light(lamp) == pytest.approx(sun.to_light, abs=1e-5)
        strength = lamp.data.energy * np.array(lamp.data.color)
        assert strength == pytest.approx(sun.irradiance, rel=1e-5)
        assert lamp.data["angular_diameter"] == pytest.approx(sun.angular_diameter, rel=1e-12)


def test_the_camera_is_the_stages(tmp_path, lights):
    scene = imported(export_conversion(lights, tmp_path, ExportSettings("gltf")).scene)
    (camera,) = (thing for thing in scene.objects if thing.type == "CAMERA")
    place = np.array(camera.matrix_world)
    assert place[:3, 3] == pytest.approx(STAGE.camera.place, abs=1e-5)
    assert place[:3, :3] == pytest.approx(STAGE.camera.frame, abs=1e-5)
    assert np.degrees(camera.data.angle_y) == pytest.approx(
        STAGE.camera.field_of_view_of_height, abs=1e-4
    )


def test_things_are_the_stages(tmp_path, lights):
    scene = imported(export_conversion(lights, tmp_path, ExportSettings("gltf")).scene)
    ball = scene.objects["ball"]
    corners = [ball.matrix_world @ Vector(corner) for corner in ball.bound_box]
    assert np.min(corners, axis=0) == pytest.approx([-0.8, -1.8, 0], abs=1e-5)
    assert np.max(corners, axis=0) == pytest.approx([0.8, -0.2, 1.6], abs=1e-5)


@pytest.fixture(scope="module")
def wanted(sunrise, tmp_path_factory):
    return reference(sunrise, tmp_path_factory.mktemp("reference"), samples=48)


@pytest.mark.parametrize("options", [(), ("--discs", "map")])
def test_the_scene_that_comes_with_it(tmp_path, sunrise, wanted, options):
    folder = exported(converted(sunrise, tmp_path), tmp_path, "gltf", *options)
    scene = imported(folder / f"{sunrise.stem}.scene.gltf")
    scene.camera = scene.objects["camera"]
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 7
    add_world(scene, folder)
    add_width(scene)
    found = estimate(scene, tmp_path, samples=48)
    means_agree(wanted.picture, found, tmp_path, MEAN)
    shadows_agree(wanted, found.mean)


@pytest.mark.parametrize("turned", [False, True])
def test_plates(tmp_path, sunrise, lights, turned):
    turn = TURN if turned else np.eye(3)
    files = export_conversion(read_skylight(lights).turned(turn), tmp_path, ExportSettings("gltf"))
    scene = imported(files.lights)
    add_world(scene, tmp_path)
    for name, normal in ORIENTATIONS.items():
        normal = unit(normal)
        towards = Vector((turn @ normal).tolist())
        facing = towards.to_track_quat("Z", "Y").to_matrix().to_4x4()
        plate = add_mesh(scene, plate_mesh(1), diffuse("White", ALBEDO), facing)
        plate.location = -towards
        camera = camera_towards(scene, -np.array(towards), 10, 16)
        seen = render(scene, tmp_path, samples=256).mean(axis=(0, 1))
        ratio = seen * np.pi / ALBEDO / irradiance(sunrise, normal) - 1
        print(name, ratio)
        assert np.abs(ratio).max() < MEAN, name
        for thing in (plate, camera):
            bpy.data.objects.remove(thing)


def test_extras_are_plain_json(tmp_path, lights):
    """What scripts read without Blender."""
    files = export_conversion(lights, tmp_path, ExportSettings("gltf"))
    (scene,) = json.loads(files.lights.read_text(encoding="utf-8"))["scenes"]
    told = imported(files.lights)["sunsplit"].to_dict()
    assert told == scene["extras"]["sunsplit"]
