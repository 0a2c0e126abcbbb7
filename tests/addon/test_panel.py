"""Presets and operators of the panels; how these look is tested in a window (tests/gui)."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from sunsplit import addon
from sunsplit.addon import panel, presets
from sunsplit.addon.options import settings_for
from sunsplit.addon.properties import CHOICES
from tests.blender import fresh_scene, hdri_world, suns, write_map
from tests.maps import direction, paint_disc, sky

SHIPPED = sorted((Path(presets.FOLDER) / "presets" / "sunsplit").glob("*.py"))


@pytest.fixture
def scene():
    return fresh_scene()


@pytest.fixture(scope="module")
def three_suns(tmp_path_factory):
    """One wide and bright, two narrow."""
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(40, 30), 8, (300, 300, 300))
    paint_disc(pixels, direction(-100, 20), 2, (900, 900, 900))
    paint_disc(pixels, direction(150, 50), 2, (400, 400, 400))
    return write_map(tmp_path_factory.mktemp("maps") / "three suns.exr", pixels)


def test_the_panels_of_both_places_are_the_same():
    for mine, other in (("main", "world"), ("suns", "world_suns"), ("settings", "world_settings")):
        first, second = (getattr(panel, f"SUNSPLIT_PT_{name}") for name in (mine, other))
        assert first.draw is second.draw
        assert first.bl_space_type != second.bl_space_type


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_each_preset_that_ships_sets_every_setting_to_something_good(scene, path):
    text = path.read_text(encoding="utf-8")
    assert all(f"settings.{name} = " in text for name in CHOICES)
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname="SUNSPLIT_PT_presets")
    chosen = {name: getattr(scene.sunsplit, name) for name in CHOICES}
    settings_for(chosen, scene.render.engine)  # or it would raise


def test_the_default_preset_is_the_defaults(scene):
    settings = scene.sunsplit
    before = {name: getattr(settings, name) for name in CHOICES}
    settings.lights, settings.method = 7, "kmeans"
    (default,) = [path for path in SHIPPED if path.stem == "Default"]
    bpy.ops.script.execute_preset(filepath=str(default), menu_idname="SUNSPLIT_PT_presets")
    assert {name: getattr(settings, name) for name in CHOICES} == before


def test_presets_are_found_by_blender(scene):
    assert [Path(path).name for path in bpy.utils.preset_paths("sunsplit")] == ["sunsplit"]


@pytest.mark.parametrize(
    ("which", "expected"), [("all", 3), ("brightest", 1), ("sharp", 2), ("soft", 1)]
)
def test_suns_are_selected_by_size(scene, three_suns, which, expected):
    hdri_world(scene, three_suns)
    bpy.ops.sunsplit.convert(lights=3)
    bpy.ops.sunsplit.select_suns(which=which)
    selected = bpy.context.view_layer.objects.selected
    assert len(selected) == expected
    assert bpy.context.view_layer.objects.active == suns(scene)[{"sharp": 1}.get(which, 0)]


def test_factors_are_reset(scene, three_suns):
    hdri_world(scene, three_suns)
    bpy.ops.sunsplit.convert()
    sky_ = scene.sunsplit.sky
    sky_["strength"], sky_["warmth"], sky_["softness"] = 2.0, 0.5, 3.0
    bpy.ops.sunsplit.reset_factors()
    assert (sky_["strength"], sky_["warmth"], sky_["softness"]) == (1, 0, 1)


def test_what_operators_need_is_said(scene, three_suns):
    hdri_world(scene, three_suns)
    for name in ("select_suns", "reset_factors", "restore"):
        with pytest.raises(RuntimeError, match=r"not converted|convert the world first"):
            getattr(bpy.ops.sunsplit, name)()


def test_everything_has_a_tooltip(scene):
    for cls in addon.CLASSES:
        if issubclass(cls, bpy.types.Operator):
            name = cls.bl_idname.removeprefix("sunsplit.")
            assert getattr(bpy.ops.sunsplit, name).get_rna_type().description, name
    kinds = scene.sunsplit.bl_rna, bpy.ops.sunsplit.select_suns.get_rna_type()
    for kind in kinds:
        for known in kind.properties:
            shown = not known.is_readonly and known.identifier not in ("rna_type", "name", "lamps")
            if shown and known.type != "POINTER":
                assert known.description, known.identifier
                items = known.enum_items if known.type == "ENUM" else ()
                assert all(item.description for item in items), known.identifier
