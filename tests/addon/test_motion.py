"""Scenes in which something moves are looked at in several frames, and left as they were."""

from __future__ import annotations

import itertools
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from sunsplit.addon import changes, frames
from sunsplit.addon.frames import read_frames
from sunsplit.addon.keyed import keyed_camera
from sunsplit.addon.moments import FEWEST, MOST
from sunsplit.addon.motion import moving
from sunsplit.addon.rays import Reach
from sunsplit.addon.scene_needs import needs_of
from sunsplit.addon.steps import run_at_once
from tests.blender import (
    add_mesh,
    ball_mesh,
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


def run_along_a_path(scene):
    path = bpy.data.curves.new("Path", "CURVE")
    path.dimensions, path.use_path = "3D", True
    line = path.splines.new("POLY")
    line.points.add(1)
    line.points[1].co = (0, 8, 0, 1)
    for frame, along in ((1, 0), (100, path.path_duration)):
        path.eval_time = along
        path.keyframe_insert("eval_time", frame=frame)
    rail = bpy.data.objects.new("Rail", path)
    scene.collection.objects.link(rail)
    rail.hide_render = True
    scene.objects["Door"].parent = rail


def rig_of_one_bone(scene):
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new("Bone")
    bone.head, bone.tail = (2, 2, -1), (2, 2, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.hide_render = True
    return rig


def hang_on_a_bone(scene):
    rig = rig_of_one_bone(scene)
    door = scene.objects["Door"]
    door.parent, door.parent_type, door.parent_bone = rig, "BONE", "Bone"
    door.matrix_world = Matrix.Translation((2.005, 2, -4))
    return rig.pose.bones["Bone"]


def hang_on_a_bone_that_follows(scene):
    bone = hang_on_a_bone(scene)
    turned = bpy.data.objects.new("Turned", None)
    scene.collection.objects.link(turned)
    turn(turned, (0, 80))
    following = bone.constraints.new("COPY_ROTATION")
    following.target, following.mix_mode = turned, "AFTER"


@pytest.mark.parametrize(
    "moved_by",
    [
        drive,
        hang_on_what_turns,
        follow,
        be_an_instance,
        run_along_a_path,
        hang_on_a_bone_that_follows,
    ],
)
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


def be_bent_by_what_changes_its_shape(scene):
    lattice = bpy.data.objects.new("Lattice", bpy.data.lattices.new("Lattice"))
    scene.collection.objects.link(lattice)
    lattice.hide_render = True
    lattice.shape_key_add()
    lattice.shape_key_add().keyframe_insert("value", frame=1)
    scene.objects["Door"].modifiers.new("Lattice", "LATTICE").object = lattice


def be_bent_by_a_parent_that_changes_its_shape(scene):
    be_bent_by_what_changes_its_shape(scene)
    door = scene.objects["Door"]
    door.parent, door.parent_type = door.modifiers[0].object, "LATTICE"
    door.modifiers.clear()


def be_bent_along_what_grows(scene):
    path = bpy.data.curves.new("Path", "CURVE")
    path.splines.new("POLY").points.add(1)
    path.keyframe_insert("extrude", frame=1)
    rail = bpy.data.objects.new("Rail", path)
    scene.collection.objects.link(rail)
    rail.hide_render = True
    scene.objects["Door"].modifiers.new("Curve", "CURVE").object = rail


def cut_by(scene, parent=None):
    cutter = bpy.data.objects.new("Cutter", box_mesh(0.1, 0.1, 0.1))
    scene.collection.objects.link(cutter)
    cutter.hide_render, cutter.parent = True, parent
    scene.objects["Door"].modifiers.new("Cut", "BOOLEAN").object = cutter
    return cutter


def be_cut_by_what_is_rigged(scene):
    cut_by(scene).modifiers.new("Rig", "ARMATURE").object = rig_of_one_bone(scene)


def be_displaced_by_a_film(scene):
    texture = bpy.data.textures.new("Film", "IMAGE")
    texture.image = bpy.data.images.new("Film", 4, 4)
    texture.image.source = "SEQUENCE"
    scene.objects["Door"].modifiers.new("Film", "DISPLACE").texture = texture


def hang_on_a_bone_that_follows_a_film(scene):
    hang_on_a_bone(scene).constraints.new("FOLLOW_TRACK")


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
        be_bent_by_what_changes_its_shape,
        be_bent_by_a_parent_that_changes_its_shape,
        be_bent_along_what_grows,
        be_cut_by_what_is_rigged,
        be_displaced_by_a_film,
        hang_on_a_bone_that_follows_a_film,
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


def mirror_at_a_child(scene, door):
    middle = bpy.data.objects.new("Middle", None)
    scene.collection.objects.link(middle)
    middle.parent = door
    door.modifiers.new("Mirror", "MIRROR").mirror_object = middle


def be_cut_by_a_child(scene, door):
    cut_by(scene, door)


def hook_two_to_each_other(scene, door):
    other = scene.objects["Room"]
    door.modifiers.new("Hook", "HOOK").object = other
    other.modifiers.new("Hook", "HOOK").object = door


@pytest.mark.parametrize("tie", [mirror_at_a_child, be_cut_by_a_child, hook_two_to_each_other])
def test_ties_that_lead_in_circles_come_to_an_end(scene, tie):
    tie(scene, scene.objects["Door"])
    found = needs(scene)
    assert not found.camera_sees_world
    assert found.sight
    turn_camera(scene, (90, 100))
    assert needs(scene).looked
    turn(scene.objects["Door"], (0, 1))
    assert needs(scene).sight is None


def test_each_parent_of_a_long_chain_is_asked_once(scene, monkeypatch):
    count, parent = 1500, None
    for _ in range(count):
        thing = bpy.data.objects.new("Link", None)
        scene.collection.objects.link(thing)
        thing.parent = parent
        parent = thing
    scene.objects["Door"].parent = parent
    asked = []
    leaders = changes._leaders

    def count_leaders(*fact):
        asked.append(fact)
        return leaders(*fact)

    monkeypatch.setattr(changes, "_leaders", count_leaders)
    assert scene.objects["Door"] not in moving(scene, scene.objects)
    assert len(asked) == len(set(asked)) <= 2 * len(scene.objects)
    turn(scene.objects["Link"], (0, 1))
    assert scene.objects["Door"] in moving(scene, scene.objects)


def test_what_is_told_does_not_depend_on_the_clock(scene, monkeypatch):
    open_door(scene)
    seconds = itertools.count(0, 10)
    monkeypatch.setattr(time, "perf_counter", lambda: next(seconds))
    assert needs(scene).looked


def test_fewer_frames_are_read_where_each_is_more_work(scene, monkeypatch):
    scene.frame_end = 200
    open_door(scene, (1, 200))
    door = scene.objects["Door"]
    assert len(run_at_once(read_frames(scene, [scene.camera], [door]))) == 200
    monkeypatch.setattr(frames, "MOST_WORK", 3 * 50)
    assert 40 < len(run_at_once(read_frames(scene, [scene.camera], [door]))) <= 50
    scene.frame_set(7)
    assert 7 in [one.frame for one in run_at_once(read_frames(scene, [scene.camera], [door]))]
    hang_on_a_bone_that_follows(scene)
    fewer = len(run_at_once(read_frames(scene, [scene.camera], [door])))
    assert 2 < fewer < 40
    ball = bpy.data.objects.new("Ball", ball_mesh(0.1))
    scene.collection.objects.link(ball)
    ball.modifiers.new("Wave", "WAVE")
    door.parent, door.parent_type = ball, "VERTEX"
    bpy.context.view_layer.update()
    assert run_at_once(read_frames(scene, [scene.camera], [door])) is None
    monkeypatch.setattr(frames, "MOST_WORK", 1e6)
    assert run_at_once(read_frames(scene, [scene.camera], [door]))
    monkeypatch.setattr(frames, "MOST_THINGS", 1)
    assert run_at_once(read_frames(scene, [scene.camera], [door])) is None


def test_what_is_shown_outside_of_the_range_is_not_rendered(scene):
    open_door(scene, (300, 400))
    scene.frame_set(500)
    found = needs(scene)
    assert found.looked
    assert not found.camera_sees_world
    assert not run_at_once(Reach.steps(found.sight)).escaped


def test_only_markers_that_choose_a_camera_are_cuts(scene):
    scene.frame_end = 5000
    turn_camera(scene, (90, 100))
    before = [one.frame for one in run_at_once(read_frames(scene, [scene.camera], []))]
    scene.timeline_markers.new("Note", frame=1234)
    assert [one.frame for one in run_at_once(read_frames(scene, [scene.camera], []))] == before
    scene.timeline_markers.new("Cut", frame=1234).camera = scene.camera
    after = [one.frame for one in run_at_once(read_frames(scene, [scene.camera], []))]
    assert sorted({*before, 1233, 1234}) == after


@pytest.mark.parametrize("hidden", [(), (1,), (2,), (1, 2)])
def test_the_camera_that_blender_chooses(scene, hidden):
    """It passes by markers of cameras that are hidden in renders."""
    first, cameras = scene.camera, [scene.camera]
    for x in (1, 2):
        cameras.append(camera_towards(scene, np.array([-1, 0, 0]), 50, 32))
        cameras[-1].location[0] = x / 2
        scene.timeline_markers.new("Cut", frame=10 * x).camera = cameras[-1]
        cameras[-1].hide_render = x in hidden
    scene.camera = first
    bpy.context.view_layer.update()
    read = {one.frame: one.view.place for one in run_at_once(read_frames(scene, cameras, []))}
    for frame in (1, 9, 10, 11, 20, 100):
        scene.frame_set(frame)
        assert read[frame] == scene.camera.location
        scene.camera = first


def test_a_hidden_camera_does_not_see_the_world(scene):
    other = camera_towards(scene, np.array([1, 0, 0]), 40, 32)
    other.location = (5, 0, 0)
    scene.camera = next(c for c in scene.objects if c.type == "CAMERA" and c != other)
    scene.timeline_markers.new("A", frame=1).camera = scene.camera
    scene.timeline_markers.new("B", frame=60).camera = other
    assert needs(scene).camera_sees_world
    other.hide_render = True
    assert not needs(scene).camera_sees_world


def test_what_is_flattened_in_some_frame_is_not_told(scene):
    door = scene.objects["Door"]
    for frame, size in ((1, 1), (100, 0)):
        door.scale[0] = size
        door.keyframe_insert("scale", frame=frame)
    scene.frame_set(1)
    assert needs(scene).sight is None


def blenders_smooth_by_angle():
    """The group of the modifier that imported meshes get."""
    for path in sorted(Path(bpy.utils.system_resource("DATAFILES")).rglob("*.blend")):
        if path.stem in ("smooth_by_angle", "geometry_nodes_essentials"):
            with bpy.data.libraries.load(str(path)) as (_, wanted):
                wanted.node_groups = ["Smooth by Angle"]
            return wanted.node_groups[0]
    raise LookupError("Blender's own nodes")


def smooth_door(scene):
    part = scene.objects["Door"].modifiers.new("Smooth by Angle", "NODES")
    part.node_group = blenders_smooth_by_angle()
    return part


def test_a_mesh_that_is_smooth_by_angle_stands_still_or_moves(scene):
    smooth_door(scene)
    found = needs(scene)
    assert not found.camera_sees_world
    assert not run_at_once(Reach.steps(found.sight)).escaped
    open_door(scene)
    scene.frame_set(1)
    found = needs(scene)
    assert found.looked
    assert run_at_once(Reach.steps(found.sight)).escaped


def through(kinds, inner=None):
    """Nodes of geometry, one after the other."""
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    last = tree.nodes.new("NodeGroupInput").outputs[0]
    for kind in kinds:
        node = tree.nodes.new(kind)
        if inner:
            node.node_tree = inner
        geometry = [s for s in node.inputs if s.type == "GEOMETRY"]
        if geometry:
            tree.links.new(last, geometry[0])
        last = next((s for s in node.outputs if s.type == "GEOMETRY"), last)
    tree.links.new(last, tree.nodes.new("NodeGroupOutput").inputs[0])
    return tree


def add_nodes(scene, *kinds, inner=None):
    tree = through([f"GeometryNode{kind}" for kind in kinds], inner)
    scene.objects["Door"].modifiers.new("Nodes", "NODES").node_group = tree
    return tree


def key_its_angle(scene):
    part = smooth_door(scene)
    if bpy.app.version < (5, 2):
        part.keyframe_insert('["Input_1"]', frame=1)
    else:
        part.properties.inputs.Input_1.keyframe_insert("value", frame=1)


def key_a_node(scene):
    tree = add_nodes(scene, "SetPosition")
    tree.nodes["Set Position"].inputs["Offset"].keyframe_insert("default_value", frame=1)


def look_at_the_time(scene):
    add_nodes(scene, "SetShadeSmooth", "InputSceneTime")


def look_at_the_time_in_a_group(scene):
    inner = through(["GeometryNodeInputSceneTime"])
    add_nodes(scene, "Group", inner=inner)


def look_at_another_object(scene):
    add_nodes(scene, "ObjectInfo")


def be_simulated_by_nodes(scene):
    tree = add_nodes(scene, "SetShadeSmooth")
    begin, end = (tree.nodes.new(f"GeometryNodeSimulation{way}put") for way in ("In", "Out"))
    begin.pair_with_output(end)


def look_otherwise_in_renders(scene):
    add_nodes(scene, "IsViewport")


def wear_what_nodes_choose(scene):
    add_nodes(scene, "SetMaterial")


@pytest.mark.parametrize(
    "change",
    [
        key_its_angle,
        key_a_node,
        look_at_the_time,
        look_at_the_time_in_a_group,
        look_at_another_object,
        be_simulated_by_nodes,
        look_otherwise_in_renders,
        wear_what_nodes_choose,
    ],
)
def test_nodes_that_may_make_something_else(scene, change):
    change(scene)
    assert needs(scene).sight is None


def test_groups_in_groups_stand_still(scene):
    add_nodes(scene, "Group", inner=through(["GeometryNodeSetShadeSmooth"]))
    assert needs(scene).sight


@pytest.mark.parametrize("made", ["Points", "CurvePrimitiveCircle", "VolumeCube"])
def test_what_rays_do_not_meet_is_not_told(scene, made):
    add_nodes(scene, "MeshCube")
    assert needs(scene).sight
    scene.objects["Door"].modifiers.clear()
    add_nodes(scene, made)
    assert needs(scene).sight is None


def test_instances_that_nodes_make_move_with_their_object(scene):
    """A door of four leaves, of which the last opens the door."""
    tree = add_nodes(scene, "MeshLine")
    line = tree.nodes["Mesh Line"]
    line.inputs["Count"].default_value = 4
    line.inputs["Offset"].default_value = (0, 1, 0)
    line.inputs["Start Location"].default_value = (0, -3.5, 4)
    leaf, spread = (tree.nodes.new(f"GeometryNode{k}") for k in ("MeshCube", "InstanceOnPoints"))
    leaf.inputs["Size"].default_value = (0.02, 1, 8)
    tree.links.new(line.outputs[0], spread.inputs["Points"])
    tree.links.new(leaf.outputs[0], spread.inputs["Instance"])
    tree.links.new(spread.outputs[0], tree.nodes["Group Output"].inputs[0])
    found = needs(scene)
    assert len(found.sight.shapes) == 1 + 4
    assert not run_at_once(Reach.steps(found.sight)).escaped
    open_door(scene)
    scene.frame_set(1)
    found = needs(scene)
    assert found.looked
    assert run_at_once(Reach.steps(found.sight)).escaped


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


@pytest.mark.parametrize("mode", ["XYZ", "ZYX", "QUATERNION"])
def test_keys_alone_tell_where_a_camera_is(scene, mode):
    """As evaluating the scene does, in every frame."""
    camera = scene.camera
    camera.rotation_mode, camera.scale = mode, (1, 2, -0.5)
    turned = "rotation_quaternion" if mode == "QUATERNION" else "rotation_euler"
    for frame, by in ((1, 0.0), (40, 1.0), (250, -0.7)):
        camera.location[1] += by
        getattr(camera, turned)[2] += by
        camera.keyframe_insert("location", index=1, frame=frame)
        camera.keyframe_insert(turned, frame=frame)
    assert keyed_camera(camera)
    by_keys = run_at_once(read_frames(scene, [camera], []))
    evaluated = run_at_once(read_frames(scene, [camera], [scene.objects["Door"]]))
    assert [one.frame for one in by_keys] == [one.frame for one in evaluated]
    assert len({one.view.place[1] for one in by_keys}) > 10
    for one, other in zip(by_keys, evaluated, strict=True):
        assert np.allclose(one.view.place, other.view.place, atol=1e-6)
        assert np.allclose(one.view.turn, other.view.turn, atol=1e-6)
        assert one.view.corners == other.view.corners


def _hang_on_a_parent(camera):
    camera.parent = bpy.data.objects["Door"]


def _drive(camera):
    camera.driver_add("location", 0).driver.expression = "frame"


def _zoom(camera):
    camera.data.keyframe_insert("lens", frame=1)


def _mute(camera):
    made = camera.animation_data
    bag = made.action.layers[0].strips[0].channelbag(made.action_slot)
    bag.fcurves[0].mute = True


def _shift(camera):
    camera.delta_location[0] = 1


def _aim(camera):
    camera.constraints.new("TRACK_TO")


@pytest.mark.parametrize("change", [_hang_on_a_parent, _drive, _zoom, _mute, _shift, _aim])
def test_more_than_keys_must_be_evaluated(scene, change):
    turn_camera(scene, (90, 100))
    assert keyed_camera(scene.camera)
    change(scene.camera)
    assert keyed_camera(scene.camera) is None


def test_the_window_has_moments_while_frames_are_read(scene, monkeypatch):
    monkeypatch.setattr(frames, "LEAST_AT_ONCE", 50)
    open_door(scene, (1, 250))
    scenes = len(bpy.data.scenes)
    steps = read_frames(scene, [scene.camera], [scene.objects["Door"]])
    moments, readings = 0, None
    while readings is None:
        try:
            assert next(steps) is None
        except StopIteration as done:
            readings = done.value
        else:
            moments += 1
            assert len(bpy.data.scenes) == scenes  # nothing is left that the user could see
    monkeypatch.setattr(frames, "LEAST_AT_ONCE", 1e9)
    at_once = run_at_once(read_frames(scene, [scene.camera], [scene.objects["Door"]]))
    assert moments > 2
    for one, other in zip(readings, at_once, strict=True):
        assert (one.frame, one.places) == (other.frame, other.places)
