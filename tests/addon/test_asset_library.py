"""The asset library: the worker as a process, its files, and skies in scenes."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sunsplit.addon.dropped import complete_imported
from sunsplit.addon.exporting import skylight_of_scene
from sunsplit.addon.skies import suns_of
from sunsplit.core import ConversionSettings, convert, load, save
from sunsplit.core.export.skylight import read_skylight
from sunsplit.core.library.catalogues import catalogue_id
from tests.addon.test_convert import inventory
from tests.blender import (
    add_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    to_light,
    write_map,
)
from tests.conftest import ROOT
from tests.maps import direction, paint_disc, sky
from tests.render.compare import estimate, means_agree

WORKER = ROOT / "addon" / "asset_library" / "worker.py"

NAME = "Sunrise"
LAMPS = 5
"""Of the sunrise by default."""


@contextmanager
def worker():
    """A function that does jobs in a worker of its own, and gives its answers."""
    command = [sys.executable, str(WORKER)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes, text=True) as process:
        process.stdin.write("{}\n")  # the greeting

        def ask(job):
            process.stdin.write(json.dumps(job) + "\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        yield ask
        process.stdin.close()
        assert process.wait(60) == 0


def job_for(folder, hdri, name=NAME, **more):
    """A conversion in a folder as a job."""
    return {
        "map": str(hdri),
        "lights": str(folder / f"{hdri.stem}.lights.json"),
        "blend": str(folder / f"{hdri.stem}.blend"),
        "name": name,
        "catalogue": "outdoor/morning",
        "root": str(folder),
        "tags": ["sun", "field"],
        "author": "Greg Zaal",
        "licence": "CC0-1.0",
        "copyright": "nobody",
        "description": "A sunrise.",
        "pack": False,
        "preview": 0,
    } | more


@pytest.fixture(scope="module")
def library(tmp_path_factory, sunrise):
    """A folder with the sample's map, its conversion, and what the worker has made of it."""
    folder = tmp_path_factory.mktemp("library")
    hdri = Path(shutil.copy(sunrise, folder / "sunrise.hdr"))
    save(convert(load(hdri)), folder)
    packed = {"blend": str(folder / "packed.blend"), "pack": True}
    with worker() as ask:
        for job in (job_for(folder, hdri, preview=64), job_for(folder, hdri, **packed)):
            assert ask(job) == {"blend": job["blend"], "sentence": "", "left_out": []}
    return folder


@pytest.fixture
def file(library):
    return library / "sunrise.blend"


def linked(file):
    """The assets of a file, linked: its world and its suns."""
    with bpy.data.libraries.load(str(file), link=True, assets_only=True) as (there, here):
        here.worlds, here.collections = there.worlds, there.collections
    (world,), (suns,) = here.worlds, here.collections
    return world, suns


def brought(kind, file, name, link=False):
    """Append or link by Blender's own operator, as File > Append does."""
    do = bpy.ops.wm.link if link else bpy.ops.wm.append
    do(directory=f"{file}/{kind}/", filename=name)


def used(scene, world):
    """Give a scene an imported world, as dropping it into the view does, and what comes then."""
    before, scene.world = scene.world, world
    complete_imported(scene, [world], before)


def lamps_of(suns):
    return [thing for thing in suns.objects if thing.type == "LIGHT"]


# The file


def test_world_and_suns_are_assets_with_all_that_is_said_of_them(file):
    fresh_scene()
    for asset in linked(file):
        data = asset.asset_data
        assert (data.author, data.license, data.copyright) == ("Greg Zaal", "CC0-1.0", "nobody")
        assert data.description == "A sunrise."
        assert sorted(tag.name for tag in data.tags) == ["field", "sun"]
        assert data.catalog_id == catalogue_id("outdoor/morning")


def test_the_file_holds_nothing_else(file):
    fresh_scene()
    with bpy.data.libraries.load(str(file)) as (there, _):
        found = {kind: getattr(there, kind) for kind in dir(there)}
    assert found["worlds"] == [NAME]
    assert found["collections"] == [f"{NAME} Suns"]
    assert len(found["images"]) == 2
    assert len(found["lights"]) == LAMPS
    assert not found["scenes"] + found["meshes"] + found["cameras"] + found["materials"]


