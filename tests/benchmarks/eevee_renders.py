"""The renders of the benchmark `eevee`, in a process of their own: EEVEE ends it where there is no
EGL, and cannot be asked before.

    python -m tests.benchmarks.eevee_renders MAP OUT --scene shadows --size 96 ...

OUT gets an image for each way, `<way>.npy`, (height, width, 4), and `renders.json`.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from sunsplit.addon.scene import convert_scene
from sunsplit.core.settings import ConversionSettings
from tests.benchmarks.table1_scene import key_azimuth
from tests.blender import (
    add_mesh,
    ball_mesh,
    box_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    timed_render,
)

MOVE = Matrix.Translation

EEVEE = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"

ORIENTATIONS = (
    *((0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)),
    *((1, 1, 1), (-1, 1, -1)),
)
"""What a plate faces."""

CYCLES, AGAIN, DEFAULT, ZERO, CONVERTED = "cycles", "cycles again", "default", "zero", "converted"
"""Ways: the reference and the same with another seed, EEVEE with the plain HDRI as it comes and at
threshold 0, and converted."""

CONVERTED_IN_CYCLES = "converted in cycles"


@dataclass(frozen=True)
class Renders:
    """seconds: of a frame, by way. lamps, share, predicted: of the conversion."""

    map: str
    scene: str
    blender: str
    samples: int
    lamps: int
    share: float
    predicted: float
    seconds: dict[str, float]


def shadows(path: Path, size: int) -> bpy.types.Scene:
    """A torus, a sphere and eight slabs on a ground, seen past the key light."""
    scene = fresh_scene()
    hdri_world(scene, path)
    turn = Matrix.Rotation(key_azimuth(path) + np.radians(35), 4, "Z")
    add_mesh(scene, plate_mesh(40), diffuse("Ground", 0.5), turn)
    for number in range(8):
        angle = number * np.pi / 4 + 0.2
        around = MOVE((2.1 * np.cos(angle), 2.1 * np.sin(angle), 0))
        place = turn @ around @ Matrix.Rotation(angle, 4, "Z")
        add_mesh(scene, box_mesh(0.08, 0.35, 0.5), diffuse("Slab", 0.7), place)
    add_mesh(scene, ball_mesh(0.5), diffuse("Ball", 0.7), turn @ MOVE((0.65, 0.35, 0.5)))
    ring = turn @ MOVE((-0.6, -0.3, 0.55)) @ Matrix.Rotation(1.1, 4, "X")
    add_mesh(scene, torus_mesh(0.5, 0.2), diffuse("Torus", 0.7), ring)
    place, aim = Vector((1.5, -5.5, 3.8)), Vector((0, 0, 0.35))
    camera = camera_towards(scene, np.array(turn.to_3x3() @ (aim - place)), 44, size)
    camera.location = turn @ place
    return scene


def torus_mesh(major: float, minor: float) -> bpy.types.Mesh:
    """A smooth torus around +Z."""
    around, about = 64, 32
    turn = np.arange(around)[:, None] * 2 * np.pi / around
    roll = np.arange(about) * 2 * np.pi / about
    reach = major + minor * np.cos(roll)
    up = np.broadcast_to(minor * np.sin(roll), (around, about))
    corners = np.stack([np.cos(turn) * reach, np.sin(turn) * reach, up], axis=-1).reshape(-1, 3)
    number = np.arange(around * about).reshape(around, about)
    ahead = np.roll(number, -1, axis=0)
    sides = np.stack([number, ahead, np.roll(ahead, -1, axis=1), np.roll(number, -1, axis=1)], -1)
    mesh = bpy.data.meshes.new("Torus")
    mesh.from_pydata(corners.tolist(), [], sides.reshape(-1, 4).tolist())
    mesh.shade_smooth()
    return mesh


def plate(path: Path, size: int) -> bpy.types.Scene:
    """A white plate that fills the picture; `face` turns it."""
    scene = fresh_scene()
    hdri_world(scene, path)
    thing = add_mesh(scene, plate_mesh(0.5), diffuse("Plate", 1.0), Matrix())
    thing.name = "Plate"
    camera_towards(scene, np.array([0, 0, -1.0]), 20, size)
    return scene


def face(scene: bpy.types.Scene, normal: tuple[float, float, float]) -> None:
    """Turn the plate and the camera before it."""
    turn = Vector(normal).normalized().to_track_quat("Z", "Y")
    for thing in (bpy.data.objects["Plate"], scene.camera):
        thing.rotation_mode = "QUATERNION"
        thing.rotation_quaternion = turn
    scene.camera.location = turn @ Vector((0, 0, 1))


def render(
    scene: bpy.types.Scene, folder: Path, engine: str, samples: int, seed: int = 0
) -> tuple[np.ndarray, float]:
    """Direct light only: pixels and alpha, (height, width, 4), and seconds."""
    scene.render.engine = engine
    scene.cycles.max_bounces = 0
    scene.eevee.taa_render_samples = samples
    return timed_render(scene, folder, samples, seed)


def in_orientations(
    scene: bpy.types.Scene,
    folder: Path,
    engine: str,
    samples: int,
    seed: int = 0,
    count: int = len(ORIENTATIONS),
) -> tuple[np.ndarray, float]:
    """One mean for each of the first orientations, (1, count, 4), and seconds of one."""
    found, seconds = [], []
    for normal in ORIENTATIONS[:count]:
        face(scene, normal)
        image, took = render(scene, folder, engine, samples, seed)
        found.append(image.mean(axis=(0, 1)))
        seconds.append(took)
    return np.array(found)[None], float(np.median(seconds))


SCENES: dict[str, tuple[Callable, Callable, int]] = {
    "shadows": (shadows, render, 96),
    "plate": (plate, in_orientations, 4),
}
"""What makes each scene, what renders it, and pixels along a side."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("map", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--scene", choices=SCENES, default="shadows")
    parser.add_argument("--size", type=int)
    parser.add_argument("--plates", type=int, default=len(ORIENTATIONS))
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--reference", type=int, default=512)
    options = parser.parse_args()
    make, pictures, size = SCENES[options.scene]
    if options.scene == "plate":
        pictures = partial(pictures, count=options.plates)
    scene = make(options.map.resolve(), options.size or size)
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = "RGBA"
    folder = options.output
    folder.mkdir(parents=True, exist_ok=True)
    seconds: dict[str, float] = {}

    def keep(way: str, engine: str, samples: int, seed: int = 0) -> None:
        image, seconds[way] = pictures(scene, folder, engine, samples, seed)
        np.save(folder / f"{way}.npy", image)

    keep(CYCLES, "CYCLES", options.reference)
    keep(AGAIN, "CYCLES", options.reference, seed=1)
    render(scene, folder, EEVEE, 1)  # EEVEE compiles for a while
    keep(DEFAULT, EEVEE, options.samples)
    scene.world.sun_threshold = 0.0
    keep(ZERO, EEVEE, options.samples)
    settings = ConversionSettings(target="eevee")
    found = convert_scene(scene, settings).conversion
    render(scene, folder, EEVEE, 1)
    keep(CONVERTED, EEVEE, options.samples)
    keep(CONVERTED_IN_CYCLES, "CYCLES", options.reference)
    done = Renders(
        options.map.stem,
        options.scene,
        bpy.app.version_string,
        options.samples,
        len(found.suns),
        found.account.share,
        found.predicted_error,
        seconds,
    )
    (folder / "render.exr").unlink()
    (folder / "renders.json").write_text(json.dumps(asdict(done), indent=1), encoding="utf-8")


if __name__ == "__main__":
    started = time.perf_counter()
    main()
    print(f"{time.perf_counter() - started:.0f} s")
