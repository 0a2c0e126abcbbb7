"""Worlds, scenes and suns that come from other files, and engines that are neither Cycles nor
EEVEE."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.addon.test_convert import inventory
from tests.blender import add_mapping, fresh_scene, hdri_world, suns, to_light, write_map
from tests.maps import direction, paint_disc, sky

SUN = direction(40, 30)


@pytest.fixture(scope="module")
def one_sun(tmp_path_factory):
    pixels = sky(256, 0.4)
    paint_disc(pixels, SUN, 2, (900, 900, 900))
    return write_map(tmp_path_factory.mktemp("maps") / "sun.exr", pixels)


def saved(folder, one_sun, convert):
    """A file with a scene "Shop" that is lit by a map, converted or not."""
    scene = fresh_scene()
    scene.name = "Shop"
    add_mapping(hdri_world(scene, one_sun))
    if convert:
        bpy.ops.sunsplit.convert(lights=1)
    path = str(folder / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


def taken(path, kind, link, name=None):
    """A data-block of another file."""
    with bpy.data.libraries.load(path, link=link) as (there, here):
        found = getattr(there, kind)
        setattr(here, kind, [name or found[0]])
    return getattr(here, kind)[0]


def assert_sun_follows(scene):
    (lamp,) = suns(scene)
    assert to_light(lamp) == pytest.approx(SUN, abs=1e-3)
    turned = np.radians(30)
    rotation = scene.world.node_tree.nodes["Mapping"].inputs["Rotation"]
    rotation.default_value[2] = -turned
    x, y, z = SUN
    expected = [
        x * np.cos(turned) - y * np.sin(turned),
        x * np.sin(turned) + y * np.cos(turned),
        z,
    ]
    assert to_light(lamp) == pytest.approx(expected, abs=1e-3)


def test_a_linked_world(tmp_path, one_sun):
    path = saved(tmp_path, one_sun, convert=False)
    scene = fresh_scene()
    scene.world = linked = taken(path, "worlds", link=True)
    before = inventory()
    bpy.ops.sunsplit.convert(lights=1)
    assert scene.world.library is None
    assert_sun_follows(scene)
    bpy.ops.sunsplit.restore()
    assert scene.world == linked
    assert inventory() == before


def test_an_overridden_world(tmp_path, one_sun):
    path = saved(tmp_path, one_sun, convert=False)
    scene = fresh_scene()
    scene.world = override = taken(path, "worlds", link=True).override_create()
    before = inventory()
    bpy.ops.sunsplit.convert(lights=1)
    assert scene.world.override_library is None
    assert_sun_follows(scene)
    bpy.ops.sunsplit.restore()
    assert scene.world == override
    assert inventory() == before


def test_an_appended_scene_is_restored_as_in_its_own_file(tmp_path, one_sun):
    path = saved(tmp_path, one_sun, convert=True)
    fresh_scene()
    before = inventory()
    bpy.ops.wm.append(directory=f"{path}/Scene/", filename="Shop")
    scene = bpy.data.scenes["Shop"]
    bpy.context.window.scene = scene
    for thing in scene.objects:
        thing.update_tag()  # in 4.5 nothing that was appended stands anywhere before
    assert scene.sunsplit.is_converted
    assert_sun_follows(scene)
    bpy.ops.sunsplit.restore()
    after = inventory()
    for kind in ("lights", "objects", "collections", "node_groups"):
        assert after[kind] == before[kind]
    assert scene.world.name == "Sky"
    assert [i for i in after["images"] if "residual" in i] == []


@pytest.mark.parametrize("convert", [False, True])
def test_a_linked_scene_is_left_alone_and_says_why(tmp_path, one_sun, convert):
    path = saved(tmp_path, one_sun, convert)
    fresh_scene()
    scene = taken(path, "scenes", link=True)
    bpy.context.window.scene = scene
    before = inventory()
    with pytest.raises(RuntimeError, match=r"The scene is linked from another file: .*"):
        bpy.ops.sunsplit.convert()
    with pytest.raises(RuntimeError):
        bpy.ops.sunsplit.restore()
    assert inventory() == before
    assert scene.sunsplit.is_converted == convert


def test_appended_suns_bring_the_world_that_turns_them(tmp_path, one_sun):
    path = saved(tmp_path, one_sun, convert=True)
    scene = fresh_scene()
    collection = taken(path, "collections", link=False)
    scene.collection.children.link(collection)
    (lamp,) = [thing for thing in collection.objects if thing.type == "LIGHT"]
    scene.world = bpy.data.worlds["Sky (Sunsplit)"]
    scene.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value[2] = np.radians(-50)
    x, y, _ = to_light(lamp)
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(90, abs=0.1)


def test_lamps_turn_where_there_is_no_sunsplit(tmp_path, one_sun):
    """As on a render farm: drivers and factors need nothing of the add-on."""
    import sunsplit

    path = saved(tmp_path, one_sun, convert=True)
    sunsplit.unregister()
    try:
        bpy.ops.wm.open_mainfile(filepath=path)
        scene = bpy.data.scenes["Shop"]
        (lamp,) = [thing for thing in scene.objects if thing.type == "LIGHT"]
        mapping = scene.world.node_tree.nodes["Mapping"]
        mapping.inputs["Rotation"].default_value[2] = np.radians(-50)
        bpy.data.objects["Sunsplit Sky"]["strength"] = 4.0
        bpy.data.objects["Sunsplit Sky"].update_tag()
        x, y, _ = to_light(lamp)
        assert np.degrees(np.arctan2(y, x)) == pytest.approx(90, abs=0.1)
        assert lamp.data.exposure == pytest.approx(2)
    finally:
        sunsplit.register()


@pytest.mark.parametrize("engine", ["BLENDER_WORKBENCH", "EEVEE"])
def test_other_engines(one_sun, engine):
    scene = fresh_scene()
    if engine == "EEVEE":
        engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    scene.render.engine = engine
    add_mapping(hdri_world(scene, one_sun))
    before = inventory()
    bpy.ops.sunsplit.convert(lights=1)
    assert_sun_follows(scene)
    bpy.ops.sunsplit.restore()
    assert inventory() == before
