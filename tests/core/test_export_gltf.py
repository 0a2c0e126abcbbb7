"""glTF: what is in the files, by their JSON alone, and Khronos' validator of them."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sunsplit.core import ExportSettings, convert, export_conversion, load, skylight_of
from sunsplit.core.export.axes import Y_UP
from sunsplit.core.export.skylight import Skylight
from sunsplit.core.export.stage import STAGE, mesh_of
from sunsplit.core.suns import Sun, disc_sun, point_sun
from tests.files import noise
from tests.gltf_validator import issues, validated
from tests.maps import direction

TURN = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix()


def sun(diameter: float, to_light=(0.36, 0.48, 0.8), flux=(3.0, 2.0, 1.0)) -> Sun:
    """Of this angular diameter in degrees."""
    shortfall = np.sin(np.radians(diameter) / 4) ** 2
    if not diameter:
        return point_sun(np.array(flux), np.array(to_light, float), 1)
    return disc_sun(np.array(flux), np.array(to_light, float), shortfall, 1)


def sky(*suns: Sun, radiance=None, name="sky", turn=None, has_cells=False) -> Skylight:
    return Skylight(name, suns, radiance, has_cells, np.eye(3) if turn is None else turn)


def parsed(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


def files_of(given: Skylight, folder: Path, **settings):
    return export_conversion(given, folder, ExportSettings("gltf", **settings))


def lamps(document: dict) -> list[tuple[np.ndarray, dict]]:
    """To which way each light is, in Sunsplit's axes, and the light."""
    lights = document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    found = []
    for node in document.get("nodes", []):
        if "KHR_lights_punctual" in node.get("extensions", {}):
            # A light shines along its node's -Z.
            to_light = Rotation.from_quat(node["rotation"]).apply([0, 0, 1])
            light = lights[node["extensions"]["KHR_lights_punctual"]["light"]]
            found.append((Y_UP.matrix.T @ to_light, light))
    return found


FLUXES = 1e3 * noise(16)[0, :9].astype(np.float64)

ALL_WAYS = [*np.eye(3), *-np.eye(3), direction(30, 60), direction(200, -0.5), direction(90, 1e-7)]


def test_lamps_are_the_suns_in_lux(tmp_path):
    suns = [sun(0.5, way, flux) for way, flux in zip(ALL_WAYS, FLUXES, strict=True)]
    for lux in (683.0, 1.0):
        files = files_of(sky(*suns), tmp_path, lux=lux)
        for path in (files.lights, files.scene):
            found = lamps(parsed(path))
            assert len(found) == len(suns) == 9
            for (to_light, light), given in zip(found, suns, strict=True):
                assert to_light == pytest.approx(given.to_light, abs=1e-12)
                assert light["type"] == "directional"
                assert max(light["color"]) == 1
                lit = light["intensity"] * np.array(light["color"])
                assert lit == pytest.approx(lux * given.irradiance, rel=1e-12)
                extras = light["extras"]
                assert extras["angular_diameter"] == given.angular_diameter
                assert extras["irradiance"] == given.irradiance.tolist()
            assert parsed(path)["scenes"][0]["extras"]["sunsplit"]["lux"] == lux


def test_a_lamp_without_light_is_black(tmp_path):
    files = files_of(sky(sun(0.5, flux=(0.0, 0.0, 0.0))), tmp_path)
    ((_, light),) = lamps(parsed(files.lights))
    assert light["intensity"] == 0
    assert light["color"] == [0, 0, 0]


def test_wide_suns_are_painted_unless_told_otherwise(tmp_path):
    given = sky(sun(2.4), sun(2.6))
    files = files_of(given, tmp_path)
    assert len(lamps(parsed(files.lights))) == 1
    assert any("in the map" in line for line in files.losses)
    assert parsed(files.lights)["scenes"][0]["extras"]["sunsplit"]["losses"] == list(files.losses)
    assert files.map.is_file()
    files = files_of(given, tmp_path, discs="lights")
    assert len(lamps(parsed(files.lights))) == 2
    assert files.map is None
    assert not (tmp_path / "sky.gltf.exr").exists()


