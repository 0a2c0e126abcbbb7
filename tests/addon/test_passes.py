"""Two passes and light groups: set up, said, converted again, and taken back without a trace."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon.passes import LAYER, users_layers
from sunsplit.addon.scene_needs import needs_of
from tests.addon.test_convert import inventory, world_state
from tests.blender import (
    add_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    suns,
    write_map,
)
from tests.maps import direction, paint_disc, sky

IS_5 = bpy.app.version >= (5, 0)


@pytest.fixture(scope="module")
def two_suns(tmp_path_factory):
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(40, 30), 2, (900, 900, 900))
    paint_disc(pixels, direction(-100, 10), 3, (600, 100, 50))
    return write_map(tmp_path_factory.mktemp("maps") / "two suns.exr", pixels)


@pytest.fixture
def scene(two_suns):
    """Things in collections, some of them shown otherwise in the one view layer there is."""
    made = fresh_scene()
    hdri_world(made, two_suns)
    made.cycles.samples = 64
    layer = made.view_layers[0]
    for name, flag in (("Plain", None), ("Left Out", "exclude"), ("Cut Out", "holdout")):
        collection = bpy.data.collections.new(name)
        made.collection.children.link(collection)
        collection.objects.link(bpy.data.objects.new(name, plate_mesh(1)))
        inner = bpy.data.collections.new(f"In {name}")
        collection.children.link(inner)
        if flag:
            setattr(layer.layer_collection.children[name], flag, True)
    layer.layer_collection.children["Plain"].children["In Plain"].indirect_only = True
    layer.use_pass_z = layer.use_pass_normal = True
    layer.lightgroups.add(name="Mine")
    return made


def compositor(scene):
    return scene.compositing_node_group if IS_5 else scene.node_tree


def collections_of(layer) -> dict[str, tuple[bool, ...]]:
    found, left = {}, [layer.layer_collection]
    while left:
        one = left.pop()
        left += one.children
        found[one.name] = (one.exclude, one.holdout, one.indirect_only, one.hide_viewport)
    return found


def tree_state(tree) -> object:
    """Nodes and links of a compositor."""
    if tree is None:
        return None
    nodes = sorted((n.name, n.type, getattr(n, "layer", "")) for n in tree.nodes)
    links = sorted((k.from_node.name, k.from_socket.name, k.to_node.name) for k in tree.links)
    return nodes, links


def state(scene) -> dict:
    """All that two passes and light groups may touch."""
    return {
        "world": world_state(scene.world) | {"group": scene.world.lightgroup},
        "things": inventory(),
        "layers": [
            {
                "name": layer.name,
                "samples": layer.samples,
                "passes": (layer.use_pass_z, layer.use_pass_normal),
                "override": layer.world_override,
                "groups": [group.name for group in layer.lightgroups],
                "collections": collections_of(layer),
                "marks": [mark for mark in layer.keys() if "sunsplit" in mark],  # noqa: SIM118
            }
            for layer in scene.view_layers
        ],
        "samples": (scene.cycles.samples, scene.cycles.use_layer_samples),
        "render": (scene.render.use_compositing, scene.render.use_single_layer),
        # A tree that Blender 4.5 once had to make cannot be taken from it; it is not used.
        "compositor": tree_state(compositor(scene)) if IS_5 or scene.use_nodes else None,
    }


def links(tree) -> set[tuple[str, str, str]]:
    return set(tree_state(tree)[1])


def test_lamps_and_sky_are_two_layers(scene):
    (sky_layer,) = scene.view_layers
    before = collections_of(sky_layer)
    bpy.ops.sunsplit.convert(two_passes=True)
    assert [layer.name for layer in scene.view_layers] == [sky_layer.name, LAYER]
    suns_layer = scene.view_layers[LAYER]
    lamps = "Sunsplit Suns"
    assert collections_of(sky_layer) == before | {lamps: (True, False, False, False)}
    assert collections_of(suns_layer) == before | {lamps: (False, False, False, False)}
    assert sky_layer.world_override is None
    assert not suns_layer.world_override.node_tree.nodes
    assert sky_layer.use_pass_z
    assert not suns_layer.use_pass_z
    assert [group.name for group in suns_layer.lightgroups] == ["Mine"]
    assert all(lamp.lightgroup == "" for lamp in suns(scene))


def test_the_compositor_shows_the_sum(scene):
    bpy.ops.sunsplit.convert(two_passes=True)
    tree = compositor(scene)
    both = tree.nodes["Sunsplit: Sky and Suns"]
    added = [both.inputs[at].links[0].from_node for at in (6, 7)]
    assert [(one.scene, one.layer) for one in added] == [(scene, "ViewLayer"), (scene, LAYER)]
    assert both.blend_type == "ADD"
    to = "Group Output" if IS_5 else "Reroute"
    assert (both.name, "Result", to) in links(tree)
    assert sum(link.from_node == added[0] for link in tree.links) == 1


def test_the_panel_says_how_many_samples_each_pass_takes(scene):
    bpy.ops.sunsplit.convert(two_passes=True)
    for_suns, for_sky = (scene.view_layers[name].samples for name in (LAYER, "ViewLayer"))
    said = f"Two passes: {for_suns} samples for the suns, {for_sky} for the sky."
    assert said in scene.sunsplit.report.splitlines()
    assert min(for_suns, for_sky) > 1


@pytest.mark.parametrize(
    ("way", "of_layer", "whole"),
    [
        ("USE", 0, 64),
        ("USE", 200, 200),
        ("BOUNDED", 200, 64),
        ("BOUNDED", 30, 30),
        ("IGNORE", 9, 64),
    ],
)
def test_samples_are_shared_out_of_those_that_the_layer_takes(scene, way, of_layer, whole):
    scene.cycles.samples = 500
    scene.view_layers[0].samples = 500
    bpy.ops.sunsplit.convert(two_passes=True)
    of_500 = [layer.samples for layer in scene.view_layers]
    bpy.ops.sunsplit.restore()
    scene.cycles.samples, scene.cycles.use_layer_samples = 64, way
    scene.view_layers[0].samples = of_layer
    bpy.ops.sunsplit.convert(two_passes=True)
    found = [layer.samples for layer in scene.view_layers]
    assert scene.cycles.use_layer_samples == "USE"
    assert found == pytest.approx(np.array(of_500) * whole / 500, abs=1.01)


@pytest.mark.parametrize("groups", [False, True])
@pytest.mark.parametrize("passes", [False, True])
def test_restore_leaves_no_trace(scene, passes, groups):
    scene.view_layers[0].samples = 33
    scene.cycles.use_layer_samples = "BOUNDED"
    scene.render.use_compositing, scene.render.use_single_layer = False, True
    scene.world.lightgroup = "Mine"
    before = state(scene)
    bpy.ops.sunsplit.convert(two_passes=passes, light_groups=groups)
    assert state(scene) != before
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def test_restore_after_saving_and_opening_again(scene, tmp_path):
    before = state(scene)
    bpy.ops.sunsplit.convert(two_passes=True, light_groups=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    assert len(scene.view_layers) == 2
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def test_conversions_in_any_order_leave_what_the_last_one_makes(scene):
    ways = [{"two_passes": False}, {"two_passes": True}, {"two_passes": True, "light_groups": True}]
    ways = [{"light_groups": False, "lights": 1} | way for way in ways]
    before, alone = state(scene), []
    for way in ways:
        bpy.ops.sunsplit.convert(**way)
        alone.append(all_of(scene))
        bpy.ops.sunsplit.restore()
    for number in (0, 0, 1, 1, 2, 2, 0, 2, 1, 0):  # each after each
        bpy.ops.sunsplit.convert(**ways[number])
        assert all_of(scene) == alone[number]
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def all_of(scene) -> dict:
    """What a conversion has left in a scene; data-blocks by their names."""
    found = state(scene) | {"report": scene.sunsplit.report}
    found["lamps"] = [lamp.lightgroup for lamp in suns(scene)]
    for layer in found["layers"]:
        layer["override"] = getattr(layer["override"], "name", None)
    return found


def test_light_groups_are_on_every_layer_and_the_users_stay(scene):
    other = scene.view_layers.new("Other")
    other.lightgroups.add(name="Suns")
    bpy.ops.sunsplit.convert(light_groups=True)
    names = [[group.name for group in layer.lightgroups] for layer in scene.view_layers]
    assert names == [["Mine", "Suns", "Sky"], ["Suns", "Sky"]]
    assert scene.world.lightgroup == "Sky"
    assert {lamp.lightgroup for lamp in suns(scene)} == {"Suns"}
    bpy.ops.sunsplit.convert(light_groups=False)
    assert scene.world.lightgroup == ""
    assert {lamp.lightgroup for lamp in suns(scene)} == {""}
    bpy.ops.sunsplit.restore()
    names = [[group.name for group in layer.lightgroups] for layer in scene.view_layers]
    assert names == [["Mine"], ["Suns"]]


def test_the_users_light_group_comes_back(scene):
    scene.world.lightgroup = "Mine"
    bpy.ops.sunsplit.convert(light_groups=True)
    assert scene.sunsplit.original_world.lightgroup == "Mine"
    bpy.ops.sunsplit.convert(light_groups=False)
    assert scene.world.lightgroup == "Mine"
    assert {lamp.lightgroup for lamp in suns(scene)} == {"Mine"}
    bpy.ops.sunsplit.convert(light_groups=True)
    bpy.data.worlds.remove(scene.sunsplit.original_world)
    bpy.ops.sunsplit.restore()
    assert scene.world.lightgroup == "Mine"


def test_with_other_lights_only_the_lamps_group_is_added(scene):
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    scene.collection.objects.link(lamp)
    before = state(scene)
    bpy.ops.sunsplit.convert(two_passes=True)
    tree = compositor(scene)
    assert ("Sunsplit: Suns", "Combined_Suns", "Sunsplit: Sky and Suns") in links(tree)
    assert lamp.lightgroup == ""
    assert "Other lights" in scene.sunsplit.report
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def test_without_lamps_one_pass_is_enough(scene):
    bpy.ops.sunsplit.convert(two_passes=True, share=0)
    assert len(scene.view_layers) == 1
    assert "One pass" in scene.sunsplit.report


def test_a_layer_that_is_not_rendered_does_not_count(scene):
    scene.view_layers.new("Other").use = False
    before = state(scene)
    bpy.ops.sunsplit.convert(two_passes=True)
    assert [layer.name for layer in scene.view_layers] == ["ViewLayer", "Other", LAYER]
    assert not scene.view_layers["Other"].layer_collection.children["Sunsplit Suns"].exclude
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def use_two_layers(scene):
    scene.view_layers.new("Other")


def use_no_layer(scene):
    scene.view_layers[0].use = False


def use_eevee(scene):
    scene.render.engine = "BLENDER_EEVEE" if IS_5 else "BLENDER_EEVEE_NEXT"


def catch_shadows(scene):
    bpy.data.objects["Plain"].is_shadow_catcher = True


def draw_lines(scene):
    scene.render.use_freestyle = True


def draw_by_pencil(scene):
    kinds = bpy.data.grease_pencils if IS_5 else bpy.data.grease_pencils_v3
    scene.collection.objects.link(bpy.data.objects.new("Pencil", kinds.new("Pencil")))


def plain_compositor(scene):
    """What Blender makes when the compositor is switched on, or its New button pressed."""
    if IS_5:
        bpy.ops.node.new_compositing_node_group()
        scene.compositing_node_group = bpy.data.node_groups["NodeTree"]
        layers = next(n for n in compositor(scene).nodes if n.type == "R_LAYERS")
        layers.scene, layers.layer = scene, "ViewLayer"
    else:
        scene.use_nodes = True


def blur(scene):
    plain_compositor(scene)
    compositor(scene).nodes.new("CompositorNodeBlur")


def show_nothing(scene):
    plain_compositor(scene)
    compositor(scene).nodes.clear()


def show_the_alpha(scene):
    plain_compositor(scene)
    tree = compositor(scene)
    layers = next(n for n in tree.nodes if n.type == "R_LAYERS")
    reroute = next(n for n in tree.nodes if n.type == "REROUTE")
    tree.links.new(layers.outputs["Alpha"], reroute.inputs[0])


@pytest.mark.parametrize("converted", [False, True], ids=["first", "again"])
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (use_two_layers, "one view layer in use, not 2"),
        (use_no_layer, "one view layer in use, not 0"),
        (use_eevee, "for Cycles"),
        (catch_shadows, "Shadow catchers"),
        (draw_lines, "Freestyle"),
        (draw_by_pencil, "Grease Pencil"),
        (blur, "compositor does more"),
        (show_nothing, "compositor does more"),
        (show_the_alpha, "compositor does more"),
    ],
)
def test_what_two_passes_cannot_do_is_refused_and_nothing_changes(
    scene, change, sentence, converted
):
    if converted:
        bpy.ops.sunsplit.convert(two_passes=True)
    change(scene)
    before = state(scene)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.sunsplit.convert(two_passes=True)
    message = str(error.value).strip()
    assert sentence in message
    assert "\n" not in message
    assert state(scene) == before
    bpy.ops.sunsplit.convert(two_passes=False)
    assert len(users_layers(scene)) == len(scene.view_layers)


def test_a_plain_compositor_of_the_users_is_given_back(scene):
    plain_compositor(scene)
    before, own = state(scene), compositor(scene)
    bpy.ops.sunsplit.convert(two_passes=True)
    assert compositor(scene) == own
    assert state(scene)["compositor"] != before["compositor"]
    bpy.ops.sunsplit.restore()
    assert compositor(scene) == own
    assert state(scene) == before


def test_what_users_add_to_the_compositor_stays(scene):
    bpy.ops.sunsplit.convert(two_passes=True)
    tree = compositor(scene)
    blurred = tree.nodes.new("CompositorNodeBlur")
    result = next(n for n in tree.nodes if n.type in ("GROUP_OUTPUT", "COMPOSITE"))
    tree.links.new(tree.nodes["Sunsplit: Sky and Suns"].outputs[2], blurred.inputs["Image"])
    tree.links.new(blurred.outputs["Image"], result.inputs[0])
    with pytest.raises(RuntimeError, match="compositor does more"):
        bpy.ops.sunsplit.convert(two_passes=True)
    assert len(scene.view_layers) == 2
    bpy.ops.sunsplit.restore()
    tree = compositor(scene)
    assert ("Render Layers", "Image", blurred.name) in links(tree)
    assert (blurred.name, "Image", result.name) in links(tree)
    assert not [n for n in tree.nodes if n.name.startswith("Sunsplit")]
    assert IS_5 or scene.use_nodes


def test_deleted_parts_do_not_stop_restore(scene):
    before = state(scene)
    bpy.ops.sunsplit.convert(two_passes=True, light_groups=True)
    scene.view_layers.remove(scene.view_layers[LAYER])
    compositor(scene).nodes.remove(compositor(scene).nodes["Sunsplit: Sky and Suns"])
    bpy.data.worlds.remove(bpy.data.worlds["Sunsplit Black"])
    bpy.ops.sunsplit.restore()
    assert state(scene) == before


def test_the_last_layer_of_a_scene_stays(scene):
    bpy.ops.sunsplit.convert(two_passes=True)
    scene.view_layers.remove(scene.view_layers["ViewLayer"])
    bpy.ops.sunsplit.restore()
    (layer,) = scene.view_layers
    assert layer.world_override is None
    bpy.ops.sunsplit.convert(two_passes=True)
    assert len(users_layers(scene)) == 1


def test_renamed_layers_are_known(scene):
    before = state(scene)
    bpy.ops.sunsplit.convert(two_passes=True)
    scene.view_layers[LAYER].name = "Lamps"
    bpy.ops.sunsplit.convert(two_passes=True)
    assert [layer.name for layer in scene.view_layers] == ["ViewLayer", LAYER]
    scene.view_layers["ViewLayer"].name = "Master"
    bpy.ops.sunsplit.restore()
    before["layers"][0]["name"] = "Master"
    assert state(scene) == before


def test_a_copy_of_the_scene_is_restored_by_itself(scene):
    bpy.ops.sunsplit.convert(two_passes=True)
    bpy.ops.scene.new(type="LINK_COPY")
    copy = bpy.context.scene
    with bpy.context.temp_override(scene=scene):
        bpy.ops.sunsplit.restore()
    assert [layer.name for layer in scene.view_layers] == ["ViewLayer"]
    assert len(copy.view_layers) == 2
    with bpy.context.temp_override(scene=copy):
        bpy.ops.sunsplit.restore()
    assert [layer.name for layer in copy.view_layers] == ["ViewLayer"]
    for one in (scene, copy):
        left = compositor(one).nodes if compositor(one) else ()
        assert not [n for n in left if n.name.startswith("Sunsplit")]
    assert not bpy.data.lights
    assert [world.name for world in bpy.data.worlds] == ["Sky"]


def test_the_suns_layer_may_be_the_one_in_the_window(scene):
    before = state(scene)
    window = bpy.context.window
    for _ in range(2):
        bpy.ops.sunsplit.convert(two_passes=True)
        window.view_layer = scene.view_layers[LAYER]
    assert bpy.context.view_layer.name == LAYER
    bpy.ops.sunsplit.restore()
    assert window.view_layer == scene.view_layers[0]
    assert state(scene) == before


def test_our_own_layer_is_no_reason_to_think_that_the_world_is_seen(scene):
    add_mesh(scene, box_mesh(2, 2, 1), diffuse("Wall", 0.5), Matrix.Translation((0, 0, -0.5)))
    camera_towards(scene, np.array([1, 0, 0]), 60, 32)
    for name in ("Plain", "Left Out", "Cut Out"):
        bpy.data.objects[name].hide_render = True
    skipped = "the camera does not see the world"
    for _ in range(2):
        bpy.ops.sunsplit.convert(two_passes=True)
        assert skipped in scene.sunsplit.report
    bpy.context.view_layer.update()
    assert not needs_of(scene).camera_sees_world
    scene.view_layers.new("Other").use = False
    assert needs_of(scene).camera_sees_world


def test_our_black_world_is_no_world_of_the_users(scene):
    for _ in range(2):
        bpy.ops.sunsplit.convert(two_passes=True)
        assert "world of its own" not in scene.sunsplit.report
