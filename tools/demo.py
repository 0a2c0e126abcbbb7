"""Convert the sample HDRI, apply it to the sample scene in Blender, render before and after.

./run demo [--hdri FILE] [--samples N] [--width PIXELS] [-o FOLDER]
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import sunsplit
from sunsplit.core.cli import main as sunsplit_command
from sunsplit.core.files import exr
from sunsplit.core.pixels import whole

SAMPLES = Path(__file__).resolve().parent.parent / "sample_scenes"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hdri", type=Path, default=SAMPLES / "spruit_sunrise_1k.hdr")
    parser.add_argument("--samples", type=int, default=64, help="per pixel (default: 64)")
    parser.add_argument("--width", type=int, default=640, help="of the pictures (default: 640)")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    options = parser.parse_args()
    folder = options.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "blender.log"
    sys.stdout.reconfigure(line_buffering=True)
    print(f"1. Converting {options.hdri.name} on the command line")
    if sunsplit_command(["convert", str(options.hdri), "-o", str(folder), "--preview"]):
        raise SystemExit(1)
    print(f"2. Rendering the sample scene in Blender {bpy.app.version_string} with Cycles")
    with blender_talks_to(log):
        scene = open_scene(options.hdri, options.width, options.samples)
        before, seconds_before = render(scene, folder / "before")
        bpy.ops.sunsplit.convert()
        after, seconds_after = render(scene, folder / "after")
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "converted.blend"), compress=True)
    print(f"   before {seconds_before:.1f} s, after {seconds_after:.1f} s")
    strip = folder / "before, after, difference.png"
    side_by_side(folder, before, after).save(strip)
    print("3. Result")
    report(before, after, scene)
    names = ("before.png", "after.png", strip.name, "converted.blend", log.name)
    for path in (folder / name for name in names):
        print(f"   {path}")


@contextmanager
def blender_talks_to(log: Path) -> Iterator[None]:
    """Blender's own lines about every sample go into a file."""
    sys.stdout.flush()
    kept = os.dup(1)
    with log.open("wb") as file:
        os.dup2(file.fileno(), 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def open_scene(hdri: Path, width: int, samples: int) -> bpy.types.Scene:
    """The sample scene with a map, its add-on registered."""
    sunsplit.register()
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLES / "courtyard.blend"))
    scene = bpy.context.scene
    texture = next(n for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT")
    texture.image = bpy.data.images.load(str(hdri.resolve()), check_existing=True)
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.cycles.samples = samples
    return scene


def render(scene: bpy.types.Scene, path: Path) -> tuple[np.ndarray, float]:
    """Render once and write a picture to look at; the linear pixels, and how long it took."""
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(path.with_suffix(".exr"))
    started = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds = time.perf_counter() - started
    settings.file_format, settings.color_depth = "PNG", "8"
    bpy.data.images["Render Result"].save_render(str(path.with_suffix(".png")), scene=scene)
    return whole(exr.read(path.with_suffix(".exr"))[0]).astype(np.float64), seconds


def side_by_side(folder: Path, before: np.ndarray, after: np.ndarray) -> Image.Image:
    """Before, after, and what is brighter or darker than the other, four times as strong."""
    pictures = [Image.open(folder / f"{name}.png").convert("RGB") for name in ("before", "after")]
    scale = 4 * 0.25 / np.median(before)
    difference = np.clip(0.5 + (after - before) * scale, 0, 1)
    pictures.append(Image.fromarray((difference * 255).astype(np.uint8)))
    width, height = pictures[0].size
    strip = Image.new("RGB", (3 * width + 16, height), "white")
    draw, font = ImageDraw.Draw(strip), ImageFont.load_default(18)
    titles = ("HDRI", "suns + residual", "difference x 4")
    for number, (picture, title) in enumerate(zip(pictures, titles, strict=True)):
        strip.paste(picture, (number * (width + 8), 0))
        place = number * (width + 8) + 12, height - 32
        draw.text(place, title, "white", font, stroke_width=2, stroke_fill="black")
    return strip


def report(before: np.ndarray, after: np.ndarray, scene: bpy.types.Scene) -> None:
    for line in scene.sunsplit.report.splitlines():
        print(f"   {line}")
    ratio = after.mean(axis=(0, 1)) / before.mean(axis=(0, 1)) - 1
    print("   Mean of the picture, red green blue: " + " ".join(f"{r:+.2%}" for r in ratio))


if __name__ == "__main__":
    main()
