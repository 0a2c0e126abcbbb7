"""Babylon.js, whose makers wrote EXT_lights_image_based, shows the light that was exported."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sunsplit.core import ExportSettings, export_conversion, sphere
from sunsplit.core.export.skylight import Skylight
from sunsplit.core.suns import point_sun
from tests.babylon import MATT, MIRROR, seen_on_a_ball
from tests.plates import ORIENTATIONS, irradiance_by, unit

TURN = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix()

WAYS = np.array([unit(v) for v in (*ORIENTATIONS.values(), (2, -5, 1), (-3, 1, 9), (1, 6, -2))])

DULL = 0.9735
"""Of its matt surfaces' albedo, at the roughness of 1, seen along the normal (Babylon.js 9)."""


def sky(*suns, radiance=None) -> Skylight:
    return Skylight("sky", suns, radiance, False, TURN)


def colourful() -> np.ndarray:
    """A map whose colour tells the direction: 1 + 0.9 x, 1 + 0.9 y, 1 + 0.9 z."""
    directions = sphere.pixel_directions(np.arange(256 * 512), 512, 256)
    return (1 + 0.9 * directions).reshape(256, 512, 3).astype(np.float32)


@pytest.fixture
def lights(tmp_path):
    given = sky(radiance=colourful())
    return export_conversion(given, tmp_path, ExportSettings("gltf", lux=1)).lights


def test_a_mirror_shows_the_map_where_it_is(lights):
    found = seen_on_a_ball(lights, WAYS, MIRROR)
    assert (found - 1) / 0.9 == pytest.approx(WAYS @ TURN, abs=0.03)


def test_a_matt_ball_gets_the_maps_irradiance(lights):
    found = seen_on_a_ball(lights, WAYS, MATT)
    wanted = np.array([irradiance_by(colourful(), TURN.T @ way) for way in WAYS]) / np.pi
    assert found / wanted == pytest.approx(np.full(wanted.shape, DULL), rel=5e-3)


def test_a_matt_ball_gets_the_suns_irradiance(tmp_path):
    sun = point_sun(np.array([3.0, 2.0, 1.0]), np.array([0.36, 0.48, 0.8]), 1)
    lights = export_conversion(sky(sun), tmp_path, ExportSettings("gltf", lux=1)).lights
    found = seen_on_a_ball(lights, WAYS, MATT)
    wanted = np.maximum(WAYS @ sun.to_light, 0)[:, None] * sun.irradiance / np.pi
    assert found == pytest.approx(DULL * wanted, rel=5e-3, abs=1e-3)