def test_previews_show_light_and_shadow(file):
    fresh_scene()
    for asset in linked(file):
        assert tuple(asset.preview.image_size) == (64, 64)
        pixels = np.empty(64 * 64 * 4, np.float32)
        asset.preview.image_pixels_float.foreach_get(pixels)
        picture = pixels.reshape(64, 64, 4)
        assert (picture[..., 3] == 1).all()
        lightness = picture[..., :3].mean(axis=-1)
        low, high = np.percentile(lightness, [2, 98])
        assert low < 0.4
        assert high > 0.7
        ground = lightness[:8].mean()  # lit by a low sun, exposed for it
        assert 0.4 < ground < 0.8


def test_paths_are_relative_and_the_library_can_move(library, file, tmp_path):
    moved = tmp_path / "moved"
    shutil.copytree(library, moved)
    fresh_scene()
    world, _ = linked(moved / file.name)
    images = [image for image in bpy.data.images if image.library == world.library]
    assert sorted(i.filepath for i in images) == ["//sunrise.hdr", "//sunrise.residual.exr"]
    for image in images:
        assert not image.packed_file
        assert Path(bpy.path.abspath(image.filepath, library=image.library)).parent == moved
        assert tuple(image.size) == (1024, 512)


def test_packed_it_needs_no_other_file(library, tmp_path):
    alone = shutil.copy(library / "packed.blend", tmp_path)
    fresh_scene()
    world, _ = linked(alone)
    images = [image for image in bpy.data.images if image.library == world.library]
    assert len(images) == 2
    for image in images:
        assert image.packed_file
        assert image.filepath.startswith("//")
        assert tuple(image.size) == (1024, 512)
        assert max(image.pixels[: 4 * 1024]) > 0


def test_several_maps_in_one_file(tmp_path, library):
    hdri = library / "sunrise.hdr"
    missing = job_for(library, library / "none.hdr", name="None")
    jobs = [job_for(library, hdri, name="One"), missing, job_for(library, hdri, name="Two")]
    blend = tmp_path / "all.blend"
    with worker() as ask:
        answer = ask({"all": jobs, "blend": str(blend)})
        nothing = ask({"all": [missing], "blend": str(tmp_path / "none.blend")})
    assert answer["sentence"] == ""
    assert len(answer["left_out"]) == 1
    assert answer["left_out"][0].startswith("None: ")
    assert nothing["sentence"].startswith("There is no map")
    assert [path.name for path in tmp_path.iterdir()] == ["all.blend"]
    fresh_scene()
    with bpy.data.libraries.load(str(blend), link=True) as (there, here):
        assert sorted(there.worlds) == ["One", "Two"]
        here.worlds = there.worlds
    for world in here.worlds:
        suns = suns_of(world)
        assert suns.name == f"{world.name} Suns"
        assert all(targets(lamp.data) >= {world} for lamp in lamps_of(suns))
        image = next(i for i in bpy.data.images if i.name == "sunrise.hdr")
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        assert path.samefile(hdri)


def targets(owner):
    """The data-blocks that drivers of one follow."""
    curves = owner.animation_data.drivers
    return {variable.targets[0].id for one in curves for variable in one.driver.variables}


def broken(kind, folder, job):
    """Make a job one that cannot be done; the start of what is said of it."""
    lights = Path(job["lights"])
    if kind == "no residual":
        (folder / "sunrise.residual.exr").unlink()
        return str(folder / "sunrise.residual.exr") + " is missing"
    if kind == "another residual":
        write_map(folder / "sunrise.residual.exr", sky(64, 0.1))
        return "sunrise.residual.exr was changed"
    if kind == "no map":
        Path(job["map"]).unlink()
        return job["map"] + " cannot be read"
    if kind == "another map":
        write_map(Path(job["map"]), sky(64, 0.1))
        return "sunrise.hdr has changed"
    if kind == "damaged document":
        document = json.loads(lights.read_text())
        del document["predicted_error"]
        lights.write_text(json.dumps(document))
        return "sunrise.lights.json is damaged"
    job["blend"] = str(folder / "sunrise.hdr" / "new.blend")
    return f"Cannot write into {folder / 'sunrise.hdr'}"


KINDS = (
    "no residual",
    "another residual",
    "no map",
    "another map",
    "damaged document",
    "no folder",
)


