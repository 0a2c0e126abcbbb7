"""Rays that ask boxes first meet what Blender's own rays meet."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from sunsplit.addon.rays import Reach
from sunsplit.addon.scene_needs import needs_of
from sunsplit.addon.shapes import FEW, Crowd, shapes_of
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
)


@pytest.fixture
def scene():
    return fresh_scene()


def scattered(scene, count, seed):
    """Balls, boxes and plates, some flat or mirrored, some of them made by instances in instances;
    and a ground beneath."""
    random = np.random.default_rng(seed)
    meshes = [ball_mesh(0.5), box_mesh(0.4, 0.2, 0.3), plate_mesh(0.7)]
    made = bpy.data.collections.new("Instanced")
    for mesh, along in zip(meshes, (0, 1, 2), strict=True):
        thing = bpy.data.objects.new("Member", mesh)
        thing.location[along] = 0.8
        made.objects.link(thing)
    outer = bpy.data.collections.new("Outer")
    outer.objects.link(instance_of(made))
    for number in range(count):
        if number % 4:
            thing = bpy.data.objects.new("Thing", meshes[number % 3])
        else:
            thing = instance_of((made, outer)[number % 8 == 0])
        thing.location = random.uniform(-6, 6, 3)
        thing.rotation_euler = random.uniform(0, 6, 3)
        thing.scale = random.choice([0.01, 0.3, 1, -1], p=[0.1, 0.4, 0.4, 0.1], size=3)
        scene.collection.objects.link(thing)
    thing = bpy.data.objects.new("Ground", plate_mesh(500))
    thing.location[2] = -7
    scene.collection.objects.link(thing)
    flat = bpy.data.objects.new("Flat", meshes[0])
    flat.scale = (0, 0, 0)
    scene.collection.objects.link(flat)


def instance_of(collection):
    thing = bpy.data.objects.new("Instance", None)
    thing.instance_type, thing.instance_collection = "COLLECTION", collection
    return thing


def rays(count, seed):
    random = np.random.default_rng(seed)
    for start, direction in zip(
        random.uniform(-8, 8, (count, 3)), random.normal(size=(count, 3)), strict=True
    ):
        yield Vector(start), Vector(direction).normalized()
    for axis in np.vstack([np.eye(3), -np.eye(3)]):  # along the sides of boxes
        yield Vector(random.uniform(-6, 6, 3)), Vector(axis)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [3, 40, 300])
def test_the_same_hits_as_the_scenes_own_rays(scene, count, seed):
    scattered(scene, count, seed)
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    shapes = shapes_of(graph)
    assert len(shapes) > (0 if count < FEW else count)
    crowd = Crowd(shapes.values())
    met = 0
    for start, along in rays(400, 100 + seed):
        hit, point, _, _, thing, _ = scene.ray_cast(graph, start, along)
        mine = crowd.nearest(start, along)
        assert (mine is not None) == hit
        if not hit:
            continue
        met += 1
        assert (mine.point - point).length < 1e-4 * max(1, mine.distance)
        assert mine.things[0].name == thing.name
        assert crowd.nearest(start, along, 1.01 * mine.distance) is not None
        assert crowd.nearest(start, along, 0.99 * mine.distance) is None
    assert met > 100


def test_what_geometry_nodes_make_is_met(scene):
    """Cubes that are no object's mesh, on the corners of a grid."""
    tree = bpy.data.node_groups.new("Cubes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    grid, cube, spread = (
        tree.nodes.new(f"GeometryNode{kind}")
        for kind in ("MeshGrid", "MeshCube", "InstanceOnPoints")
    )
    grid.inputs["Size X"].default_value = grid.inputs["Size Y"].default_value = 12
    grid.inputs["Vertices X"].default_value = grid.inputs["Vertices Y"].default_value = 8
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(grid.outputs["Mesh"], spread.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], spread.inputs["Instance"])
    tree.links.new(spread.outputs[0], output.inputs[0])
    thing = bpy.data.objects.new("Thing", plate_mesh(1))
    scene.collection.objects.link(thing)
    thing.modifiers.new("Nodes", "NODES").node_group = tree
    thing.rotation_euler = (0.3, 0.2, 0.1)
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    shapes = shapes_of(graph)
    assert len(shapes) == 64
    crowd, met = Crowd(shapes.values()), 0
    for start, along in rays(400, 1):
        hit, point, *_ = scene.ray_cast(graph, start, along)
        mine = crowd.nearest(start, along)
        assert (mine is not None) == hit
        met += hit
        assert not hit or (mine.point - point).length < 1e-4 * max(1, mine.distance)
    assert met > 50


