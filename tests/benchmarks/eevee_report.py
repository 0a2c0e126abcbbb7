"""Tables, plot and pictures of the benchmark `eevee`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image, ImageDraw

if TYPE_CHECKING:
    from tests.benchmarks.eevee import Result

NORMALS = np.array(
    [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (1, 1, 1), (-1, 1, -1)],
    float,
)
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
"""What the plates face: `eevee_renders.ORIENTATIONS` as unit vectors, (8, 3)."""

SHOWN = ("cycles", "default", "zero", "converted")
TITLES = {
    "cycles": "Cycles",
    "default": "EEVEE as it comes",
    "zero": "EEVEE, threshold 0",
    "converted": "EEVEE, converted",
}
ENLARGED = 2


def with_truth(result: Result, truth: np.ndarray) -> Result:
    return replace(result, truth=truth)


def line(result: Result) -> str:
    """A row of the table."""
    ways = ("default", "zero", "converted")
    errors = " | ".join(f"{result.wrong(way):.1%} ({result.mean(way):.3f})" for way in ways)
    seconds = " / ".join(f"{result.seconds[way]:.1f}" for way in ways)
    return (
        f"| {result.map} | {errors} | **{result.gain:.1f}** | {result.noise:.1%} "
        f"| {result.wrong('converted in cycles'):.1%} | {result.lamps} | {result.share:.1%} "
        f"| {result.predicted:.1%} | {seconds} |"
    )


HEAD = (
    "| map | as it comes | threshold 0 | converted | times less wrong | noise of Cycles "
    "| converted, in Cycles | lamps | light in lamps | predicted | seconds a frame |",
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
)

SCENES = {
    "plate": "A white plate in eight orientations, nothing else",
    "shadows": "Torus, sphere and eight slabs on a ground",
}


def write(results: Sequence[Result], folder: Path, name: str) -> None:
    """The tables, the plot and the pictures of what has been measured so far."""
    first = results[0]
    lines = [
        "# EEVEE against Cycles",
        "",
        f"Blender {first.blender}, EEVEE on llvmpipe with {first.samples} samples, direct light "
        "only. Root mean square of the difference from Cycles with the plain HDRI, over all "
        "surfaces and channels, the noise of Cycles taken off, in percent of the mean; in brackets "
        "the ratio of the means. "
        "Times less wrong: converted, than the better of the first two. Seconds of a frame: of "
        "the three in EEVEE, on two cores without a graphics card; on a machine that did other "
        "things too, so only ratios tell.",
    ]
    for scene, title in SCENES.items():
        mine = [one for one in results if one.scene == scene]
        if mine:
            lines += ["", f"## {title}", "", *HEAD, *(line(one) for one in mine)]
        known = [one for one in mine if one.truth is not None]
        if known:
            lines += ["", *_level_plates(known)]
    (folder / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    pictures = [one for one in results if one.scene == "shadows"]
    if pictures:
        _plot(pictures, folder / f"{name}.png")
        _side_by_side(pictures, folder / f"{name}-pictures.png")


def _level_plates(results: Sequence[Result]) -> list[str]:
    """Of the first orientation, against the closed form."""
    lines = [
        "The plate that faces up, reflected radiance (mean of the channels):",
        "",
        "| map | closed form | Cycles | as it comes | threshold 0 | converted "
        "| converted, in Cycles |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    ways = ("default", "zero", "converted", "converted in cycles")
    for one in results:
        assert one.truth is not None
        found = [one.reference, *(one.images[way] for way in ways)]
        cells = " | ".join(f"{image[0, 0, :3].mean():.4g}" for image in found)
        lines.append(f"| {one.map} | {one.truth[0].mean():.4g} | {cells} |")
    return lines


def _plot(results: Sequence[Result], path: Path) -> None:
    """Errors, map by map, the plain HDRI's at its best setting beside the conversion's."""
    ordered = sorted(results, key=lambda one: -one.gain)
    plain = [100 * min(one.wrong("default"), one.wrong("zero")) for one in ordered]
    split = [100 * one.wrong("converted") for one in ordered]
    place = np.arange(len(ordered))
    figure, axes = plt.subplots(figsize=(8, 0.4 * len(ordered) + 1.4), layout="constrained")
    axes.barh(place - 0.2, plain, 0.4, label="plain HDRI, at its best setting", color="#b0b7c3")
    axes.barh(place + 0.2, split, 0.4, label="converted", color="#e08a1e")
    for k, one in enumerate(ordered):
        axes.text(plain[k], k - 0.2, f" {one.gain:.1f} x", va="center", fontsize=8)
    axes.set_yticks(place, [one.map for one in ordered])
    axes.invert_yaxis()
    axes.set_xlim(0, 1.1 * max(plain))
    axes.set_xlabel("EEVEE against Cycles, RMS in % of the mean")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _side_by_side(results: Sequence[Result], path: Path) -> None:
    """Each map as a row, each way as a column."""
    rows = [np.concatenate([_tone(one, way) for way in SHOWN], axis=1) for one in results]
    image = Image.fromarray(np.concatenate(rows))
    pen = ImageDraw.Draw(image)
    width, height = image.width // len(SHOWN), image.height // len(results)
    for row, one in enumerate(results):
        for column, way in enumerate(SHOWN):
            text = f"{one.map}\n{TITLES[way]}" if column == 0 else TITLES[way]
            if column:
                text += f"\n{one.wrong(way):.1%}"
            pen.text((column * width + 4, row * height + 3), text, fill="white")
    image.save(path, optimize=True)


def _tone(result: Result, way: str) -> np.ndarray:
    """As bright as Cycles' picture has it, enlarged, (height, width, 3) bytes."""
    scale = 0.35 / np.median(result.reference[..., :3])
    shown = np.clip(result.images[way][..., :3] * scale, 0, 1) ** (1 / 2.2)
    enlarged = shown.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    return (enlarged * 255).astype(np.uint8)