def test_what_cannot_be_done_gives_a_sentence_and_the_older_file_stays(library, tmp_path):
    with worker() as ask:
        for kind in KINDS:
            folder = tmp_path / kind
            shutil.copytree(library, folder)
            job = job_for(folder, folder / "sunrise.hdr")
            expected = broken(kind, folder, job)
            before = sorted((p.name, p.stat().st_mtime_ns) for p in folder.iterdir())
            answer = ask(job)
            assert answer["sentence"].startswith(expected), kind
            assert answer["sentence"].endswith(".")
            after = sorted((p.name, p.stat().st_mtime_ns) for p in folder.iterdir())
            assert after == before, kind


# In a scene


def test_an_appended_world_becomes_the_conversion_and_restore_takes_it_away(tmp_path, file):
    scene = fresh_scene()
    hdri_world(scene, write_map(tmp_path / "own.exr", sky(64, 0.3)))
    own, before = scene.world, inventory()
    brought("World", file, NAME)
    used(scene, bpy.data.worlds[NAME])
    state = scene.sunsplit
    assert (state.original_world, state.converted_world) == (own, scene.world)
    assert state.collection in list(scene.collection.children)
    assert [entry.lamp.name for entry in state.lamps] == [
        lamp.name for lamp in lamps_of(state.collection)
    ]
    assert len(state.lamps) == LAMPS
    assert state.sky.parent is None
    assert state.report.startswith(f"{LAMPS} lamps with ")
    assert scene.world.asset_data is None
    assert state.collection.asset_data is None
    # What an artist turns and dims.
    lamp = state.lamps[0].lamp
    towards = to_light(lamp)
    rotation = scene.world.node_tree.nodes["Sunsplit: Rotation"].inputs["Rotation"]
    rotation.default_value[2] = -np.radians(90)
    assert to_light(lamp) == pytest.approx([-towards[1], towards[0], towards[2]], abs=1e-5)
    state.sky["strength"] = 2.0
    state.sky.update_tag()
    bpy.context.view_layer.update()
    assert lamp.data.exposure == pytest.approx(1)
    bpy.ops.sunsplit.restore()
    assert scene.world == own
    after = inventory()
    for kind in ("worlds", "lights", "objects", "collections", "node_groups"):
        assert after[kind] == before[kind]


@pytest.mark.parametrize("link", [False, True])
def test_suns_alone_bring_their_world(file, link):
    scene = fresh_scene()
    brought("Collection", file, f"{NAME} Suns", link)
    world = bpy.data.worlds[NAME]
    assert scene.world != world
    complete_imported(scene, [world], None)
    assert scene.world == world
    # Once, and not also as the instance that Link makes.
    assert sorted(o.name for o in scene.objects) == sorted(o.name for o in suns_of(world).objects)
    assert len(scene.sunsplit.lamps) == LAMPS
    # There was no world before: what Restore brings back is the map itself.
    bpy.ops.sunsplit.restore()
    assert scene.world.library is None
    assert not scene.sunsplit.is_converted
    assert [i.name for i in plain_images(scene.world)] == ["sunrise.hdr"]


def plain_images(world):
    return [n.image for n in world.node_tree.nodes if n.type == "TEX_ENVIRONMENT"]