def test_a_normal_stands_upright_on_what_is_stretched(scene):
    """A plate that is turned and stretched unevenly (Blender 4.5's own rays lean here)."""
    plate = plate_mesh(1)
    plate.transform(Matrix.Rotation(0.7, 4, "X"))
    matrix = Matrix.Rotation(0.3, 4, "Y") @ Matrix.Diagonal((1, 1, 5, 1))
    add_mesh(scene, plate, diffuse("Plate", 0.5), matrix)
    bpy.context.view_layer.update()
    crowd = Crowd(shapes_of(bpy.context.evaluated_depsgraph_get()).values())
    first, second, third, _ = (matrix @ corner.co for corner in plate.vertices)
    hit = crowd.nearest(Vector((0.1, 0.1, 9)), Vector((0, 0, -1)))
    assert abs(hit.normal.dot((second - first).cross(third - first).normalized())) == pytest.approx(
        1, abs=1e-5
    )


def of_stones(scene, sunrise, closed):
    """A room whose walls are 2,000 stones; open: some to the left are missing."""
    hdri_world(scene, sunrise)
    stone = box_mesh(0.05, 0.5, 0.5)
    stone.materials.append(diffuse("Stone", 0.5))
    cells = np.array([(x, y) for x in range(18) for y in range(18)]) - 8.5
    number = 0
    for axis in range(3):
        for side in (-1, 1):
            turned = Vector((1, 0, 0)).rotation_difference(Vector(np.eye(3)[axis])).to_matrix()
            for x, y in cells:
                number += 1
                place = turned.to_4x4() @ Matrix.Translation((side * 9, x, y - 0.5))
                if closed or not 1030 <= number < 1080:
                    thing = bpy.data.objects.new("Stone", stone)
                    thing.matrix_world = place
                    scene.collection.objects.link(thing)
    camera_towards(scene, np.array([1, 0.2, 0]), 60, 32)
    bpy.context.view_layer.update()


@pytest.mark.parametrize("closed", [True, False])
def test_a_room_of_two_thousand_objects(scene, sunrise, closed):
    of_stones(scene, sunrise, closed)
    assert len(scene.objects) > 1800
    found = needs_of(scene)
    assert not found.camera_sees_world
    assert bool(run_at_once(Reach.steps(found.sight)).escaped) is not closed


def forest(scene, sunrise):
    hdri_world(scene, sunrise)
    add_mesh(scene, plate_mesh(100), diffuse("Ground", 0.5), Matrix())
    tree = bpy.data.objects.new("Tree", ball_mesh(0.5))
    tree.data.materials.append(diffuse("Leaf", 0.5))
    trees = bpy.data.collections.new("Trees")
    trees.objects.link(tree)
    made = []
    for x in range(-5, 6):
        made.append(instance_of(trees))
        made[-1].location = (x, 3, 1)
        scene.collection.objects.link(made[-1])
    camera_towards(scene, np.array([0, 1, -0.2]), 60, 32).location = (0, 0, 2)
    bpy.context.view_layer.update()
    return trees, tree, made


def test_instances_of_collections_are_met(scene, sunrise):
    forest(scene, sunrise)
    sight = needs_of(scene).sight
    assert len(sight.shapes) == 12
    reach = run_at_once(Reach.steps(sight))
    assert any(place.point.z > 0.5 for place in reach.places)


def hide_from_the_viewport(trees, tree, made):
    tree.hide_viewport = True


def hide_one(trees, tree, made):
    made[3].hide_set(True)


def be_hidden_in_renders(trees, tree, made):
    part = bpy.data.collections.new("Part")
    trees.children.link(part)
    part.objects.link(tree)
    trees.objects.unlink(tree)
    part.hide_render = True


def hide_from_the_camera(trees, tree, made):
    made[3].visible_camera = False


@pytest.mark.parametrize(
    "change",
    [hide_from_the_viewport, hide_one, be_hidden_in_renders, hide_from_the_camera],
)
def test_instances_that_rays_meet_and_renders_do_not_show_or_the_other_way_round(
    scene, sunrise, change
):
    change(*forest(scene, sunrise))
    bpy.context.view_layer.update()
    assert needs_of(scene).sight is None


def test_what_a_scale_flattens_is_shown_but_not_met(scene, sunrise):
    """A sheet, not what is nothing any more."""
    hdri_world(scene, sunrise)
    add_mesh(scene, plate_mesh(100), diffuse("Ground", 0.5), Matrix())
    ball = bpy.data.objects.new("Ball", ball_mesh(0.5))
    scene.collection.objects.link(ball)
    camera_towards(scene, np.array([0, 1, -0.2]), 60, 32).location = (0, 0, 2)
    for size, told in (
        ((1, 1, 1), True),
        ((0, 0, 0), True),
        ((1, 1, 0), False),
        ((1, 1e-7, 1), False),
        ((1e-7, 1e-7, 1e-7), True),
        ((1, 1, 1e-3), True),
    ):
        ball.scale = size
        bpy.context.view_layer.update()
        assert (needs_of(scene).sight is not None) is told
