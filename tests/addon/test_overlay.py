"""The overlay in a scene: which suns it shows, what a click selects, what travels with a file."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Vector

from sunsplit.addon import overlay
from sunsplit.addon.overlay.draw import Kept
from sunsplit.addon.overlay.image import border_layers, light_shown
from sunsplit.addon.overlay.pick import select, selects
from sunsplit.addon.overlay.suns import lit_place, on_screen, shown_suns
from sunsplit.core import ConversionSettings, convert, load, sphere
from sunsplit.core.outlines import Outlines, outlines_of
from tests.blender import add_mapping, fresh_scene, hdri_world, plate_mesh, write_map
from tests.maps import direction, paint_disc, sky

LIKE_THREE = ConversionSettings(lights=3, residual_width="own")


@pytest.fixture
def scene():
    return fresh_scene()


@pytest.fixture(scope="module")
def three_suns(tmp_path_factory):
    """A small map with a sun at the seam, one at a pole and a small one between."""
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(180, 20), 5, (900, 700, 500))
    paint_disc(pixels, direction(0, 88), 6, (200, 300, 900))
    paint_disc(pixels, direction(-50, 10), 1.5, (2000, 600, 50))
    return write_map(tmp_path_factory.mktemp("maps") / "three suns.exr", pixels)


@pytest.fixture
def converted(scene, three_suns):
    hdri_world(scene, three_suns)
    bpy.ops.sunsplit.convert(lights=3, skips=False)
    bpy.context.view_layer.update()
    return scene


def test_suns_are_the_lamps(converted):
    shown = shown_suns(bpy.context)
    assert list(shown.lamps) == [entry.lamp for entry in converted.sunsplit.lamps]
    assert shown.rank == (1, 2, 3)
    for lamp, to_light, half in zip(shown.lamps, shown.to_light, shown.half_angle, strict=True):
        assert to_light == pytest.approx(lamp.matrix_world.to_3x3() @ Vector((0, 0, 1)), abs=1e-6)
        assert half == pytest.approx(lamp.data.angle / 2)
    assert not shown.selected.any()
    assert shown.active is None


def test_a_turned_lamp_is_shown_where_it_shines_from(converted):
    holder = bpy.data.objects.new("Holder", None)
    converted.collection.objects.link(holder)
    lamp = converted.sunsplit.lamps[1].lamp
    before = shown_suns(bpy.context).to_light[1]
    lamp.parent = holder
    holder.rotation_euler.z = np.radians(90)
    bpy.context.view_layer.update()
    x, y, z = before
    assert shown_suns(bpy.context).to_light[1] == pytest.approx([-y, x, z], abs=1e-6)


def test_lamps_that_do_not_shine_are_not_shown(converted):
    first, second, third = (entry.lamp for entry in converted.sunsplit.lamps)
    first.hide_set(True)
    assert shown_suns(bpy.context).rank == (2, 3)
    bpy.data.objects.remove(second)
    assert shown_suns(bpy.context).lamps == (third,)
    bpy.context.view_layer.layer_collection.children[0].exclude = True
    assert len(shown_suns(bpy.context)) == 0


def test_lamps_of_another_view_layer_are_not_shown(scene, three_suns):
    hdri_world(scene, three_suns)
    bpy.ops.sunsplit.convert(lights=3, skips=False, two_passes=True)
    number = {
        layer.name: len(shown_suns(SimpleNamespace(scene=scene, view_layer=layer, space_data=None)))
        for layer in scene.view_layers
    }
    assert sorted(number.values()) == [0, 3]


def test_without_a_conversion_there_are_no_suns(scene):
    shown = shown_suns(bpy.context)
    assert len(shown) == 0
    assert shown.pointed_at == []


def test_rays_go_to_what_is_selected_or_else_to_the_brightest(converted):
    assert shown_suns(bpy.context).pointed_at == [0]
    for number in (1, 2):
        converted.sunsplit.lamps[number].lamp.select_set(True)
    assert shown_suns(bpy.context).pointed_at == [1, 2]


def test_what_is_lit_is_what_is_selected_or_else_the_cursor(converted):
    converted.cursor.location = 1, 2, 3
    shown = shown_suns(bpy.context)
    assert lit_place(bpy.context, shown) == pytest.approx([1, 2, 3])
    for x in (2, 4):
        thing = bpy.data.objects.new("Thing", plate_mesh(1))
        thing.location = x, 0, 1
        converted.collection.objects.link(thing)
        thing.select_set(True)
    shown.lamps[0].select_set(True)
    bpy.context.view_layer.update()
    assert lit_place(bpy.context, shown) == pytest.approx([3, 0, 1])


def test_colours_keep_their_hue_and_can_be_seen():
    shown = on_screen(np.array([[2.0, 1, 0], [0, 0, 0.01], [0, 0, 0]]))
    assert shown[0, 0] == pytest.approx(1)
    assert shown[0, 0] > shown[0, 1] > shown[0, 2] > 0.2
    assert shown[1, 2] == pytest.approx(1)
    assert shown[2] == pytest.approx(1)


def test_selecting_is_as_blender_selects(converted):
    layer = bpy.context.view_layer
    one, two, _ = (entry.lamp for entry in converted.sunsplit.lamps)
    select(layer, one, extend=False)
    assert list(layer.objects.selected) == [one]
    select(layer, two, extend=True)
    assert set(layer.objects.selected) == {one, two}
    assert layer.objects.active == two
    select(layer, two, extend=True)
    assert list(layer.objects.selected) == [one]
    select(layer, one, extend=True)  # not the active one yet
    assert list(layer.objects.selected) == [one]
    assert layer.objects.active == one


@pytest.mark.parametrize(("chosen", "button"), [("LEFT", "LEFTMOUSE"), ("RIGHT", "RIGHTMOUSE")])
def test_the_button_is_the_one_that_selects(chosen, button):
    preferences = SimpleNamespace(select_mouse=chosen)
    keyconfigs = SimpleNamespace(active=SimpleNamespace(preferences=preferences))
    context = SimpleNamespace(window_manager=SimpleNamespace(keyconfigs=keyconfigs))
    buttons = ("LEFTMOUSE", "RIGHTMOUSE")
    assert [selects(context, one) for one in buttons] == [one == button for one in buttons]


def test_without_an_editor_there_is_nothing_to_pick(converted):
    assert not bpy.ops.sunsplit.pick_sun.poll()


# The map and what has been made of it


def test_the_map_and_its_residual_show_the_suns_and_nothing_else_does(converted):
    world = converted.sunsplit.converted_world
    images = {node.image for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT"}
    assert len(images) == 2
    for image in images:
        assert light_shown(converted, image) is not None
    assert light_shown(converted, bpy.data.images.new("Other", 8, 4)) is None


def test_over_a_turned_map_suns_are_where_its_pixels_are(scene, three_suns):
    mapping = add_mapping(hdri_world(scene, three_suns))
    mapping.inputs["Rotation"].default_value = 0.3, -0.4, 1.1
    bpy.ops.sunsplit.convert(lights=3, skips=False)
    bpy.context.view_layer.update()
    shown = shown_suns(bpy.context)
    image = next(one for one in bpy.data.images if "three suns.exr" in one.name)
    light = light_shown(scene, image)
    found = shown.to_light @ light.map_from_world.T
    expected = [sun.to_light for sun in convert(load(three_suns), LIKE_THREE).suns]
    assert found == pytest.approx(np.array(expected), abs=1e-5)


def test_turning_the_world_turns_the_suns_and_not_the_map(scene, three_suns):
    mapping = add_mapping(hdri_world(scene, three_suns))
    bpy.ops.sunsplit.convert(lights=3, skips=False)
    bpy.context.view_layer.update()
    image = next(one for one in bpy.data.images if "three suns.exr" in one.name)

    def seen():
        to_light = shown_suns(bpy.context).to_light
        return to_light, to_light @ light_shown(scene, image).map_from_world.T

    before, on_map = seen()
    node = scene.sunsplit.converted_world.node_tree.nodes[mapping.name]
    node.inputs["Rotation"].default_value[2] = np.radians(70)
    bpy.context.view_layer.update()
    after, still_on_map = seen()
    assert np.degrees(sphere.angle_between(before, after))[0] > 30
    assert still_on_map == pytest.approx(on_map, abs=1e-6)


def test_a_world_that_lamps_cannot_follow_shows_none(converted):
    world = converted.sunsplit.converted_world
    (image,) = {
        node.image
        for node in world.node_tree.nodes
        if node.type == "TEX_ENVIRONMENT" and "Sunsplit" not in node.name
    }
    for node in world.node_tree.nodes:
        if node.type == "TEX_ENVIRONMENT":
            node.projection = "MIRROR_BALL"
    assert light_shown(converted, image) is None


def test_outlines_travel_with_the_file_and_go_with_restore(converted, three_suns, tmp_path):
    expected = outlines_of(convert(load(three_suns), LIKE_THREE))
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    fresh_scene()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    found = Outlines.from_text(scene.sunsplit.outlines)
    assert (found.region == expected.region).all()
    assert (found.cells == expected.cells).all()
    layers = border_layers(scene.sunsplit.outlines, 1.0)
    assert [len(layer.pieces) for layer in layers[2:]] == [len(found.region), len(found.cells)]
    bpy.ops.sunsplit.restore()
    assert scene.sunsplit.outlines == ""
    assert border_layers(scene.sunsplit.outlines, 1.0) == []


def test_a_drawing_is_made_again_only_after_a_change():
    made, drawn = [], []
    kept = Kept()

    def draw(region, key):
        def make():
            made.append(key)
            return SimpleNamespace(draw=lambda: drawn.append(key))

        kept.drawing(region, key, make).draw()

    for region, key in ((1, "a"), (1, "a"), (2, "b"), (1, "a"), (1, "c")):
        draw(region, key)
    assert made == ["a", "b", "c"]
    assert drawn == ["a", "a", "b", "a", "c"]
    for region in range(10, 10 + Kept.MOST):  # regions that were closed are not kept for ever
        draw(region, "d")
    draw(1, "c")
    assert made.count("c") == 2
    kept.forget()
    draw(1, "c")
    assert made.count("c") == 3


# Registering


def test_registering_loads_nothing_that_draws():
    code = (
        "import sys, bpy, sunsplit; sunsplit.register();"
        "loaded = [m for m in sys.modules if m.startswith('sunsplit.addon.overlay.')];"
        "print('loaded', loaded, 'gpu_extras' in sys.modules, 'scipy' in sys.modules);"
        "sunsplit.unregister()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120
    )
    assert "loaded [] False False" in done.stdout


def test_handlers_come_and_go():
    fresh_scene()
    assert len(overlay._handlers) == 2
    overlay.unregister()
    assert not overlay._handlers
    overlay.register()
    assert len(overlay._handlers) == 2


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="no graphics without a window before 5.2")
def test_what_is_drawn(tmp_path):
    """On a real graphics context: in a process of its own, as it may end with that."""
    path = tmp_path / "drawn.npy"
    command = [sys.executable, "-m", "tests.addon.draw_overlay", str(path)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    drawn = np.load(path).astype(int)
    red, green, blue = np.moveaxis(drawn[..., :3], -1, 0)
    rows, columns = np.indices(red.shape)
    away = np.hypot(columns + 0.5 - 200, rows + 0.5 - 150)
    # The sun's outline, 60 pixels from its middle, in its colour: orange, on grey.
    on_line = np.abs(away - 60.2) < 0.5
    assert np.median(red[on_line]) > 240
    assert 140 < np.median(green[on_line]) < 200
    assert np.median(blue[on_line]) < 100
    # It is closed, and has a dark rim on both sides.
    turn = np.arctan2(rows - 150, columns - 200)
    assert np.diff(np.sort(turn[on_line & (red > 200)])).max() < 0.1
    for rim in (57.9, 62.1):
        assert np.median(red[np.abs(away - rim) < 0.3]) < 90
    # A dot in the middle, and nothing between.
    assert red[150, 200] > 240
    between = (away > 10) & (away < 50) & (rows < 150)
    assert (drawn[between][:, :3] == 128).all()
    # A plate with light letters on it, above to the right of the middle.
    label = drawn[155:180, 205:330, 0]
    assert label.min() < 60
    assert label.max() > 200
