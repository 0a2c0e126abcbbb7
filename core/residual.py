"""Region B as a map: what region A would show if its suns were not there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap
from .region import RegionLight
from .tolerances import ROUNDED


def without(environment: EnvironmentMap, light: RegionLight) -> NDArray[np.float32]:
    """The map less some light, float32 (height, width, 3)."""
    solid = sphere.row_solid_angles(environment.width, environment.height)
    residual = environment.radiance.copy()
    flat = residual.reshape(-1, 3)
    before = flat[light.pixels].astype(np.float64)
    rest = before - light.flux / solid[light.pixels // environment.width, None]
    # What the division has rounded is no light: black must be black.
    flat[light.pixels] = np.where(rest > ROUNDED * before, rest, 0)
    return residual


def narrowed_without(
    environment: EnvironmentMap, light: RegionLight, width: int | None
) -> NDArray[np.float32]:
    """The same, of another width, without a look at the pixels that keep their light.

    width: None for the map's own. Raises UnusableInput where it is no whole part of that.
    """
    if width is None or width == environment.width:
        return without(environment, light)
    before = environment.narrowed(width).reshape(-1, 3)
    step = environment.width // width
    rows, columns = np.divmod(light.pixels, environment.width)
    block = rows // step * width + columns // step
    taken = np.stack([np.bincount(block, flux, len(before)) for flux in light.flux.T], axis=-1)
    rest = before - taken / np.repeat(sphere.row_solid_angles(width, width // 2), width)[:, None]
    # As above; a block is a sum of many pixels.
    rest = np.where(rest > step * ROUNDED * before, rest, 0)
    return rest.astype(np.float32).reshape(width // 2, width, 3)
