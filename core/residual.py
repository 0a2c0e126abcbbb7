"""Region B as a map: what region A would show if its suns were not there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap, check_part
from .lighting_width import lighting_width
from .pixels import HeldPixels, Planes, Strip, planes_of
from .reduction import narrowed
from .region import RegionLight
from .settings import ResidualWidth
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


def residual_of(
    environment: EnvironmentMap, light: RegionLight, width: ResidualWidth, seen: float = 1.0
) -> tuple[NDArray[np.float32], LevelledPixels | None]:
    """The map less some light, (w // 2, w, 3); and with all pixels of a wide map, if these are
    asked for.

    width: None for that of the map that is looked at. seen: part of the map's light that reaches
    what is looked at. Raises UnusableInput where the width is no whole part of the map's own.
    """
    residual = without(environment, light)
    own = environment.own_width
    if width == "lighting":
        width = lighting_width(residual, environment.scalar_irradiance * seen)
    width = {None: environment.width, "own": own}.get(width, width)
    if width == environment.width:
        return residual, None
    check_part(width, own)
    if environment.width % width == 0:
        return narrowed(HeldPixels.of(residual), width), None
    levelled = LevelledPixels(environment, residual)
    return (residual, levelled) if width == own else (narrowed(levelled, width), None)


@dataclass(frozen=True, eq=False)
class LevelledPixels:
    """All pixels of a wide map, less some light.

    residual: what is left of the narrowed map, (h, w, 3). Where light was taken from one of its
    pixels, the highest of those that it stands for are cut off at one level, so that it is their
    mean: the account closes everywhere, and no bright speck is left.
    """

    environment: EnvironmentMap
    residual: NDArray[np.float32]

    @property
    def width(self) -> int:
        return self.environment.own_width

    @property
    def height(self) -> int:
        return self.environment.own_height

    @property
    def least_rows(self) -> int:
        """See `Pixels`."""
        return self.height // len(self.residual)

    @property
    def packed_rows(self) -> int:
        """See `Pixels`."""
        return self.environment.pixels.packed_rows

    def strips(self, rows: int) -> Iterator[Strip]:
        """See `Pixels`."""
        solid = sphere.row_solid_angles(self.width, self.height)
        top, step = 0, self.least_rows
        for strip in self.environment.pixels.strips(rows):
            planes = planes_of(strip)
            for first in range(0, planes.shape[1], step):
                row = slice(first, first + step)
                self._level(planes[:, row], (top + first) // step, solid[top:][row])
            top += planes.shape[1]
            yield tuple(planes)

    def _level(self, planes: Planes, row: int, solid: NDArray[np.float64]) -> None:
        """Cut off the pixels that one row of `residual` stands for, (3, step, width), in place."""
        before, after = self.environment.radiance[row].T, self.residual[row].T
        channel, block = np.nonzero(after < before)
        if not len(block):
            return
        step = len(solid)
        blocks = planes.reshape(3, step, -1, step)
        some = blocks[channel, :, block].reshape(len(block), -1)
        levels = levels_of(some, np.repeat(solid, step), after[channel, block])
        blocks[channel, :, block] = np.minimum(some, levels[:, None]).reshape(-1, step, step)


def levels_of(
    values: NDArray[np.float32], weight: NDArray[np.float64], means: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Where rows of values, (n, k), must be cut off so that their means are `means`, (n,), which
    are at most what they are: (n,).

    weight: of each column, (k,).
    """
    order = np.argsort(values, axis=1)
    rising = np.take_along_axis(values, order, axis=1).astype(np.float64)
    share = (weight / weight.sum())[order]
    # With the level at a value: what lies below it, and the share of it and all above.
    below = np.cumsum(rising * share, axis=1) - rising * share
    others = np.maximum(1 - (np.cumsum(share, axis=1) - share), 1e-300)
    enough = below + others * rising >= means[:, None]
    at = np.where(enough.any(axis=1), enough.argmax(axis=1), rising.shape[1] - 1)[:, None]
    level = means - np.take_along_axis(below, at, axis=1)[:, 0]
    level = np.maximum(level / np.take_along_axis(others, at, axis=1)[:, 0], 0)
    return np.minimum(level, rising[:, -1]).astype(np.float32)
