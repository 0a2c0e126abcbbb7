"""A map that is turned after the conversion turns its suns, as renders show them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from tests.blender import (
    add_mapping,
    add_mesh,
    camera_towards,
    fresh_scene,
    hdri_world,
    material,
    plate_mesh,
    render,
    suns,
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky

VIEW, PIXELS = 10.0, 160
"""Degrees across the picture, and pixels."""

TOLERANCE = 0.01
"""Degrees: what the project promises."""


def middle_of_sun(picture):
    """Degrees from the picture's left and upper edge."""
    light = picture.sum(axis=-1)
    light = np.maximum(light - 1.1 * np.median(light), 0)
    place = np.arange(PIXELS) + 0.5
    across, down = light.sum(axis=0) @ place, light.sum(axis=1) @ place
    return np.array([across, down]) / light.sum() * VIEW / PIXELS


@pytest.mark.parametrize("angles", [(0, 0, 2.2), (0.3, -0.4, -1.9)])
def test_suns_are_where_the_turned_map_shows_them(tmp_path, angles):
    """In a mirror, which shows the lamp once and the map once."""
    pixels = sky(1024, 0.3)
    paint_disc(pixels, direction(40, 25), 1.5, (900, 800, 700))
    scene = fresh_scene()
    mapping = add_mapping(hdri_world(scene, write_map(tmp_path / "map.exr", pixels)))
    original = scene.world
    bpy.ops.sunsplit.convert(lights=1)
    for world in (original, scene.world):
        world.node_tree.nodes[mapping.name].inputs["Rotation"].default_value = angles
    (lamp,) = suns(scene)
    towards = Vector(to_light(lamp))
    mirror = material("Mirror", (1, 1, 1), Metallic=1, Roughness=0)
    facing = towards.to_track_quat("Z", "Y").to_matrix().to_4x4()
    add_mesh(scene, plate_mesh(2), mirror, Matrix.Translation(-towards) @ facing)
    camera_towards(scene, -np.array(towards), VIEW, PIXELS)
    seen = middle_of_sun(render(scene, tmp_path, 32))
    scene.world = original
    lamp.hide_render = True
    expected = middle_of_sun(render(scene, tmp_path, 32))
    assert expected == pytest.approx([VIEW / 2, VIEW / 2], abs=0.2)
    assert seen == pytest.approx(expected, abs=TOLERANCE)
