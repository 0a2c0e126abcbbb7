"""The image-based light of glTF, unpacked as Babylon.js does, against the map it was made of."""

from __future__ import annotations

import base64
import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.transform import Rotation

from sunsplit.core import ExportSettings, convert, export_conversion, load, skylight_of, sphere
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.export.axes import Y_UP
from sunsplit.core.export.gltf.cube import cube_directions
from sunsplit.core.export.gltf.glossy import blurred
from sunsplit.core.export.gltf.harmonics import harmonics, irradiance_harmonics
from sunsplit.core.export.gltf.rgbd import packed, unpacked
from sunsplit.core.export.lookup import narrower
from sunsplit.core.export.skylight import Skylight
from tests.files import noise
from tests.plates import irradiance_by

TURN = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix()

BABYLON = np.diag([-1.0, 1.0, 1.0]) @ Y_UP.matrix
"""From the scene to where Babylon.js, left-handed, has it."""


def ways(count: int = 100) -> np.ndarray:
    """Unit vectors all over the sphere, (count, 3)."""
    found = np.random.default_rng(1).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def directions_of(height: int) -> np.ndarray:
    found = sphere.pixel_directions(np.arange(2 * height**2), 2 * height, height)
    return found.reshape(height, 2 * height, 3)


def linear(height: int = 64) -> np.ndarray:
    """A map whose colour tells the direction: 1 + 0.9 x, 1 + 0.9 y, 1 + 0.9 z."""
    return (1 + 0.9 * directions_of(height)).astype(np.float32)


def light_of(radiance: np.ndarray, folder, turn=None, lux: float = 1.0, has_cells=False):
    """The image-based light of a file, and its levels as pictures, (6, side, side, 4) bytes."""
    sky = Skylight("sky", (), radiance, has_cells, np.eye(3) if turn is None else turn)
    path = export_conversion(sky, folder, ExportSettings("gltf", lux=lux)).lights
    document = json.loads(path.read_text(encoding="utf-8"))
    (light,) = document["extensions"]["EXT_lights_image_based"]["lights"]
    assert document["scenes"][0]["extensions"]["EXT_lights_image_based"] == {"light": 0}
    levels = []
    for level in light["specularImages"]:
        uris = [document["images"][index]["uri"] for index in level]
        files = [base64.b64decode(uri.removeprefix("data:image/png;base64,")) for uri in uris]
        levels.append(np.stack([np.array(Image.open(io.BytesIO(file))) for file in files]))
    return light, levels


def irradiance_of(light: dict, normals: np.ndarray) -> np.ndarray:
    """As Babylon.js evaluates it, of normals in the scene."""
    coefficients = np.array(light["irradianceCoefficients"]) * light["intensity"]
    return harmonics(normals @ BABYLON.T) @ coefficients


@pytest.mark.parametrize("turn", [None, TURN], ids=["unturned", "turned"])
@pytest.mark.parametrize("lux", [1.0, 683.0])
def test_irradiance_of_a_map_of_degree_two_is_exact(tmp_path, turn, lux):
    x, y, z = np.moveaxis(directions_of(128), -1, 0)
    colours = [2 + x + 0.5 * y * z, 2.5 - y + 0.7 * (x * x - y * y), 3 + z * x - 0.4 * z * z]
    radiance = np.stack(colours, axis=-1).astype(np.float32)
    light, _ = light_of(radiance, tmp_path, turn, lux)
    turn = np.eye(3) if turn is None else turn
    wanted = [lux * irradiance_by(radiance, turn.T @ normal) for normal in ways()]
    assert irradiance_of(light, ways()) == pytest.approx(np.array(wanted), rel=5e-4)


def test_irradiance_of_a_real_map_is_its_best_fit(tmp_path, sunrise):
    radiance = narrower(skylight_of(convert(load(sunrise))).radiance, 256).astype(np.float32)
    light, _ = light_of(radiance, tmp_path)
    normals = ways(400)
    wanted = np.array([irradiance_by(radiance, normal) for normal in normals])
    basis = harmonics(normals)
    best = basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
    errors = [
        np.abs(found - wanted) / wanted.mean(0) for found in (irradiance_of(light, normals), best)
    ]
    means = [error.mean() for error in errors]
    print(f"mean error {means[0]:.2%}, best {means[1]:.2%}, highest {errors[0].max():.2%}")
    assert means[0] < 1.05 * means[1]
    assert means[0] < 0.02


def test_pictures_lie_as_babylon_lays_them(tmp_path):
    """By hand: a face's middle, what is above it and to its right, in glTF's axes. Rows run upwards
    in the file, and the cube is left-handed: its X is -X."""
    _, levels = light_of(linear(), tmp_path)
    towards = (unpacked(levels[0]) - 1) / 0.9 @ Y_UP.matrix.T
    middles = [face[127:129, 127:129].mean(axis=(0, 1)) for face in towards]
    x, y, z = np.eye(3)
    assert np.array(middles) == pytest.approx(np.array([-x, x, y, -y, z, -z]), abs=0.02)
    above = [face[-1, 127:129].mean(axis=0) for face in towards]
    diagonals = [-x + y, x + y, y - z, -y + z, z + y, -z + y]
    assert np.array(above) == pytest.approx(np.array(diagonals) / np.sqrt(2), abs=0.02)
    right = [face[127:129, -1].mean(axis=0) for face in towards]
    diagonals = [-x - z, x + z, y - x, -y - x, z - x, -z + x]
    assert np.array(right) == pytest.approx(np.array(diagonals) / np.sqrt(2), abs=0.02)


