"""Region B as a map: what region A would show if its suns were not there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap
from .errors import UnusableInput
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


def reduced(residual: NDArray[np.float32], width: int | None) -> NDArray[np.float32]:
    """A residual map of another width, each pixel the mean of those it replaces.

    Means are weighted by solid angle, so that every pixel keeps the light of its part of the
    sphere and the account closes. width: None for the map's own. Raises UnusableInput where the
    width is no whole part of the map's.
    """
    height, own = residual.shape[:2]
    if width is None or width == own:
        return residual
    if width > own or own % width or width % 2:
        raise UnusableInput(
            f"A residual {width} pixels wide cannot be made of a map {own} wide: "
            "the width must be even and a whole part of the map's."
        )
    step = own // width
    weight = sphere.row_solid_angles(own, height).reshape(width // 2, step, 1, 1, 1)
    blocks = residual.reshape(width // 2, step, width, step, 3)
    light = (blocks * weight).sum(axis=(1, 3), dtype=np.float64)
    return (light / (step * weight.sum(axis=1)[:, 0])).astype(np.float32)
