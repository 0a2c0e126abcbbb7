"""How wide a map must be that only lights: what a narrower one would get wrong of shadows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere

NARROWEST = 256
"""Pixels of the narrowest map: rough surfaces show light in lobes no narrower than 7 degrees, which
pixels of 1.4 widen by a fiftieth (see `addon.shaders.SHARP`)."""

ALLOWED = 1e-3
"""Part of the mean irradiance that surfaces under shadows may get wrong: a tenth of what lights
may."""


def lighting_width(radiance: NDArray[np.float32], light: NDArray[np.float64]) -> int:
    """The least width, halved and halved again, whose light shadows can hardly tell from all of it.

    radiance: (height, width, 3). light: scalar irradiance of the whole map that it is the rest of,
    (3,): what is wrong is held against that, all channels added up.
    """
    height, width = radiance.shape[:2]
    if not _may_be_halved(width, height):
        return width
    part = np.divide(1, light, out=np.zeros(3), where=light > 0)
    flux = radiance @ part * sphere.row_solid_angles(width, height)[:, None]
    wrong = 0.0
    while _may_be_halved(width, height):
        beside, below = flux[:, ::2] + flux[:, 1::2], flux[::2] + flux[1::2]
        across, down = below[:, ::2] - below[:, 1::2], beside[::2] - beside[1::2]
        squares = np.vdot(across, across) + np.vdot(down, down)
        # A great circle crosses a cap of half-angle a with a probability of sin a. Where it parts
        # a block, half the difference of its halves is missing at most, a third of that squared on
        # average; and of all squared, a sixth is left by the cosines of surfaces.
        wrong += np.pi / (width / 2) * squares / (4 * 3 * 6)
        if np.sqrt(wrong) > ALLOWED / 4:
            break
        width, height, flux = width // 2, height // 2, below[:, ::2] + below[:, 1::2]
    return width


def _may_be_halved(width: int, height: int) -> bool:
    return width >= 2 * NARROWEST and width % 4 == 0 and height % 2 == 0