def test_a_linked_sky_stays_linked_and_can_be_taken_away(file):
    scene = fresh_scene()
    scene.world = own = bpy.data.worlds.new("Own")
    brought("World", file, NAME, link=True)
    used(scene, bpy.data.worlds[NAME])
    assert scene.world.library is not None
    assert len([o for o in scene.objects if o.type == "LIGHT"]) == LAMPS
    lamp = scene.sunsplit.lamps[0].lamp
    assert np.linalg.norm(to_light(lamp)) == pytest.approx(1)
    bpy.ops.sunsplit.restore()
    assert scene.world == own
    assert not scene.objects
    assert not scene.sunsplit.is_converted


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("link", [False, True])
def test_a_sky_is_exported_as_its_files_are(library, link, packed):
    scene = fresh_scene()
    file = library / ("packed.blend" if packed else "sunrise.blend")
    brought("World", file, NAME, link=link)
    used(scene, bpy.data.worlds[NAME])
    found, expected = skylight_of_scene(scene), read_skylight(library / "sunrise.lights.json")
    assert found.name == expected.name == "sunrise"
    assert (found.radiance == expected.radiance).all()
    assert np.allclose(found.turn, np.eye(3), rtol=0, atol=1e-7)
    for sun, wanted in zip(found.suns, expected.suns, strict=True):
        assert sun.to_light == pytest.approx(wanted.to_light, abs=1e-6)
        assert sun.irradiance == pytest.approx(wanted.irradiance, rel=1e-5)


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="such links came with Blender 5.0")
@pytest.mark.parametrize("dragged", ["world", "suns"])
def test_a_sky_that_blender_packs_becomes_the_scenes_own(library, file, dragged):
    """As Blender 5 does it by itself when an asset is dragged."""
    scene = fresh_scene()
    scene.world = own = bpy.data.worlds.new("Own")
    with bpy.data.libraries.load(str(file), link=True, pack=True) as (_, here):
        here.worlds = [NAME]
    before = inventory()
    if dragged == "world":
        used(scene, here.worlds[0])
    else:
        instance = bpy.data.objects.new("Instance", None)
        instance.instance_type = "COLLECTION"
        instance.instance_collection = suns_of(here.worlds[0])
        scene.collection.objects.link(instance)
        complete_imported(scene, [here.worlds[0]], own)
    sky = scene.world
    assert sky.is_editable
    assert sky.asset_data is None
    lamps = lamps_of(suns_of(sky))
    assert [entry.lamp for entry in scene.sunsplit.lamps] == lamps
    assert all(thing.is_editable and thing.data.is_editable for thing in lamps)
    assert set.union(*(targets(lamp.data) for lamp in lamps)) == {
        sky,
        scene.sunsplit.sky,
        *(lamp.data for lamp in lamps),
    }
    for image in plain_images(sky):
        assert Path(bpy.path.abspath(image.filepath)).parent == library
        assert tuple(image.size) == (1024, 512)
    assert not bpy.data.libraries
    after = inventory()
    assert {kind: len(names) for kind, names in after.items()} == {
        kind: len(names) for kind, names in before.items()
    }
    bpy.ops.sunsplit.restore()
    assert scene.world == own
    assert not bpy.data.lights


def test_linked_suns_that_come_a_second_time_stand_there_once(file):
    scene = fresh_scene()
    scene.world = own = bpy.data.worlds.new("Own")
    brought("World", file, NAME, link=True)
    sky = bpy.data.worlds[NAME]
    used(scene, sky)
    standing = sorted(thing.name for thing in scene.objects)
    scene.collection.children.unlink(suns_of(sky))  # as Blender does it when they are dragged
    brought("Collection", file, f"{NAME} Suns", link=True)
    complete_imported(scene, [sky], sky)
    assert sorted(thing.name for thing in scene.objects) == standing
    assert scene.sunsplit.original_world == own
    assert len(scene.sunsplit.lamps) == LAMPS


def test_another_sky_takes_the_place_of_the_first(file):
    """Both assets dragged one after the other are two skies: the second one stays."""
    scene = fresh_scene()
    scene.world = own = bpy.data.worlds.new("Own")
    for _ in range(2):
        worlds = set(bpy.data.worlds)
        brought("World", file, NAME)
        (new,) = set(bpy.data.worlds) - worlds
        used(scene, new)
    assert scene.world == new
    assert len([o for o in scene.objects if o.type == "LIGHT"]) == LAMPS
    assert sorted(world.name for world in bpy.data.worlds) == sorted([own.name, NAME])
    assert all(not thing.name.endswith(".001") for thing in scene.objects)
    bpy.ops.sunsplit.restore()
    assert scene.world == own
    assert not scene.objects


def test_a_sky_takes_the_place_of_a_conversion(tmp_path, file):
    pixels = sky(256, 0.4)
    paint_disc(pixels, direction(40, 30), 2, (900, 900, 900))
    scene = fresh_scene()
    hdri_world(scene, write_map(tmp_path / "own.exr", pixels))
    own = scene.world
    bpy.ops.sunsplit.convert(lights=1)
    brought("World", file, NAME)
    used(scene, bpy.data.worlds[NAME])
    assert scene.sunsplit.original_world == own
    assert len([o for o in scene.objects if o.type == "LIGHT"]) == LAMPS
    bpy.ops.sunsplit.restore()
    assert scene.world == own
    assert not scene.objects


@pytest.mark.parametrize("link", [False, True])
def test_a_sky_is_converted_again(file, link):
    scene = fresh_scene()
    scene.world = own = bpy.data.worlds.new("Own")
    brought("World", file, NAME, link)
    used(scene, bpy.data.worlds[NAME])
    bpy.ops.sunsplit.convert(lights=1)
    assert suns_of(scene.world) is None
    assert scene.world.library is None
    assert len([o for o in scene.objects if o.type == "LIGHT"]) == 1
    bpy.ops.sunsplit.restore()
    assert scene.world == own
    assert not scene.objects


