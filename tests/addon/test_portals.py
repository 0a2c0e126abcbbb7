"""Portals where light comes into a room, made and taken away with a conversion."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon import known
from sunsplit.addon.restoring import restore_scene
from sunsplit.addon.scene import convert_scene
from sunsplit.core.settings import ConversionSettings
from tests.addon.test_convert import inventory
from tests.blender import (
    add_mesh,
    ball_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    material,
    plate_mesh,
    suns,
    write_map,
)
from tests.maps import direction, paint_disc, sky
from tests.rooms import WINDOW, close_with, portals, room


@pytest.fixture(scope="module")
def overcast(tmp_path_factory):
    """An even sky, with a faint sun behind the room."""
    pixels = sky(256, 1.0)
    paint_disc(pixels, direction(180, 40), 4, (200, 200, 200))
    return write_map(tmp_path_factory.mktemp("maps") / "overcast.exr", pixels)


@pytest.fixture
def scene(overcast):
    return room(overcast)


def axis(thing, number):
    return np.array(thing.matrix_world.col[number].xyz)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_portal_stands_in_the_window_and_looks_in(overcast, turn):
    scene = room(overcast, turn=turn)
    bpy.ops.sunsplit.convert()
    bpy.context.view_layer.update()
    (portal,) = portals(scene)
    around = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    middle, (width, height) = WINDOW
    found = around.T @ np.array(portal.matrix_world.translation)
    assert middle[0] - 0.01 < found[0] < middle[0] + 0.21  # anywhere in the wall
    assert found[1:] == pytest.approx(middle[1:], abs=0.05)
    assert -axis(portal, 2) == pytest.approx(around @ (-1, 0, 0), abs=1e-3)
    sizes = portal.data.size, portal.data.size_y
    across = abs(axis(portal, 0)[2]) < 0.5  # its width lies level
    assert (sizes if across else sizes[::-1]) == pytest.approx((width, height), rel=0.08)
    assert portal.data.energy == 0
    assert scene.world.cycles.sampling_method == "NONE"
    assert "Light comes in through 1 opening" in scene.sunsplit.report


def test_restore_takes_it_away_and_converting_again_makes_no_second_one(scene):
    before = inventory()
    for _ in range(2):
        bpy.ops.sunsplit.convert()
        assert len(portals(scene)) == 1
    bpy.ops.sunsplit.restore()
    assert not portals(scene)
    assert inventory() == before


def test_it_goes_after_saving_and_opening_again(scene, tmp_path):
    bpy.ops.sunsplit.convert()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "room.blend"))
    scene = bpy.context.scene
    assert [portal.name for portal in portals(scene)] == ["Sunsplit Portal 1"]
    bpy.ops.sunsplit.restore()
    assert not portals(scene)
    assert "Sunsplit Portals" not in bpy.data.collections


def test_what_the_user_has_put_beside_it_stays(scene):
    bpy.ops.sunsplit.convert()
    mine = bpy.data.objects.new("Mine", None)
    scene.sunsplit.portals_collection.objects.link(mine)
    bpy.ops.sunsplit.restore()
    assert mine.name in scene.collection.objects


def test_wherever_the_user_has_put_it_it_goes(scene):
    bpy.ops.sunsplit.convert()
    mine = bpy.data.collections.new("Mine")
    scene.collection.children.link(mine)
    (portal,) = portals(scene)
    scene.sunsplit.portals_collection.objects.unlink(portal)
    mine.objects.link(portal)
    bpy.ops.sunsplit.restore()
    assert not portals(scene)
    bpy.ops.sunsplit.convert()
    made = scene.sunsplit.portals_collection
    scene.collection.children.unlink(made)
    mine.children.link(made)
    bpy.ops.sunsplit.convert()
    assert len(portals(scene)) == 1
    bpy.ops.sunsplit.restore()
    assert not portals(scene)


def test_a_second_time_nothing_is_converted(scene, monkeypatch):
    bpy.ops.sunsplit.convert()
    report = scene.sunsplit.report
    monkeypatch.setattr(known, "convert", None)
    bpy.ops.sunsplit.convert()
    assert scene.sunsplit.report == report


def test_a_glass_ball_alone_before_the_map_is_no_room(overcast):
    scene = fresh_scene()
    hdri_world(scene, overcast)
    ball = material("Glass", (1, 1, 1), Roughness=0.0, Transmission_Weight=1)
    add_mesh(scene, ball_mesh(1), ball, Matrix())
    camera_towards(scene, np.array([1, 0, 0]), 40, 32).location = (-4, 0, 0)
    bpy.context.view_layer.update()
    bpy.ops.sunsplit.convert()
    assert not portals(scene)


def test_one_of_two_scenes_that_share_it_keeps_it(scene):
    bpy.ops.sunsplit.convert()
    made = scene.sunsplit.portals_collection
    other = bpy.data.scenes.new("Other")
    other.collection.children.link(made)
    bpy.ops.sunsplit.restore()
    assert portals(other)
    assert not portals(scene)


def test_portals_are_no_suns_and_hide_nothing(scene):
    bpy.ops.sunsplit.convert(lights=4)
    lamps = len(suns(scene))
    assert portals(scene)
    assert all(entry.lamp.data.type == "SUN" for entry in scene.sunsplit.lamps)
    bpy.ops.sunsplit.convert(lights=4)
    assert len(suns(scene)) == lamps


def glass(scene):
    close_with(scene, material("Glass", (1, 1, 1), Roughness=0.0, Transmission_Weight=1))


def users_portal(scene):
    data = bpy.data.lights.new("Mine", "AREA")
    data.cycles.is_portal = True
    scene.collection.objects.link(bpy.data.objects.new("Mine", data))


def moving_wall(scene):
    wall = next(thing for thing in scene.objects if thing.type == "MESH")
    wall.keyframe_insert("location", frame=1)


def no_roof(scene):
    roof = max((t for t in scene.objects if t.type == "MESH"), key=lambda t: t.location[2])
    bpy.data.objects.remove(roof)


def no_front(scene):
    """No wall around the window either."""
    for thing in [t for t in scene.objects if t.type == "MESH" and t.location[0] > 2]:
        bpy.data.objects.remove(thing)


def test_a_missing_wall_gets_a_portal_too(scene):
    no_front(scene)
    bpy.context.view_layer.update()
    found = convert_scene(scene, ConversionSettings()).conversion
    (portal,) = portals(scene)
    assert portal.data.size * portal.data.size_y == pytest.approx(4 * 2.6, rel=0.1)
    assert found.is_indoors


def eevee(scene):
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"


@pytest.mark.parametrize("change", [glass, users_portal, moving_wall, no_roof, eevee])
def test_none_are_made_where_they_would_not_help(scene, change):
    change(scene)
    bpy.context.view_layer.update()
    theirs = portals(scene)
    bpy.ops.sunsplit.convert()
    assert portals(scene) == theirs
    assert "portal" not in scene.sunsplit.report


def test_none_are_made_where_nothing_is_to_be_skipped(scene):
    bpy.ops.sunsplit.convert(skips=False)
    assert not portals(scene)


def test_through_a_pane_that_light_passes_straight(scene):
    close_with(scene, material("Pane", (1, 1, 1), Alpha=0.2))
    bpy.ops.sunsplit.convert()
    assert len(portals(scene)) == 1


def test_a_sun_through_the_window_that_gives_nearly_all_light_needs_none(tmp_path):
    pixels = sky(256, 0.01)
    paint_disc(pixels, direction(20, 35), 2, (5000, 5000, 5000))
    scene = room(write_map(tmp_path / "sunny.exr", pixels))
    bpy.ops.sunsplit.convert()
    assert suns(scene)
    assert not portals(scene)


@pytest.fixture
def even(tmp_path):
    """A bright cloud before the window, 7 % of all light: in the open it would be a lamp."""
    pixels = sky(256, 1.0)
    paint_disc(pixels, direction(10, 20), 6, (30, 30, 30))
    return room(write_map(tmp_path / "even.exr", pixels))


def test_through_a_portal_a_little_brighter_sky_gets_no_lamp_and_no_light_tree(even):
    even.cycles.use_light_tree = True
    bpy.ops.sunsplit.convert()
    assert len(portals(even)) == 1
    assert not suns(even)
    assert not even.cycles.use_light_tree
    assert "Skipped: the light tree" in even.sunsplit.report
    restore_scene(even)
    assert even.cycles.use_light_tree


def test_the_light_tree_stays_in_a_room_with_lamps_of_its_own(even):
    bulb = bpy.data.objects.new("Bulb", bpy.data.lights.new("Bulb", "POINT"))
    bulb.location = 0, 0, 2
    even.collection.objects.link(bulb)
    bpy.context.view_layer.update()
    even.cycles.use_light_tree = True
    bpy.ops.sunsplit.convert()
    assert len(portals(even)) == 1
    assert even.cycles.use_light_tree


def test_lamps_of_a_closed_scene_are_judged_where_light_comes_in(sunrise):
    """Whoever makes portals, and whatever part of the light is asked for."""
    cases = ((no_roof, {}), (None, {}), (users_portal, {}), (None, {"share": 0.7}))
    for change, chosen in cases:
        scene = room(sunrise)
        if change:
            change(scene)
        bpy.context.view_layer.update()
        known.forget()
        found = convert_scene(scene, ConversionSettings(**chosen)).conversion
        is_closed = change is not no_roof
        assert found.is_indoors == is_closed
        if change is users_portal:
            assert found.visible.through
        assert ("where light comes in" in scene.sunsplit.report) == is_closed
        assert ("level ground" in scene.sunsplit.report) != is_closed
        assert found.predicted_error <= 0.01


def test_lamps_are_chosen_anew_for_another_window(sunrise):
    scene = room(sunrise)
    first = convert_scene(scene, ConversionSettings()).conversion
    for thing in scene.objects:
        if thing.type == "MESH":
            thing.matrix_world = Matrix.Rotation(0.3, 4, "Z") @ thing.matrix_world
    bpy.context.view_layer.update()
    second = convert_scene(scene, ConversionSettings()).conversion
    assert second.is_indoors
    assert second.visible.indoors.key != first.visible.indoors.key
    assert second is not first


def test_where_the_map_turns_by_itself_lamps_are_made_for_all_that_may_come_in(scene):
    bpy.ops.sunsplit.convert()
    mapping = next(n for n in scene.world.node_tree.nodes if n.type == "MAPPING")
    mapping.inputs["Rotation"].keyframe_insert("default_value", index=2, frame=1)
    mapping.inputs["Rotation"].default_value[2] = 3.0
    mapping.inputs["Rotation"].keyframe_insert("default_value", index=2, frame=50)
    found = convert_scene(scene, ConversionSettings()).conversion
    assert found.suns
    assert not found.is_indoors


def test_a_turned_map_lights_the_same_places(sunrise):
    """What is told of openings is in the map's axes."""
    scene = room(sunrise)
    bpy.ops.sunsplit.convert()
    before = convert_scene(scene, ConversionSettings()).conversion.visible.indoors
    mapping = next(n for n in scene.world.node_tree.nodes if n.type == "MAPPING")
    mapping.inputs["Rotation"].default_value = (0, 0, 0.4)
    after = convert_scene(scene, ConversionSettings()).conversion.visible.indoors
    # The map is looked up 0.4 further on: what stands in the scene turns so in its axes.
    turn = np.array(Matrix.Rotation(0.4, 3, "Z"))
    assert after.places == pytest.approx(before.places @ turn.T, abs=1e-5)
    assert after.openings[0].inwards == pytest.approx(turn @ before.openings[0].inwards, abs=1e-5)


def test_a_ground_under_the_sky_has_no_openings(overcast):
    scene = fresh_scene()
    hdri_world(scene, overcast)
    add_mesh(scene, plate_mesh(40), diffuse("Ground", 0.5), Matrix())
    camera_towards(scene, np.array([0, 1, -1]), 40, 32).location = (0, -3, 3)
    bpy.context.view_layer.update()
    bpy.ops.sunsplit.convert()
    assert not portals(scene)
