"""Two passes against one, and light groups against the picture: the light is the same."""

from __future__ import annotations

import bpy
import numpy as np
import OpenEXR
import pytest
from mathutils import Matrix

from tests.blender import (
    add_mesh,
    ball_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    plate_mesh,
    write_map,
)
from tests.maps import direction, paint_disc, sky
from tests.render.compare import estimate, means_agree, pixels_agree

MOVE = Matrix.Translation


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A sloping sky with a warm key light and a cold one."""
    pixels = sky(256, 0.0) + np.linspace(0.5, 0.1, 128)[:, None, None] * (0.8, 1, 1.2)
    paint_disc(pixels, direction(-50, 35), 4, (300, 250, 180))
    paint_disc(pixels, direction(80, 15), 5, (20, 40, 70))
    return write_map(tmp_path_factory.mktemp("maps") / "studio.exr", pixels)


@pytest.fixture
def scene(studio):
    """Balls on a ground; above it the camera sees the sky, with a sun in it."""
    made = fresh_scene()
    hdri_world(made, studio)
    add_mesh(made, plate_mesh(3), diffuse("Ground", 0.6), Matrix())
    add_mesh(made, ball_mesh(0.6), diffuse("Ball", 0.7), MOVE((0, 0.7, 0.6)))
    satin = material("Satin", (0.9, 0.8, 0.6), Roughness=0.6)
    add_mesh(made, ball_mesh(0.6), satin, MOVE((0, -0.7, 0.6)))
    away = direction(-50, 5)
    camera_towards(made, away, 75, 48).location = (*(-3 * away[:2]), 0.9)
    return made


def show_the_sky(scene):
    assert not scene.render.film_transparent


def have_a_transparent_film(scene):
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = "RGBA"


def add_other_lights(scene):
    """One lamp, and one thing that glows; no sun in the picture to outshine them."""
    have_a_transparent_film(scene)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy, lamp.location = 60, (0, 0, 2)
    scene.collection.objects.link(lamp)
    glowing = material("Glowing", (1, 1, 1), Emission_Strength=3)
    add_mesh(scene, ball_mesh(0.3), glowing, MOVE((1, 0, 0.3)))


@pytest.mark.parametrize("change", [show_the_sky, have_a_transparent_film, add_other_lights])
def test_two_passes_show_what_one_does(tmp_path, scene, change):
    change(scene)
    scene.cycles.samples = samples = 128
    bpy.ops.sunsplit.convert()
    one = estimate(scene, tmp_path, samples)
    bpy.ops.sunsplit.convert(two_passes=True)
    assert len(scene.view_layers) == 2
    two = estimate(scene, tmp_path, samples)
    means_agree(one, two, tmp_path)
    pixels_agree(one, two, tmp_path, slack=0.02)
    if scene.render.film_transparent:
        assert 0.2 < one.mean[..., 3].mean() < 0.8
        assert two.mean[..., 3] == pytest.approx(one.mean[..., 3], abs=0.05)


def layers(scene, folder) -> dict[str, np.ndarray]:
    """All passes of a render, float64 (height, width, 3), by the names of layer and pass."""
    settings = scene.render.image_settings
    if bpy.app.version >= (5, 0):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.filepath = str(folder / "layers.exr")
    bpy.ops.render.render(write_still=True)
    with OpenEXR.File(scene.render.filepath, separate_channels=True) as file:
        found = {name: made.pixels for part in file.parts for name, made in part.channels.items()}
    names = {name.rpartition(".")[0] for name in found if name.endswith(".R")}
    return {
        name: np.stack([found[f"{name}.{one}"] for one in "RGB"], axis=-1).astype(np.float64)
        for name in names
    }


@pytest.mark.parametrize("two_passes", [False, True])
def test_light_groups_add_up_to_the_picture(tmp_path, scene, two_passes):
    scene.cycles.samples = 16
    bpy.ops.sunsplit.convert(light_groups=True, two_passes=two_passes)
    found = layers(scene, tmp_path)
    for layer in scene.view_layers:
        suns, rest, whole = (
            found[f"{layer.name}.{name}"] for name in ("Combined_Suns", "Combined_Sky", "Combined")
        )
        assert suns + rest == pytest.approx(whole, rel=1e-4, abs=1e-4)
        assert suns.any() == (layer.name != "ViewLayer" or not two_passes)
        assert rest.any() == (layer.name == "ViewLayer")
