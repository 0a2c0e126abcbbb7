"""What looking at a scene costs, and how soon another setting answers.

    .venv-5.2/bin/python -m tests.benchmarks.looking MAP ... [-o FOLDER] [--width 4096] ...

Looking at a scene of many triangles, of many objects, and of a forest of many instances, each also
while its camera turns; at a scene where nothing can be skipped,
as a part of converting and rendering it, interleaved with and without, all under the first map;
and under each map, converting again with another number of lights, another share, and with the
world turned. Medians.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from sunsplit.addon import known
from sunsplit.addon.images import read_image
from sunsplit.addon.options import SceneOptions
from sunsplit.addon.rays import Reach
from sunsplit.addon.restoring import restore_scene
from sunsplit.addon.scene import convert_scene
from sunsplit.addon.scene_needs import needs_of
from sunsplit.addon.steps import run_at_once
from sunsplit.addon.world import WorldLight, find_light
from sunsplit.core.environment import EnvironmentMap
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.visible import visible_part
from tests.benchmarks.equal_error import enlarged
from tests.benchmarks.scenes import SCENES
from tests.blender import (
    add_mapping,
    add_mesh,
    ball_mesh,
    diffuse,
    material,
    plate_mesh,
    suns,
    timed_render,
)


@dataclass(frozen=True)
class Result:
    what: str
    seconds: float


def seconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def looks(path: Path, options: argparse.Namespace) -> list[Result]:
    """The first look, which has to sort the triangles, the next, and one at several frames."""
    found = []
    for what, build, size in (
        (f"{2 * options.side**2:,} triangles", _with_hills, options.side),
        (f"{options.objects:,} objects", _with_objects, options.objects),
        (f"{options.instances:,} instances", _with_forest, options.instances),
    ):
        scene = build(path, size)
        bpy.context.view_layer.update()
        found.append(Result(f"look at {what}, first", seconds(partial(_reach, scene))))
        again = [seconds(partial(_reach, scene)) for _ in range(options.repeats)]
        found.append(Result(f"look at {what}, again", float(np.median(again))))
        _turn_camera(scene)
        turned = [seconds(partial(_reach, scene)) for _ in range(options.repeats)]
        count = needs_of(scene).looked[0]
        label = f"look at {what}, {count} frames of a turning camera"
        found.append(Result(label, float(np.median(turned))))
    return found


def _turn_camera(scene: bpy.types.Scene) -> None:
    """By 90 degrees in 250 frames."""
    camera = scene.camera
    camera.rotation_mode = "XYZ"
    for frame, turn in ((1, 0), (250, np.pi / 2)):
        camera.rotation_euler[2] += turn
        camera.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)


def _reach(scene: bpy.types.Scene) -> Reach:
    return run_at_once(Reach.steps(needs_of(scene).sight))


def _with_hills(path: Path, side: int) -> bpy.types.Scene:
    """The outdoor scene on a ground of side x side squares."""
    scene = SCENES["outdoor"](path, 96)
    x, y = np.meshgrid(np.linspace(-40, 40, side + 1), np.linspace(-40, 40, side + 1))
    corners = np.stack([x, y, 0.05 * np.sin(3 * x) * np.cos(2 * y) - 0.1], axis=-1).reshape(-1, 3)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.stack([first, first + 1, first + side + 2, first + side + 1], axis=-1)
    mesh = bpy.data.meshes.new("Hills")
    mesh.from_pydata(corners, [], faces)
    add_mesh(scene, mesh, diffuse("Hills", 0.5), Matrix())
    return scene


def _with_objects(path: Path, count: int) -> bpy.types.Scene:
    scene = SCENES["outdoor"](path, 96)
    stone = diffuse("Stone", 0.5)
    rows = int(np.sqrt(count))
    for number in range(count - len(scene.objects)):
        place = Matrix.Translation((number % rows - rows / 2, number // rows - rows / 2, 0.01))
        add_mesh(scene, plate_mesh(0.2), stone, place)
    return scene


def _with_forest(path: Path, count: int) -> bpy.types.Scene:
    """Instances of a collection with a ball in it."""
    scene = SCENES["outdoor"](path, 96)
    trees = bpy.data.collections.new("Trees")
    tree = bpy.data.objects.new("Tree", ball_mesh(0.4))
    tree.data.materials.append(diffuse("Leaf", 0.5))
    trees.objects.link(tree)
    half = 0.6 * np.sqrt(count)
    for x, y in np.random.default_rng(0).uniform(-half, half, (count, 2)):
        place = bpy.data.objects.new("Place", None)
        place.instance_type, place.instance_collection = "COLLECTION", trees
        place.location = (x, y, 0.4)
        scene.collection.objects.link(place)
    return scene


def overhead(path: Path, options: argparse.Namespace) -> tuple[float, float]:
    """Looking at a scene where nothing can be skipped; converting and rendering it."""
    scene = SCENES["glossy"](path, options.size)
    floor = next(thing for thing in scene.objects if thing.name.startswith("Plate"))
    scene.collection.objects.unlink(floor)
    # Light comes through the pane from everywhere.
    pane = material("Pane", (1, 1, 1), Transmission_Weight=1, Roughness=0.3)
    add_mesh(scene, plate_mesh(0.8), pane, Matrix.Translation((0, 0, 1.5)))
    scene.render.resolution_x = scene.render.resolution_y = 4 * options.size
    bpy.context.view_layer.update()
    bpy.ops.sunsplit.convert()
    if "Skipped" in scene.sunsplit.report:
        raise AssertionError(scene.sunsplit.report)
    restore_scene(scene)
    light = find_light(scene.world)
    environment = run_at_once(read_image(light.image))
    looked, made = [], []
    with tempfile.TemporaryDirectory() as name:
        for _ in range(2 * options.repeats):
            looked.append(seconds(partial(_look, scene, environment, light)))
            known.forget()
            keep = SceneOptions(skips=False)
            converted = seconds(partial(convert_scene, scene, ConversionSettings(), keep))
            made.append(converted + timed_render(scene, Path(name), options.samples, 0)[1])
            restore_scene(scene)
            light = find_light(scene.world)
    return float(np.median(looked)), float(np.median(made))


def _look(scene: bpy.types.Scene, environment: EnvironmentMap, light: WorldLight) -> None:
    """All that is done to know what may be skipped."""
    visible_part(environment, _reach(scene).looks(light.map_from_world, run_at_once))


@dataclass(frozen=True)
class Changes:
    """Of one map: seconds to convert it first, and again with another number of lights, another
    share and the world turned. suns: that Sunsplit makes of it by itself."""

    name: str
    suns: int
    first: float
    lights: float
    share: float
    turned: float


def changes(path: Path, options: argparse.Namespace) -> Changes:
    """Converting again after a change."""
    with tempfile.TemporaryDirectory() as name:
        scene = SCENES["outdoor"](enlarged(path, options.width, Path(name)), 96)
        texture = next(n for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT")
        mapping = add_mapping(texture)
        known.forget()
        first = _convert(scene)
        lamps = len(suns(scene))
        _convert(scene, lights=8)
        lights = [_convert(scene, lights=n) for n in (16, 4, 12, 6, 10)]
        shares = [_convert(scene, share=s) for s in (0.5, 0.6, 0.55, 0.7, 0.65)]
        _convert(scene)
        turns = []
        for turn in (0.1, 0.2, 0.3, 0.4, 0.5):
            nodes = scene.world.node_tree.nodes
            nodes[mapping.name].inputs["Rotation"].default_value[2] = turn
            turns.append(_convert(scene))
    again = (float(np.median(times)) for times in (lights, shares[1:], turns))
    return Changes(path.stem, lamps, first, *again)


def _convert(scene: bpy.types.Scene, **chosen: object) -> float:
    return seconds(lambda: convert_scene(scene, ConversionSettings(**chosen)))


def main(arguments: Sequence[str] | None = None) -> tuple[list[Result], list[Changes]]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--width", type=int, default=4096, help="of the maps that are changed")
    parser.add_argument("--side", type=int, default=707, help="squares along the hills")
    parser.add_argument("--objects", type=int, default=5000)
    parser.add_argument("--instances", type=int, default=20_000)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.maps[0].resolve()
    results = looks(path, options)
    looked, made = overhead(path, options)
    changed = [changes(one.resolve(), options) for one in options.maps]
    lines = [
        "# What looking at a scene costs, and how soon another setting answers",
        "",
        f"Blender {bpy.app.version_string}, {path.stem}; changes on maps enlarged to "
        f"{options.width} pixels. Seconds, medians.",
        "",
        "| what | seconds |",
        "| --- | --- |",
        *(f"| {one.what} | {one.seconds:.3f} |" for one in results),
        "",
        f"Where nothing can be skipped, looking takes {looked / made:.1%} of what converting and "
        f"rendering with {options.samples} samples takes ({looked:.3f} of {made:.2f} s, "
        "interleaved).",
        "",
        "| map | suns | convert, first | another number of lights | another share | turned |",
        "| --- | --- | --- | --- | --- | --- |",
        *(
            f"| {one.name} | {one.suns} | {one.first:.2f} | {one.lights:.3f} | {one.share:.3f} "
            f"| {one.turned:.3f} |"
            for one in changed
        ),
    ]
    text = "\n".join(lines) + "\n"
    (options.output / "looking.md").write_text(text, encoding="utf-8")
    print(text)
    return results, changed


if __name__ == "__main__":
    main()
