"""The preview: the map, region A outlined, every sun at its true size, and a legend."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .. import sphere
from ..conversion import Conversion
from ..environment import LUMINANCE_WEIGHTS, luminance
from ..outlines import lines_in_image
from ..suns import Sun

WIDTH = 1280
"""Pixels; a wider map is averaged down to it, a narrower one enlarged."""

REGION = (255, 64, 200)
SUN = (255, 225, 0)
MARKER = (14, 24)
"""The four lines around a sun's centre begin and end so many pixels from it."""

PAPER, INK = (24, 24, 27), (235, 235, 235)


def draw_preview(conversion: Conversion) -> Image.Image:
    """An sRGB picture of the map with what became of it, and a legend below."""
    environment = conversion.environment
    picture = Image.fromarray(tone_mapped(environment.radiance))
    picture = picture.resize((WIDTH, WIDTH // 2), Image.Resampling.BOX)
    picture.paste(REGION, mask=outline(conversion.strata.region_a, WIDTH))
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(15)
    for sun in conversion.suns:
        _draw_sun(draw, sun)
    for rank, sun in reversed(list(enumerate(conversion.suns, start=1))):
        _draw_name(draw, sun, str(rank), font)  # above all circles, the brightest on top
    lines = _legend(conversion)
    sheet = Image.new("RGB", (WIDTH, WIDTH // 2 + 22 * len(lines) + 16), PAPER)
    sheet.paste(picture)
    text = ImageDraw.Draw(sheet)
    for number, (colour, line) in enumerate(lines):
        text.text((14, WIDTH // 2 + 8 + 22 * number), line, colour, font)
    return sheet


def middle_of(lum: NDArray[np.float64]) -> float:
    """The luminance that becomes a middle grey: the median of the pixels that shine."""
    lit = lum[lum > 0]
    return float(np.median(lit)) if lit.size else 1.0


def tone_mapped(radiance: NDArray[np.float32], middle: float | None = None) -> NDArray[np.uint8]:
    """Radiance as sRGB bytes: `middle` becomes a middle grey, highlights roll off.

    middle: a luminance, so that several pictures share it; by default the radiance's own median.
    """
    lum = luminance(radiance)
    if middle is None:
        middle = middle_of(lum)
    # In float64 by name: numpy 1.26 would stay in float32 and overflow at a bright sun.
    exposed = np.multiply(radiance, 0.18 / middle, dtype=np.float64)
    bright = (lum * (0.18 / middle))[..., None]
    # Reinhard's curve on luminance keeps colours; the clip afterwards only touches pure lights.
    mapped = np.clip(exposed * 1.4 / (1 + bright), 0, 1)
    low = mapped * 12.92
    high = 1.055 * np.maximum(mapped, 0.0031308) ** (1 / 2.4) - 0.055
    return np.round(255 * np.where(mapped <= 0.0031308, low, high)).astype(np.uint8)


def most(values: NDArray, width: int) -> NDArray:
    """A plane (H, W) at another size, (width / 2, width): the greatest value in each pixel.

    So no pixel of a large map is lost between two of a picture; a small map is enlarged.
    """
    height, old_width = values.shape
    rows = np.arange(width // 2) * height // (width // 2)
    columns = np.arange(width) * old_width // width
    return np.maximum.reduceat(np.maximum.reduceat(values, rows), columns, axis=1)


def outline(region: NDArray[np.bool_], width: int) -> Image.Image:
    """The pixels just outside of a region (H, W), as a mask for a picture of this width."""
    from scipy.ndimage import binary_dilation

    inside = most(region, width)
    return Image.fromarray(binary_dilation(inside, iterations=2) & ~inside)


def _draw_sun(draw: ImageDraw.ImageDraw, sun: Sun) -> None:
    for line in lines_in_image(sphere.circle(sun.to_light, sun.angular_diameter / 2)):
        draw.line([(u * WIDTH, v * WIDTH / 2) for u, v in line], SUN, 2)
    centre = np.array(_place(sun))
    for turn in (-WIDTH, 0, WIDTH):  # what leaves at the seam comes back
        for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            ends = [centre + (turn, 0) + reach * np.array(step) for reach in MARKER]
            draw.line([tuple(end) for end in ends], SUN, 2)


def _place(sun: Sun) -> tuple[float, float]:
    """Where a sun's centre lies in the picture."""
    u, v = sphere.to_image(sun.to_light)
    return float(u) * WIDTH, float(v) * WIDTH / 2


def _draw_name(
    draw: ImageDraw.ImageDraw, sun: Sun, name: str, font: ImageFont.FreeTypeFont
) -> None:
    x, y = _place(sun)
    left = x + 45 > WIDTH
    anchor = ("r" if left else "l") + ("a" if y < 40 else "d")
    place = (x - 10 if left else x + 10, y + 10 if y < 40 else y - 10)
    draw.text(place, name, SUN, font, anchor=anchor, stroke_width=2, stroke_fill=PAPER)


def _legend(conversion: Conversion) -> list[tuple[tuple[int, int, int], str]]:
    environment, account = conversion.environment, conversion.account
    # A file's name may hold bytes that are no text, and those cannot be drawn.
    name = environment.name.encode(errors="replace").decode()
    all_light = account.source @ LUMINANCE_WEIGHTS
    lines = [
        (INK, f"{name}   {environment.own_width} x {environment.own_height}"),
        (REGION, f"Outline: region A, {conversion.strata.share:.1%} of all light"),
        (SUN, f"Circles: {_suns(conversion)}, {account.share:.1%} of all light, true size"),
    ]
    for rank, sun in enumerate(conversion.suns[:8], start=1):
        part = sun.scalar_irradiance @ LUMINANCE_WEIGHTS / all_light
        elevation = np.degrees(np.arctan2(sun.to_light[2], np.hypot(*sun.to_light[:2])))
        size = np.degrees(sun.angular_diameter)
        text = f"  {rank}: {part:.2%}, {size:.2f}° wide, elevation {elevation:+.1f}°"
        lines.append((SUN, text))
    if len(conversion.suns) > 8:
        lines.append((SUN, f"  and {len(conversion.suns) - 8} more"))
    return lines


def _suns(conversion: Conversion) -> str:
    count = len(conversion.suns)
    return "1 sun" if count == 1 else f"{count} suns"