@pytest.mark.parametrize("turn", [None, TURN], ids=["unturned", "turned"])
def test_levels_are_what_rougher_surfaces_mirror(tmp_path, turn):
    """A map that is linear in direction is still so, by the mean cosine under the weight."""
    light, levels = light_of(linear(), tmp_path, turn)
    assert light["specularImageSize"] == 256
    assert [level.shape[1] for level in levels] == [256, 128, 64, 32, 16]
    turn = np.eye(3) if turn is None else turn
    for level, alpha in zip(levels, (0, 1 / 64, 1 / 16, 1 / 4, 1), strict=True):
        asked = cube_directions(level.shape[1])[:, ::-1] @ BABYLON @ turn
        asked /= np.linalg.norm(asked, axis=-1, keepdims=True)
        found = (unpacked(level) - 1) / 0.9
        error = np.abs(found - mean_cosine(alpha) * asked)
        assert error.max() < 0.03
        assert error.mean() < 0.006


def mean_cosine(alpha: float) -> float:
    """Of what a surface mirrors that is looked at along its normal, by half vectors of GGX."""
    if not alpha:
        return 1.0
    part = (np.arange(200000) + 0.5) / 200000
    cosine = np.sqrt((1 - part) / (1 + (alpha**2 - 1) * part))  # of half vectors drawn by GGX
    light = 2 * cosine**2 - 1
    weight = np.maximum(light, 0)
    return float((weight * light).sum() / weight.sum())


@pytest.mark.parametrize("alpha", [1 / 64, 1 / 16, 1 / 4, 1.0])
def test_a_blur_keeps_what_is_even_and_the_light(alpha):
    height = 64 if alpha > 0.1 else 128
    even = np.full((height, 2 * height, 3), 3.0)
    assert blurred(even, alpha) == pytest.approx(even, rel=1e-12)
    uneven = narrower(noise(256), 2 * height)
    kept = scalar_irradiance(blurred(uneven, alpha).astype(np.float32))
    assert kept == pytest.approx(scalar_irradiance(uneven.astype(np.float32)), rel=2e-3)


@pytest.mark.parametrize("width", [512, 64, 100, 38, 2])
def test_a_narrower_map_has_the_same_light(width):
    given = noise(256)
    found = narrower(given, width)
    assert found.shape == (width // 2, width, 3)
    wanted = scalar_irradiance(given)
    assert scalar_irradiance(found.astype(np.float32)) == pytest.approx(wanted, rel=1e-6)


def test_a_narrower_map_is_the_mean_of_blocks():
    given = noise(8)
    solid = sphere.row_solid_angles(16, 8)[:, None, None]
    blocks = (given * solid).reshape(4, 2, 8, 2, 3).sum(axis=(1, 3))
    wanted = blocks / (2 * solid.reshape(4, 2, 1, 1)).sum(axis=1)
    assert narrower(given, 8) == pytest.approx(wanted, rel=1e-6)


@given(
    st.lists(st.floats(0.02, 255), min_size=3, max_size=3),
)
def test_rgbd_says_colours_within_a_few_percent(colour):
    found = unpacked(packed(np.array(colour)))
    assert found.max() == pytest.approx(max(colour), rel=0.04)
    assert found == pytest.approx(np.array(colour), rel=0.04, abs=0.02 * max(colour))


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("lux", [1.0, 683.0])
def test_dark_and_bright_maps_fit(tmp_path, factor, lux):
    """Also one whose brightest pixel is a thousand times the rest."""
    radiance = linear() * np.float32(factor)
    radiance[20:23, 30:33] *= 1000
    light, levels = light_of(radiance, tmp_path, lux=lux)
    rough = light["intensity"] * unpacked(levels[-1])
    mirrored = lux * blurred(narrower(radiance, 64), 1.0)
    assert rough.max() == pytest.approx(mirrored.max(), rel=0.05)
    assert rough.mean() == pytest.approx(mirrored.mean(), rel=0.1)


def test_what_fits_needs_no_intensity(tmp_path):
    """Babylon.js 9 would multiply irradiance by it twice."""
    assert light_of(linear(), tmp_path)[0]["intensity"] == 1
    assert light_of(linear() * np.float32(100), tmp_path)[0]["intensity"] == 1
    assert light_of(linear() * np.float32(200), tmp_path)[0]["intensity"] > 1
    assert light_of(linear() * np.float32(0.001), tmp_path)[0]["intensity"] < 1


def test_cells_are_not_blended(tmp_path):
    radiance = np.ones((16, 32, 3), np.float32)
    radiance[:, ::2] = 3
    _, levels = light_of(radiance, tmp_path, has_cells=True)
    side = unpacked(levels[0])[0, 128, :, 0]
    between = (side > 1.05) & (side < 2.9)
    assert between.mean() < 0.05


def test_harmonics_are_orthonormal():
    directions = directions_of(128).reshape(-1, 3)
    solid = np.repeat(sphere.row_solid_angles(256, 128), 256)
    unit = directions / np.linalg.norm(directions, axis=1)[:, None]
    basis = harmonics(unit)
    assert basis.T @ (basis * solid[:, None]) == pytest.approx(np.eye(9), abs=2e-4)


def test_irradiance_of_an_even_sky_is_pi():
    even = np.ones((64, 128, 3), np.float32)
    found = harmonics(ways()) @ irradiance_harmonics(even, np.eye(3))
    assert found == pytest.approx(np.full((100, 3), np.pi), rel=3e-4)
