"""A map as a small JPEG with its suns marked, for a report of many."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from .. import sphere
from ..conversion import Conversion
from ..files.preview import PAPER, SUN, tone_mapped
from ..outlines import lines_in_image
from ..suns import Sun

WIDTH, HEIGHT = 192, 96
"""Pixels of the picture."""

MARKED = 32
"""Suns, the brightest ones: more circles would hide the map."""

LEAST_RADIUS = 3.5
"""Pixels of a circle, so that it is seen: the sun itself is a seventh of a pixel wide."""

JPEG = {"quality": 60, "subsampling": 0, "optimize": True}
"""Colours as fine as brightness: else the yellow of a circle runs into its surroundings."""

FINE = 2
"""Circles are drawn so many times as large and then reduced: their lines become smooth."""

RING = np.stack([f(np.linspace(0, 2 * np.pi, 25)) for f in (np.cos, np.sin)], axis=-1)
"""A circle of radius 1."""

Line = list[float]
"""x, y, x, y, ... of its points."""


def thumbnail(conversion: Conversion) -> bytes:
    """A JPEG of WIDTH x HEIGHT pixels, about 5 KB; the same bytes for the same conversion."""
    picture = Image.fromarray(tone_mapped(_small(conversion.environment.radiance)))
    lines = [line for sun in conversion.suns[:MARKED] for line in _circle(sun)]
    # A dark rim first: yellow lines on a yellow sky would not be seen.
    picture.paste(PAPER, mask=_mask(lines, 5))
    picture.paste(SUN, mask=_mask(lines, 2))
    out = io.BytesIO()
    picture.save(out, "JPEG", **JPEG)
    return out.getvalue()


def _small(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """The mean radiance of each pixel's part of a map, (HEIGHT, WIDTH, 3).

    Before it is tone mapped: so a sun of one pixel is still bright, and little is left to map.
    """
    height, width = radiance.shape[:2]
    step = next(n for n in range(max(height // HEIGHT, 1), 0, -1) if height % n == 0)
    # Whole rows first, as they lie in memory: it takes half the time. The factor stands inside of
    # the sum, and is a hair too small, so that the brightest pixel of float32 does not overflow.
    part = np.float32(0.999999 / step)
    few = np.zeros((height // step, width, 3), np.float32)
    for k in range(step):
        few += radiance[k::step] * part
    planes = [Image.fromarray(np.ascontiguousarray(few[..., k])) for k in range(3)]
    small = [plane.resize((WIDTH, HEIGHT), Image.Resampling.BOX) for plane in planes]
    return np.stack([np.asarray(plane) for plane in small], axis=-1)


def _circle(sun: Sun) -> list[Line]:
    """The circle around a sun as lines, in fine pixels."""
    width, height = WIDTH * FINE, HEIGHT * FINE
    radius = sun.angular_diameter / 2
    if radius * height / np.pi > LEAST_RADIUS * FINE:
        # A corner each 9 degrees of the turn; one that goes around a pole is as long as the map.
        lines = lines_in_image(sphere.circle(sun.to_light, radius, 41 if radius < 0.5 else 181))
        return [(line * (width, height)).ravel().tolist() for line in lines]
    u, v = (float(place) for place in sphere.to_image(sun.to_light))
    rim = LEAST_RADIUS * FINE * RING
    # What leaves at the seam comes back.
    centres = np.array([((u + turn) * width, v * height) for turn in (-1, 0, 1)])
    return [(rim + centre).ravel().tolist() for centre in centres]


def _mask(lines: list[Line], wide: int) -> Image.Image:
    """Lines of so many fine pixels' width, as a mask for the picture."""
    fine = Image.new("L", (WIDTH * FINE, HEIGHT * FINE))
    draw = ImageDraw.Draw(fine)
    for line in lines:
        draw.line(line, 255, wide)
    return fine.resize((WIDTH, HEIGHT), Image.Resampling.BOX)
