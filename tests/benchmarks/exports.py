"""Exports rendered: every renderer that can be had against Cycles under the plain HDRI.

    python -m tests.benchmarks.exports MAP ... -o out

For each map: the scene that comes with every export, and a white plate that faces eight ways, from
the exported files by Mitsuba, by POV-Ray, and by Cycles through Blender's importers of USD and
glTF. What is written for pbrt is added up from its files, for the plates alone. Writes exports.md
and exports.jpg, the renderers' pictures side by side.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from sunsplit.core import read_skylight
from sunsplit.core.export.axes import Y_UP, Y_UP_LEFT
from tests import exports_in_blender, mitsuba_renders, pbrt_files, povray_renders
from tests.exporting import (
    HEIGHT,
    WIDTH,
    Reference,
    Shadows,
    converted,
    exported,
    reference,
    shadows_of,
)
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit


@dataclass(frozen=True)
class Renderer:
    """stage: renders an export's scene, (folder, name, samples, seed) -> (height, width, 3); None
    where there is no program. plate: the same of a plate with a normal, only its mean, (3,)."""

    title: str
    format: str
    options: tuple[str, ...]
    stage: Callable[[Path, str, int, int], np.ndarray] | None
    plate: Callable[[Path, str, np.ndarray, int], np.ndarray]
    samples: int


def _mitsuba(folder: Path, name: str, samples: int, seed: int) -> np.ndarray:
    return mitsuba_renders.picture(folder / f"{name}.scene.xml", WIDTH, HEIGHT, samples, seed)


def _mitsuba_plate(folder: Path, name: str, normal: np.ndarray, samples: int) -> np.ndarray:
    lights = folder / f"{name}.lights.xml"
    return mitsuba_renders.plate(lights, normal, Y_UP.of, samples, 1).mean(axis=(0, 1))


def _povray(folder: Path, name: str, *_: int) -> np.ndarray:
    scene = folder / f"{name}.scene.pov"
    return povray_renders.picture(scene, WIDTH, HEIGHT, "+A0.1", "+R3", "-J")


def _povray_plate(folder: Path, name: str, normal: np.ndarray, _: int) -> np.ndarray:
    lights = folder / f"{name}.lights.inc"
    return povray_renders.plate(lights, normal, Y_UP_LEFT.of).mean(axis=(0, 1))


def _pbrt_plate(folder: Path, name: str, normal: np.ndarray, _: int) -> np.ndarray:
    return ALBEDO / np.pi * pbrt_files.irradiance(folder / f"{name}.lights.pbrt", normal)


RENDERERS = (
    Renderer("Mitsuba 3", "mitsuba", (), _mitsuba, _mitsuba_plate, 128),
    Renderer("POV-Ray 3.7", "povray", (), _povray, _povray_plate, 1),
    Renderer(
        *("USD in Cycles", "usd", ("--reader", "blender")),
        *(exports_in_blender.usd_stage, exports_in_blender.usd_plate, 192),
    ),
    Renderer(
        *("glTF in Cycles", "gltf", ()),
        *(exports_in_blender.gltf_stage, exports_in_blender.gltf_plate, 192),
    ),
    Renderer("pbrt-v4, added up", "pbrt", (), None, _pbrt_plate, 1),
)


@dataclass(frozen=True, eq=False)
class Row:
    """Of a map and a renderer. means: of each channel, relative to Cycles' under the HDRI, (3,);
    plates: of each, the worst channel, relative to the plate's own
    (first) and to the mean of all eight (second), (8, 2). seconds: of the export alone."""

    map: str
    renderer: Renderer
    lamps: int
    means: np.ndarray | None
    shadows: Shadows | None
    plates: np.ndarray
    seconds: float
    picture: np.ndarray | None


def measure(
    hdri: Path, renderers: Sequence[Renderer], options: Sequence[str], quick: bool
) -> tuple[Reference, list[Row]]:
    """One map by all renderers. options: of its conversion."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        wanted = reference(hdri, folder, 16 if quick else 192, 2 if quick else 4)
        lights = converted(hdri, folder, *options)
        lamps = len(read_skylight(lights).suns)
        rows = []
        for renderer in renderers:
            own = folder / renderer.format
            started = time.perf_counter()
            exported(lights, own, renderer.format, *renderer.options)
            seconds = time.perf_counter() - started
            found = _stage(renderer, own, hdri.stem, quick)
            plates = _plates(renderer, own, hdri, quick)
            rows.append(_row(hdri.stem, renderer, lamps, wanted, found, plates, seconds))
            print(_line(rows[-1]), flush=True)
    return wanted, rows


