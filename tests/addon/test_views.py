"""What a camera shows, by Blender's own word and by a render."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix

from sunsplit.addon.views import is_ordinary, view_of
from tests.blender import add_mesh, camera_towards, fresh_scene, material, plate_mesh, render

SIZES = [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (-2, -0.5, -3)]


@pytest.fixture
def scene():
    return fresh_scene()


def camera_of_size(scene, size):
    camera = camera_towards(scene, np.array([1, 0.3, 0.2]), 50, 32)
    camera.data.shift_x = 0.1
    camera.location, camera.scale = (1, 2, 3), size
    scene.render.resolution_y = 20
    bpy.context.view_layer.update()
    return camera


@pytest.mark.parametrize("size", SIZES)
def test_rays_go_through_the_picture(scene, size):
    camera = camera_of_size(scene, size)
    view = view_of(scene, camera)
    for across, down in ((0, 0), (0.2, 0.7), (1, 0.5)):
        start, direction = view.ray(across, down)
        assert direction.length == pytest.approx(1, abs=1e-6)
        x, y, depth = world_to_camera_view(scene, camera, start + 5 * direction)
        assert depth > 0
        assert (x, y) == pytest.approx((across, 1 - down), abs=1e-5)


@pytest.mark.parametrize("size", SIZES)
def test_a_render_shows_what_a_ray_meets(scene, tmp_path, size):
    """A small lamp of a plate, right in the way of a ray."""
    camera = camera_of_size(scene, size)
    start, direction = view_of(scene, camera).ray(0.2, 0.3)
    place = Matrix.Translation(start + 5 * direction) @ (
        direction.to_track_quat("Z", "Y").to_matrix().to_4x4()
    )
    glow = material("Glow", (0, 0, 0), Emission_Strength=1)
    glow.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 1, 1, 1)
    add_mesh(scene, plate_mesh(0.3), glow, place)
    pixels = render(scene, tmp_path, 16)[..., 0]
    row, column = np.array(np.nonzero(pixels > 0.5)).mean(axis=1)
    assert (column + 0.5) / 32 == pytest.approx(0.2, abs=0.04)
    assert (row + 0.5) / 20 == pytest.approx(0.3, abs=0.06)


def test_a_flattened_camera_is_not_ordinary(scene):
    assert is_ordinary(camera_of_size(scene, (1, 1, 1)))
    assert not is_ordinary(camera_of_size(scene, (1, 1, 0)))
    assert not is_ordinary(bpy.data.objects.new("Empty", None))
