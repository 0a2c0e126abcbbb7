"""Sheets of labelled panels: equirectangular pictures in two columns, what each shows below it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .. import sphere
from .preview import INK, PAPER

Colour = tuple[int, int, int]

WIDTH, HEIGHT = 784, 392
"""Pixels of a panel: two of them and what is between make a sheet of 1600."""

GAP, LINE = 12, 21
SHEET = 2 * WIDTH + 2 * 10 + GAP

DOT, RIM = (255, 225, 0), (0, 0, 0)
"""Seen on bright skies by its rim and in dark corners by itself."""

FINE = 8
"""Dots are drawn so many times as large, then reduced: their edges are smooth."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture of WIDTH x HEIGHT and a line or two about it."""

    picture: Image.Image
    title: str = ""


def draw_sheet(heading: str, panels: Sequence[Panel]) -> Image.Image:
    """Panels in reading order, two in a row."""
    font = ImageFont.load_default(15)
    titles = [_wrapped(panel.title, WIDTH - 8, font) for panel in panels]
    headlines = _wrapped(heading, SHEET - 28, font)
    rows = range(0, len(panels), 2)
    below = [LINE * max(len(title) for title in titles[row : row + 2]) for row in rows]
    top = 10 + LINE * len(headlines) + 6
    sheet = Image.new("RGB", (SHEET, top + sum(HEIGHT + 8 + text + GAP for text in below)), PAPER)
    draw = ImageDraw.Draw(sheet)
    _write(draw, headlines, 14, 10, font)
    for row, text in zip(rows, below, strict=True):
        for column, panel in enumerate(panels[row : row + 2]):
            left = 10 + column * (WIDTH + GAP)
            sheet.paste(panel.picture, (left, top))
            _write(draw, titles[row + column], left + 4, top + HEIGHT + 6, font)
        top += HEIGHT + 8 + text + GAP
    return sheet


def dotted(picture: Image.Image, directions: NDArray[np.float64], size: float = 1.0) -> Image.Image:
    """A panel with a dot at each of these unit vectors (n, 3), smaller where there are many.

    size: of the dots, 1 for samples.
    """
    count = len(directions)
    columns, rows = dot_pixels(directions)
    # What leaves at the seam comes back.
    columns = np.concatenate([columns - WIDTH, columns, columns + WIDTH])
    radius = 4.5 if count <= 200 else 3.5 if count <= 600 else 3.0
    return stamped(picture, columns, np.tile(rows, 3), size * radius)


def dot_pixels(directions: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Columns and rows of the pixels of a panel in which these directions (n, 3) lie, (n,)."""
    u, v = sphere.to_image(directions)
    columns = np.floor(u * WIDTH).astype(np.intp) % WIDTH
    return columns, np.minimum((v * HEIGHT).astype(np.intp), HEIGHT - 1)


def stamped(
    picture: Image.Image, columns: NDArray[np.intp], rows: NDArray[np.intp], radius: float
) -> Image.Image:
    """A picture with dots whose middles are these pixels, (n,); outside of it too."""
    out, stamp = picture.copy(), _stamp(radius)
    middle = stamp.width // 2
    for x, y in zip(columns.tolist(), rows.tolist(), strict=True):
        if -middle <= x < out.width + middle:
            out.paste(stamp, (x - middle, y - middle), stamp)
    return out


def picked(plane: NDArray) -> NDArray:
    """The nearest pixel of a map (H, W, ...) for each of a panel, (HEIGHT, WIDTH, ...)."""
    height, width = plane.shape[:2]
    rows = (2 * np.arange(HEIGHT) + 1) * height // (2 * HEIGHT)
    columns = (2 * np.arange(WIDTH) + 1) * width // (2 * WIDTH)
    return plane[rows[:, None], columns]


def averaged(pixels: NDArray[np.uint8]) -> Image.Image:
    """A map's bytes (H, W, 3) as a panel."""
    return Image.fromarray(pixels).resize((WIDTH, HEIGHT), Image.Resampling.BOX)


def borders(labels: NDArray[np.int32]) -> Image.Image:
    """Mask of the pixels whose right or lower neighbour has another label; over the seam too."""
    edge = labels != np.roll(labels, -1, axis=1)
    edge[:-1] |= labels[:-1] != labels[1:]
    return Image.fromarray(edge)


def key(entries: Iterable[tuple[Colour, str]]) -> Image.Image:
    """A panel that says what colours mean, in two columns; what does not fit is counted."""
    entries = list(entries)
    font = ImageFont.load_default(15)
    panel = Image.new("RGB", (WIDTH, HEIGHT), PAPER)
    draw = ImageDraw.Draw(panel)
    most = 2 * (HEIGHT // LINE)
    shown = entries if len(entries) <= most else entries[: most - 1]
    for number, (colour, text) in enumerate(shown):
        column, row = divmod(number, HEIGHT // LINE)
        left, top = 4 + column * WIDTH // 2, row * LINE
        draw.rectangle((left, top + 2, left + 24, top + 16), colour, INK)
        draw.text((left + 34, top), text, INK, font)
    if len(shown) < len(entries):
        text = f"and {len(entries) - len(shown)} more"
        draw.text((38 + WIDTH // 2, HEIGHT // LINE * LINE - LINE), text, INK, font)
    return panel


@cache
def _stamp(radius: float) -> Image.Image:
    """A filled circle with a rim, RGBA; its middle is the middle of a pixel."""
    size = 2 * int(np.ceil(radius)) + 1
    large = Image.new("RGBA", (size * FINE, size * FINE), (*RIM, 0))
    draw = ImageDraw.Draw(large)
    for reach, colour in ((radius, RIM), (radius - 1.2, DOT)):
        low, high = (size / 2 - reach) * FINE, (size / 2 + reach) * FINE - 1
        draw.ellipse((low, low, high, high), (*colour, 255))
    return large.resize((size, size), Image.Resampling.BOX)


def _wrapped(text: str, width: int, font: ImageFont.FreeTypeFont) -> list[str]:
    """Lines no wider than this; a word that alone is wider is cut."""
    lines = [""]
    for word in text.split():
        while font.getlength(word) > width:
            word = f"{word[: len(word) * 3 // 4]}…"
        longer = f"{lines[-1]} {word}".strip()
        if font.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _write(
    draw: ImageDraw.ImageDraw,
    lines: Sequence[str],
    left: int,
    top: int,
    font: ImageFont.FreeTypeFont,
) -> None:
    for number, line in enumerate(lines):
        draw.text((left, top + LINE * number), line, INK, font)
