"""Scenes in which something moves are looked at in several frames, and left as they were."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from sunsplit.addon.moments import FEWEST, MOST
from sunsplit.addon.rays import Reach
from sunsplit.addon.scene_needs import needs_of
from sunsplit.addon.steps import run_at_once
from tests.blender import (
    add_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    suns,
    to_light,
    write_map,
)
from tests.maps import direction, paint_disc, sky

TO_DOOR, BEHIND = direction(0, 20), direction(180, -50)
"""Where the two suns are: the door is towards +X."""


@pytest.fixture(scope="module")
def two_suns(tmp_path_factory):
    pixels = sky(256, 0.3)
    for towards in (TO_DOOR, BEHIND):
        paint_disc(pixels, towards, 2, (900, 800, 700))
    return write_map(tmp_path_factory.mktemp("maps") / "two.exr", pixels)


@pytest.fixture
def scene(two_suns):
    """A room of five sides, closed by a door towards +X; a camera in it that looks away from it."""
    made = fresh_scene()
    hdri_world(made, two_suns)
    corners = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
    mesh = bpy.data.meshes.new("Room")
    sides = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4)]
    mesh.from_pydata((2 * corners).tolist(), [], sides)
    add_mesh(made, mesh, diffuse("Wall", 0.5), Matrix())
    door = add_mesh(made, box_mesh(0.01, 4, 4), diffuse("Door", 0.5), Matrix())
    door.name, door.location = "Door", (2.005, 2, -4)
    door.data.transform(Matrix.Translation((0, -2, 0)))  # it turns about its side
    camera_towards(made, np.array([-1, 0, 0]), 50, 32)
    made.frame_end = 100
    bpy.context.view_layer.update()
    return made


def turn(thing, ends, frames=(1, 100), axis=2):
    """Keys of a turn, in degrees."""
    thing.rotation_mode = "XYZ"
    for frame, angle in zip(frames, ends, strict=True):
        thing.rotation_euler[axis] = np.radians(angle)
        thing.keyframe_insert("rotation_euler", index=axis, frame=frame)


def turn_camera(scene, ends):
    scene.camera.rotation_mode = "XYZ"
    scene.camera.rotation_euler = (np.pi / 2, 0, 0)
    turn(scene.camera, ends)


def open_door(scene, frames=(1, 100)):
    """To the side."""
    for frame, place in zip(frames, (2, 6.1), strict=True):
        scene.objects["Door"].location[1] = place
        scene.objects["Door"].keyframe_insert("location", frame=frame)


def needs(scene):
    bpy.context.view_layer.update()
    return needs_of(scene)


def test_a_camera_that_turns_from_a_wall_to_the_sky_sees_the_world(scene):
    scene.objects["Door"].hide_render = True
    scene.camera.rotation_mode = "XYZ"
    scene.camera.rotation_euler = (np.pi / 2, 0, np.pi / 2)
    assert not needs(scene).camera_sees_world
    turn_camera(scene, (90, 270))
    scene.frame_set(1)
    assert needs(scene).camera_sees_world
    turn_camera(scene, (90, 100))
    scene.frame_set(1)
    assert not needs(scene).camera_sees_world


def test_a_camera_that_moves_within_a_closed_set_does_not_load_the_map(scene):
    turn_camera(scene, (0, 360))
    assert not needs(scene).camera_sees_world
    bpy.ops.sunsplit.convert()
    assert "the camera does not see the world" in scene.sunsplit.report
    count = int(scene.sunsplit.report.split("Looked at ")[1].split()[0])
    assert FEWEST <= count <= MOST
    assert f"Looked at {count} frames of 1 to 100 " in scene.sunsplit.report


def test_light_comes_in_by_a_door_that_opens_in_some_later_frame(scene):
    assert not run_at_once(Reach.steps(needs(scene).sight)).escaped
    open_door(scene)
    scene.frame_set(1)
    found = needs(scene)
    reach = run_at_once(Reach.steps(found.sight))
    assert reach.escaped
    assert run_at_once(reach.is_reached(Vector(TO_DOOR), 100))
    assert not run_at_once(reach.is_reached(Vector(BEHIND), 100))
    bpy.ops.sunsplit.convert()
    assert [to_light(lamp) @ TO_DOOR for lamp in suns(scene)] == pytest.approx([1], abs=1e-3)


def drive(scene):
    curve = scene.objects["Door"].driver_add("rotation_euler", 2)
    curve.driver.expression = "frame / 70"


def hang_on_what_turns(scene):
    hinge = bpy.data.objects.new("Hinge", None)
    scene.collection.objects.link(hinge)
    hinge.location, hinge.hide_render = (2, 2, 0), True
    door = scene.objects["Door"]
    door.parent, door.location = hinge, (0.005, 0, -4)
    turn(hinge, (0, 80))


def follow(scene):
    turned = bpy.data.objects.new("Turned", None)
    scene.collection.objects.link(turned)
    turn(turned, (0, 80))
    scene.objects["Door"].constraints.new("COPY_ROTATION").target = turned


def be_an_instance(scene):
    door = scene.objects["Door"]
    leaf = bpy.data.collections.new("Leaf")
    scene.collection.objects.unlink(door)
    leaf.objects.link(door)
    hinge = bpy.data.objects.new("Hinge", None)
    hinge.instance_type, hinge.instance_collection = "COLLECTION", leaf
    scene.collection.objects.link(hinge)
    open_door(scene=type("Of", (), {"objects": {"Door": door}}))


@pytest.mark.parametrize("moved_by", [drive, hang_on_what_turns, follow, be_an_instance])
def test_whatever_moves_the_door(scene, moved_by):
    moved_by(scene)
    scene.frame_set(1)
    found = needs(scene)
    assert found.looked
    assert run_at_once(Reach.steps(found.sight)).escaped


@pytest.mark.parametrize("length", [100, 5000])
def test_a_camera_that_a_marker_chooses_sees_the_world(scene, length):
    scene.frame_end = length
    other = camera_towards(scene, np.array([1, 0, 0]), 40, 32)
    other.location = (5, 0, 0)
    scene.camera = next(c for c in scene.objects if c.type == "CAMERA" and c != other)
    assert not needs(scene).camera_sees_world
    scene.timeline_markers.new("A", frame=1).camera = scene.camera
    scene.timeline_markers.new("B", frame=60).camera = other
    found = needs(scene)
    assert found.camera_sees_world
    assert found.looked
    other.location = (0, 0, 0)
    found = needs(scene)
    assert not found.camera_sees_world
    assert found.sight


def run_a_script(scene):
    curve = scene.objects["Door"].driver_add("rotation_euler", 2)
    curve.driver.expression = "sum([frame]) / 70"


def look_at_the_scenes_frame(scene):
    curve = scene.objects["Door"].driver_add("rotation_euler", 2)
    variable = curve.driver.variables.new()
    variable.name, variable.targets[0].id_type = "now", "SCENE"
    variable.targets[0].id, variable.targets[0].data_path = scene, "frame_current"
    curve.driver.expression = "now / 70"


def be_simulated(scene):
    turn_camera(scene, (90, 100))
    bpy.context.view_layer.objects.active = scene.objects["Door"]
    bpy.ops.rigidbody.world_add()
    bpy.ops.rigidbody.object_add()


def be_bent_by_what_moves(scene):
    lattice = bpy.data.objects.new("Lattice", bpy.data.lattices.new("Lattice"))
    scene.collection.objects.link(lattice)
    lattice.hide_render = True
    scene.objects["Door"].modifiers.new("Lattice", "LATTICE").object = lattice
    turn(lattice, (0, 10))


def vanish_later(scene):
    scene.objects["Door"].keyframe_insert("hide_render", frame=1)


def be_too_quick(scene):
    """Once around in two frames, a hundred frames long."""
    open_door(scene)
    for frame in range(1, 101):
        scene.objects["Door"].rotation_euler[2] = 2 * frame
        scene.objects["Door"].keyframe_insert("rotation_euler", index=2, frame=frame)


def jump_in_a_long_film(scene):
    scene.frame_end = 5000
    open_door(scene, (2001, 2002))


@pytest.mark.parametrize(
    "change",
    [
        run_a_script,
        look_at_the_scenes_frame,
        be_simulated,
        be_bent_by_what_moves,
        vanish_later,
        be_too_quick,
        jump_in_a_long_film,
    ],
)
def test_what_single_frames_do_not_tell_keeps_all(scene, change):
    assert not needs(scene).camera_sees_world
    change(scene)
    found = needs(scene)
    assert found.camera_sees_world
    assert found.sight is None
    assert found.looked is None


def test_the_scene_is_left_as_it_was(scene):
    """Its frame, what was moved without a key, and who listens to changes of frames."""
    open_door(scene)
    turn_camera(scene, (90, 100))
    scene.frame_set(30, subframe=0.5)
    door = scene.objects["Door"]
    door.rotation_euler[2], door.location[1] = 0.1, 1.5
    bpy.context.view_layer.update()
    heard = []
    handlers = [
        getattr(bpy.app.handlers, f"{what}_{when}")
        for what in ("frame_change", "depsgraph_update")
        for when in ("pre", "post")
    ]

    def listen(*arguments):
        heard.append(arguments)

    for those in handlers:
        those.append(listen)
    before = [list(those) for those in handlers]
    try:
        assert needs_of(scene).looked
        assert not heard
        assert [list(those) for those in handlers] == before
        bpy.context.view_layer.update()
    finally:
        for those in handlers:
            those.remove(listen)
    assert (scene.frame_current, scene.frame_subframe) == (30, 0.5)
    assert list(bpy.data.scenes) == [scene]
    assert (door.rotation_euler[2], door.location[1]) == pytest.approx((0.1, 1.5))
    assert door.matrix_world.to_euler()[2] == pytest.approx(0.1, abs=1e-6)
    assert [thing.users_scene for thing in scene.objects] == [(scene,)] * len(scene.objects)


def test_frames_are_given_back_when_reading_them_fails(scene, monkeypatch):
    from sunsplit.addon import frames

    open_door(scene)

    def fail(*_):
        raise RuntimeError("no")

    monkeypatch.setattr(frames, "view_of", fail)
    before = list(bpy.app.handlers.frame_change_pre)
    with pytest.raises(RuntimeError):
        needs(scene)
    assert list(bpy.data.scenes) == [scene]
    assert list(bpy.app.handlers.frame_change_pre) == before


def test_a_thing_that_turns_under_an_open_sky_costs_little(scene):
    """What is told of a still scene is told of one in which a ball rolls, too: the sun below the
    ground is no lamp."""
    for thing in [t for t in scene.objects if t.type == "MESH"]:
        bpy.data.objects.remove(thing)
    add_mesh(scene, plate_mesh(1000), diffuse("Ground", 0.5), Matrix())
    ball = add_mesh(scene, box_mesh(0.5, 0.5, 0.5), diffuse("Box", 0.5), Matrix())
    turn(ball, (0, 90))
    scene.camera.location = (-4, 0, 3)
    scene.camera.rotation_mode = "XYZ"
    scene.camera.rotation_euler = (np.radians(55), 0, -np.pi / 2)
    bpy.ops.sunsplit.convert()
    assert [to_light(lamp) @ TO_DOOR for lamp in suns(scene)] == pytest.approx([1], abs=1e-3)
    assert "reaches nothing that the camera shows" in scene.sunsplit.report