def test_extras_say_where_the_map_is_and_how_it_lies(tmp_path):
    given = sky(radiance=noise(16), turn=TURN, name="50% grün #1?", has_cells=True)
    files = files_of(given, tmp_path)
    for path in (files.lights, files.scene):
        told = parsed(path)["scenes"][0]["extras"]["sunsplit"]["map"]
        assert told["uri"].isascii()
        assert "#" not in told["uri"]
        assert "?" not in told["uri"]
        assert tmp_path / unquote(told["uri"]) == files.map
        assert files.map.is_file()
        assert told["blend_pixels"] is False
        rotation = Rotation.from_quat(told["rotation"])
        # What lies at +X of the unturned picture, its middle, is in the scene where `turn` puts it.
        middle = Y_UP.matrix.T @ rotation.apply([1, 0, 0])
        assert middle == pytest.approx(TURN @ [1, 0, 0], abs=1e-12)
        left = Y_UP.matrix.T @ rotation.apply([0, 0, -1])
        assert left == pytest.approx(TURN @ [0, 1, 0], abs=1e-12)


def test_nothing_is_said_of_a_map_that_is_not_there(tmp_path):
    files = files_of(sky(sun(0.5)), tmp_path)
    assert "map" not in parsed(files.lights)["scenes"][0]["extras"]["sunsplit"]


def test_meshes_are_the_stages(tmp_path):
    document = parsed(files_of(sky(), tmp_path).scene)
    (buffer,) = document["buffers"]
    data = base64.b64decode(buffer["uri"].partition(",")[2])

    def values(accessor: int) -> np.ndarray:
        accessor = document["accessors"][accessor]
        view = document["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        part = data[view["byteOffset"] :][: view["byteLength"]]
        return np.frombuffer(part, kind).reshape(accessor["count"], -1)

    for node in document["nodes"]:
        if "mesh" not in node:
            continue
        thing = STAGE.things[node["name"]]
        (primitive,) = document["meshes"][node["mesh"]]["primitives"]
        mesh = mesh_of(thing)
        found = values(primitive["attributes"]["POSITION"]) @ Y_UP.matrix
        assert found == pytest.approx(mesh.points, abs=1e-5)
        found = values(primitive["attributes"]["NORMAL"]) @ Y_UP.matrix
        assert found == pytest.approx(mesh.normals, abs=1e-6)
        assert (values(primitive["indices"])[:, 0] == mesh.triangles.ravel()).all()
        material = document["materials"][primitive["material"]]
        colour = material["pbrMetallicRoughness"]["baseColorFactor"]
        assert colour == [*thing.colour, 1]
    assert {node["name"] for node in document["nodes"]} == {*STAGE.things, "camera"}


SKIES = {
    "suns and a map": sky(sun(0.5), sun(0), sun(30), radiance=noise(32)),
    "no suns": sky(radiance=noise(32)),
    "no map": sky(sun(0.5), sun(0, (0, 0, -1.0))),
    "nothing": sky(),
    "an odd name": sky(sun(0.5), radiance=noise(16), name='"It\'s" ü 100% #1 日本 a b'),
    "cells, turned": sky(sun(0.5), radiance=noise(16), turn=TURN, has_cells=True),
    "black": sky(sun(0, flux=(0, 0, 0)), radiance=np.zeros((16, 32, 3), np.float32)),
    "bright": sky(sun(0.5, flux=(1e9, 1, 1)), radiance=noise(16) * np.float32(1e7)),
}


@pytest.mark.parametrize("name", SKIES)
def test_the_validator_has_nothing_against_it(tmp_path, name):
    files = files_of(SKIES[name], tmp_path)
    for path in (files.lights, files.scene):
        assert issues(validated(path), "errors", "warnings") == []


def test_the_validator_has_nothing_against_a_conversion(tmp_path, sunrise):
    files = files_of(skylight_of(convert(load(sunrise))), tmp_path)
    for path in (files.lights, files.scene):
        report = validated(path)
        assert issues(report, "errors", "warnings") == []
        assert report["info"]["version"] == "2.0"


def test_the_validator_can_find_something(tmp_path):
    document = parsed(files_of(sky(sun(0.5)), tmp_path).lights)
    document["nodes"][0]["rotation"] = [1, 1, 1, 1]
    wrong = tmp_path / "wrong.gltf"
    wrong.write_text(json.dumps(document))
    assert len(issues(validated(wrong), "errors")) == 1
