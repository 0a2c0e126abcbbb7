"""A scene that an artist has changed, exported: Mitsuba renders what Cycles renders."""

from __future__ import annotations

import bpy
import pytest

from sunsplit.addon.controls import rotation_control
from tests.blender import fresh_scene, hdri_world, node, suns
from tests.exporting import MEAN, add_stage
from tests.mitsuba_renders import picture, renderer
from tests.render.compare import estimate, estimate_of, means_agree, pixels_agree


@pytest.fixture(scope="module", autouse=True)
def mitsuba():
    return renderer()


def changed_scene(hdri):
    """A converted scene, turned and dimmed; one lamp is red, wide and not followed any more."""
    scene = fresh_scene()
    hdri_world(scene, hdri)
    add_stage(scene)
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 7
    bpy.ops.sunsplit.convert(lights=3, skips=False)
    socket, component = rotation_control(scene.sunsplit)
    socket.default_value[component] = 2.2
    node(scene.world.node_tree, "BACKGROUND").inputs["Strength"].default_value = 0.6
    sky = scene.sunsplit.sky
    sky["strength"], sky["warmth"], sky["softness"] = 1.5, 0.3, 1.4
    sky.update_tag()
    by_hand = suns(scene)[1]
    by_hand.data.driver_remove("exposure")
    by_hand.data.exposure, by_hand.data.color = 0.5, (1, 0.2, 0.1)
    return scene


def test_a_scene_that_was_changed(sunrise, tmp_path):
    scene = changed_scene(sunrise)
    wanted = estimate(scene, tmp_path, samples=24)
    bpy.ops.sunsplit.export(format="mitsuba", discs="lights", directory=str(tmp_path))
    height, width = wanted.mean.shape[:2]
    path = tmp_path / f"{sunrise.stem}.scene.xml"
    found = estimate_of([picture(path, width, height, 16, seed) for seed in range(4)])
    means_agree(wanted, found, tmp_path, MEAN)
    pixels_agree(wanted, found, tmp_path, slack=0.05, outliers=0.02)