def _stage(renderer: Renderer, folder: Path, name: str, quick: bool) -> np.ndarray | None:
    if renderer.stage is None:
        return None
    return renderer.stage(folder, name, max(renderer.samples // (16 if quick else 1), 1), 1)


def _plates(renderer: Renderer, folder: Path, hdri: Path, quick: bool) -> np.ndarray:
    names = list(ORIENTATIONS)[:: 4 if quick else 1]
    normals = [unit(ORIENTATIONS[name]) for name in names]
    wanted = np.array([ALBEDO / np.pi * irradiance(hdri, normal) for normal in normals])
    samples = 64 if quick else 400
    found = np.array([renderer.plate(folder, hdri.stem, n, samples) for n in normals])
    off = np.abs(found - wanted)
    return np.stack([(off / wanted).max(axis=1), (off / wanted.mean(axis=0)).max(axis=1)], -1)


def _row(
    name: str,
    renderer: Renderer,
    lamps: int,
    wanted: Reference,
    found: np.ndarray | None,
    plates: np.ndarray,
    seconds: float,
) -> Row:
    if found is None:
        return Row(name, renderer, lamps, None, None, plates, seconds, None)
    means = found.mean(axis=(0, 1)) / wanted.picture.mean.mean(axis=(0, 1)) - 1
    shadows = shadows_of(wanted, found)
    return Row(name, renderer, lamps, means, shadows, plates, seconds, found)


def _line(row: Row) -> str:
    means = " | ".join(f"{100 * m:+.2f}" for m in row.means) if row.means is not None else " | | "
    shadows = " | " if row.shadows is None else _shadows(row.shadows)
    own, all_plates = 100 * row.plates.max(axis=0)
    return (
        f"| {row.map} | {row.lamps} | {row.renderer.title} | {means} | {shadows} | {own:.2f} | "
        f"{all_plates:.2f} | {row.seconds:.1f} |"
    )


def _shadows(shadows: Shadows) -> str:
    if np.isnan(shadows.shift):
        return "no edges | "
    return f"{shadows.shift:.2f} | {shadows.likeness:.3f}"


def table(rows: Sequence[Row], options: Sequence[str]) -> str:
    """All of it, in Markdown. options: of the conversions."""
    how = f"with `{' '.join(options)}`" if options else "as they are by default"
    head = (
        "# Exports, rendered\n\n"
        "Made by `python -m tests.benchmarks.exports`. The scene that comes with every export, "
        f"{WIDTH} x {HEIGHT} pixels, and a white plate that faces eight ways, against Cycles under "
        f"the plain HDRI (plates: in closed form). Conversions {how}. "
        "Cycles' light tree, which leaves out light where there are more than 32 lights at "
        "infinity and a surface faces none of them whole, is off for plates.\n\n"
        "In percent; *shadows*: how many pixels they lie elsewhere at most, and how like they are, "
        "a correlation, in the window of sixteen where that is worst; *worst plate*: of the worst "
        "channel, relative to that plate, and to the mean of the eight (a dark plate's own light "
        "is a hundredth of it); seconds of the command that exports, start of Python included.\n\n"
        "| map | suns | by | red | green | blue | shadows, pixels | likeness | worst plate | "
        "of the mean | export, s |\n"
        "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n"
    )
    return head + "\n".join(map(_line, rows)) + "\n"


def picture(pictures: Sequence[tuple[str, Reference, Sequence[Row]]]) -> Image.Image:
    """A line for each map, Cycles under the HDRI first."""
    titles = ["Cycles, plain HDRI"]
    titles += [row.renderer.title for row in pictures[0][2] if row.picture is not None]
    gap, top = 6, 22
    size = len(titles) * (WIDTH + gap) - gap, top + len(pictures) * (HEIGHT + gap) - gap
    out = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(out)
    for column, title in enumerate(titles):
        draw.text((column * (WIDTH + gap) + 4, 5), title, fill="black", font_size=13)
    for line, (_, wanted, rows) in enumerate(pictures):
        shown = [wanted.picture.mean, *(row.picture for row in rows if row.picture is not None)]
        exposure = 0.42 / np.median(wanted.picture.mean)
        for column, linear in enumerate(shown):
            grey = np.clip(linear * exposure, 0, 1) ** (1 / 2.2)
            at = column * (WIDTH + gap), top + line * (HEIGHT + gap)
            out.paste(Image.fromarray((grey * 255).astype(np.uint8)), at)
    return out


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("maps", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--tolerance", help="of the conversions, in percent")
    parser.add_argument("--formats", nargs="*", help="only these")
    parser.add_argument("--pictures", nargs="*", help="names of the maps that are shown")
    parser.add_argument("--quick", action="store_true", help="too noisy to tell: for tests")
    options = parser.parse_args(arguments)
    renderers = [r for r in RENDERERS if not options.formats or r.format in options.formats]
    tolerance = ["--tolerance", options.tolerance] if options.tolerance else []
    rows, pictures = [], []
    for hdri in options.maps:
        wanted, some = measure(hdri, renderers, tolerance, options.quick)
        rows += some
        if not options.pictures or hdri.stem in options.pictures:
            pictures.append((hdri.stem, wanted, some))
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "exports.md").write_text(table(rows, tolerance), encoding="utf-8")
    if pictures:
        picture(pictures).save(options.output / "exports.jpg", quality=90, subsampling=0)
    return rows


if __name__ == "__main__":
    main()
