"""EEVEE's settings and its lamps' shadows: set up by a conversion, put back by Restore."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon import eevee
from tests.blender import (
    add_mesh,
    ball_mesh,
    box_mesh,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    node,
    suns,
    write_map,
)
from tests.maps import direction, paint_disc, sky

EEVEE = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"


@pytest.fixture
def scene(tmp_path):
    """A small sun and a wide one, nothing else; EEVEE set up as nobody would."""
    made = fresh_scene()
    pixels = sky(256, 0.0)
    paint_disc(pixels, direction(40, 30), 1, (9000, 9000, 9000))
    paint_disc(pixels, direction(-100, 40), 20, (10, 10, 10))
    hdri_world(made, write_map(tmp_path / "map.exr", pixels))
    add_mesh(made, box_mesh(10, 10, 0.1), diffuse("Box", 0.5), Matrix())
    made.eevee.use_shadows = False
    made.eevee.shadow_step_count = 3
    made.eevee.shadow_pool_size = "64"
    made.eevee.clamp_surface_indirect = 7.5
    return made


def state(scene) -> dict[str, object]:
    """All of EEVEE's settings that can be set."""
    settings = scene.eevee
    names = [p.identifier for p in settings.bl_rna.properties if not p.is_readonly]
    return {name: getattr(settings, name) for name in names}


@pytest.mark.parametrize("target", ["eevee", "both"])
def test_restore_puts_back_all_that_was_changed(scene, target):
    before = state(scene)
    bpy.ops.sunsplit.convert(target=target)
    assert scene.eevee.use_shadows
    assert scene.eevee.shadow_step_count == 16
    assert scene.eevee.clamp_surface_indirect == 0
    bpy.ops.sunsplit.convert(target=target)  # again: what there was first is what counts
    bpy.ops.sunsplit.convert(target="cycles")
    assert state(scene) == before
    bpy.ops.sunsplit.convert(target=target)
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def test_it_is_put_back_after_the_file_was_saved_and_opened(scene, tmp_path):
    before = state(scene)
    bpy.ops.sunsplit.convert(target="eevee")
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.ops.sunsplit.restore()
    assert state(bpy.context.scene) == before


def test_for_cycles_alone_eevee_is_left_as_it_is(scene):
    before = state(scene)
    bpy.ops.sunsplit.convert(target="cycles")
    assert state(scene) == before


def test_where_eevee_renders_it_is_set_up_for_any_target(scene):
    scene.render.engine = EEVEE
    bpy.ops.sunsplit.convert(target="cycles")
    assert scene.eevee.use_shadows


def test_better_settings_of_the_user_stay(scene):
    scene.eevee.shadow_pool_size = "1024"
    bpy.ops.sunsplit.convert(target="eevee")
    assert scene.eevee.shadow_pool_size == "1024"


def test_wide_lamps_have_coarse_maps_and_jitter(scene):
    bpy.ops.sunsplit.convert(target="eevee", lights=2)
    by_width = sorted(suns(scene), key=lambda lamp: lamp.data.angle)
    narrow, wide = (lamp.data for lamp in by_width)
    assert narrow.use_shadow
    assert wide.use_shadow
    assert not narrow.use_shadow_jitter
    assert wide.use_shadow_jitter
    assert narrow.shadow_maximum_resolution == pytest.approx(eevee.FINEST)
    across = np.linalg.norm((20, 20, 0.2))
    expected = np.tan(wide.angle / 2) * across / eevee.TEXELS
    assert wide.shadow_maximum_resolution == pytest.approx(expected, rel=1e-5)


def test_many_lamps_have_room_for_their_maps(scene, sunrise):
    hdri_world(scene, sunrise)
    bpy.ops.sunsplit.convert(target="eevee", lights=30)
    assert int(scene.eevee.shadow_pool_size) >= eevee.MEGABYTES * len(suns(scene)) > 512


def test_an_empty_scene_is_set_up_too(scene):
    bpy.data.objects.remove(bpy.data.objects["Box"])
    bpy.ops.sunsplit.convert(target="eevee")
    assert all(lamp.data.shadow_maximum_resolution > 0 for lamp in suns(scene))


def test_all_light_is_in_lamps_unless_something_mirrors(scene, sunrise):
    hdri_world(scene, sunrise)
    bpy.ops.sunsplit.convert(target="eevee")
    assert "100.0% of all light" in scene.sunsplit.report
    assert "nothing mirrors sharply, so all light is in lamps" in scene.sunsplit.report
    mirror = material("Mirror", (0.9, 0.9, 0.9), Metallic=1, Roughness=0.0)
    add_mesh(scene, ball_mesh(1), mirror, Matrix())
    bpy.ops.sunsplit.convert(target="eevee")
    assert "100.0% of all light" not in scene.sunsplit.report
    assert "all light is in lamps" not in scene.sunsplit.report
    bpy.ops.sunsplit.convert(target="eevee", skips=False)
    assert "all light is in lamps" not in scene.sunsplit.report


def test_what_eevee_would_cut_off_is_said(scene, sunrise):
    hdri_world(scene, sunrise)  # brighter than half floats hold
    bpy.ops.sunsplit.convert(target="eevee", share=0)
    assert "which EEVEE cuts off" in scene.sunsplit.report
    bpy.ops.sunsplit.convert(target="eevee", share=0.5)
    assert "cuts off" not in scene.sunsplit.report
    node(scene.world.node_tree, "BACKGROUND").inputs["Strength"].default_value = 1e5
    bpy.ops.sunsplit.convert(target="eevee", share=0.5)
    assert "which EEVEE cuts off" in scene.sunsplit.report


@pytest.mark.parametrize(
    ("target", "engine", "meant"),
    [
        ("auto", EEVEE, "eevee"),
        ("auto", "CYCLES", "cycles"),
        ("auto", "BLENDER_WORKBENCH", "cycles"),
        ("both", EEVEE, "both"),
        ("cycles", EEVEE, "cycles"),
    ],
)
def test_what_automatic_stands_for(target, engine, meant):
    assert eevee.target_for(target, engine) == meant