def test_a_world_chosen_by_hand_gets_its_suns_by_a_button(file):
    scene = fresh_scene()
    assert not bpy.ops.sunsplit.complete_sky.poll()
    with bpy.data.libraries.load(str(file)) as (_, here):
        here.worlds = [NAME]
    scene.world = here.worlds[0]
    assert not scene.objects
    bpy.ops.sunsplit.complete_sky()
    assert len([o for o in scene.objects if o.type == "LIGHT"]) == LAMPS
    assert not bpy.ops.sunsplit.complete_sky.poll()


def test_what_is_appended_and_not_used_changes_no_scene(file):
    scene = fresh_scene()
    scene.world = own = bpy.data.worlds.new("Own")
    with bpy.data.libraries.load(str(file)) as (_, here):
        here.worlds = [NAME]
    complete_imported(scene, list(here.worlds), own)
    assert scene.world == own
    assert not scene.objects
    assert not scene.sunsplit.is_converted


@pytest.mark.parametrize("link", [False, True])
def test_without_the_add_on_an_appended_pair_belongs_together(file, link):
    """Blender alone puts the suns that come with an appended world into the scene, and they follow
    that world; of a linked one it puts in what is linked."""
    import sunsplit

    scene = fresh_scene()
    sunsplit.unregister()
    try:
        brought("World", file, NAME, link)
        scene.world = bpy.data.worlds[NAME]
        suns = suns_of(scene.world)
        if link:
            assert not scene.objects
            scene.collection.children.link(suns)
        assert suns in list(scene.collection.children)
        assert [world.name for world in bpy.data.worlds] == [NAME]
        assert all(targets(lamp.data) >= {scene.world} for lamp in lamps_of(suns))
        lamp = lamps_of(suns)[0]
        lamp.update_tag()
        assert to_light(lamp)[2] > 0
    finally:
        sunsplit.register()


def light_a_plate(scene):
    add_mesh(scene, plate_mesh(1), diffuse("White", 0.8), Matrix())
    camera_towards(scene, np.array([0, 0, -1]), 30, 48).location = (0, 0, 2)


def test_it_lights_as_the_map_does(tmp_path, sunrise):
    hdri = Path(shutil.copy(sunrise, tmp_path))
    # As in tests/render: by default, level ground may be wrong by 0.5 % of the mean light.
    save(convert(load(hdri), ConversionSettings(tolerance=0.2)), tmp_path)
    with worker() as ask:
        assert ask(job_for(tmp_path, hdri))["sentence"] == ""
    file = tmp_path / f"{hdri.stem}.blend"
    scene = fresh_scene()
    hdri_world(scene, sunrise)
    light_a_plate(scene)
    plain = estimate(scene, tmp_path, 64)
    brought("World", file, NAME)
    used(scene, bpy.data.worlds[NAME])
    means_agree(plain, estimate(scene, tmp_path, 64), tmp_path)


@pytest.mark.parametrize("residual", ["none", "voronoi"])
def test_other_residuals_make_the_worlds_that_a_conversion_makes(tmp_path, residual):
    pixels = sky(256, 0.0) + np.linspace(0.5, 0.1, 128)[:, None, None] * (0.8, 1, 1.2)
    paint_disc(pixels, direction(40, 30), 2, (900, 900, 900))
    hdri = write_map(tmp_path / "map.exr", pixels)
    settings = ConversionSettings(residual=residual, lights=1)
    save(convert(load(hdri), settings), tmp_path)
    with worker() as ask:
        assert ask(job_for(tmp_path, hdri))["sentence"] == ""
    scene = fresh_scene()
    hdri_world(scene, hdri)
    bpy.ops.sunsplit.convert(lights=1, residual=residual, skips=False)
    wanted = description(scene.world)
    brought("World", tmp_path / "map.blend", NAME)
    used(scene, bpy.data.worlds[NAME])
    assert description(scene.world) == wanted


def description(world):
    """What lights: nodes, how their images are read, and how Cycles looks for light."""
    nodes = sorted(
        (
            n.bl_idname,
            n.name if n.name.startswith("Sunsplit") else "",
            getattr(n, "interpolation", ""),
        )
        for n in world.node_tree.nodes
    )
    cycles = world.cycles
    return nodes, cycles.sampling_method, cycles.sample_map_resolution, world.sun_threshold
