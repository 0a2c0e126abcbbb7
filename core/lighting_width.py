"""How wide a map must be that only lights: what a narrower one would get wrong of shadows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from . import sphere

Floats = NDArray[np.float64]

NARROWEST = 256
"""Pixels of the narrowest map: rough surfaces show light in lobes no narrower than 7 degrees, which
pixels of 1.4 widen by a fiftieth (see `addon.shaders.SHARP`)."""

ALLOWED = 1e-3
"""Part of the mean irradiance that surfaces under shadows may get wrong: a tenth of what lights
may."""

ROWS = 64
"""Looked at at a time: what they take is used again for the next."""


def lighting_width(radiance: NDArray[np.float32], light: Floats) -> int:
    """The least width, halved and halved again, whose light shadows can hardly tell from all of it.

    radiance: (height, width, 3). light: scalar irradiance of the whole map that it is the rest of,
    (3,): what is wrong is held against that, all channels added up.
    """
    height, width = radiance.shape[:2]
    if not _may_be_halved(width, height):
        return width
    part = np.divide(1, light, out=np.zeros(3), where=light > 0)
    weight = sphere.row_solid_angles(width, height)[:, None]
    strips = (
        radiance[top : top + ROWS] @ part * weight[top : top + ROWS]
        for top in range(0, height, ROWS)
    )
    wrong = 0.0
    while True:
        flux, squares = _halved(strips, width, height)
        # A great circle crosses a cap of half-angle a with a probability of sin a. Where it parts
        # a block, half the difference of its halves is missing at most, a third of that squared on
        # average; and of all squared, a sixth is left by the cosines of surfaces.
        wrong += np.pi / (width / 2) * squares / (4 * 3 * 6)
        if np.sqrt(wrong) > ALLOWED / 4:
            return width
        width, height, strips = width // 2, height // 2, iter([flux])
        if not _may_be_halved(width, height):
            return width


def _halved(strips: Iterator[Floats], width: int, height: int) -> tuple[Floats, float]:
    """Sums over blocks of two by two, (height / 2, width / 2), and the sum of all squares of what
    their halves differ by. strips: an even number of rows each."""
    out = np.empty((height // 2, width // 2))
    squares, top = 0.0, 0
    for flux in strips:
        beside, below = flux[:, ::2] + flux[:, 1::2], flux[::2] + flux[1::2]
        across, down = below[:, ::2] - below[:, 1::2], beside[::2] - beside[1::2]
        squares += float(np.vdot(across, across) + np.vdot(down, down))
        rows = out[top : top + len(below)]
        np.add(below[:, ::2], below[:, 1::2], out=rows)
        top += len(rows)
    return out, squares


def _may_be_halved(width: int, height: int) -> bool:
    return width >= 2 * NARROWEST and width % 4 == 0 and height % 2 == 0
