"""Region B as a map: what region A would show if its suns were not there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .cells import Cell
from .environment import EnvironmentMap
from .errors import UnusableInput

LARGE = 40_000
"""Pixels above which a group gets the mean of its rim instead of a smooth fill: a region that
large has no one surroundings, and solving for it would take seconds."""


def surroundings(radiance: NDArray[np.float32], region: NDArray[np.bool_]) -> NDArray[np.float32]:
    """What the map would show inside a region without the region's own light.

    The values around the region are carried into it by Laplace's equation, the smoothest surface
    over a given rim; it has no bump or hole of its own and no favourite direction.
    region: mask (height, width). Returns radiance (n, 3) of the region's pixels in reading order,
    never above the map's own; 0 where the whole map is region.
    """
    height, width = region.shape
    flat = radiance.reshape(-1, 3)
    labels, count = sphere.connected_groups(region)
    pixels = np.flatnonzero(region)
    result = np.zeros((len(pixels), 3), np.float32)
    for group in sphere.group_pixels(labels, count):
        near = sphere.neighbours(group, width, height)
        outside = ~region.ravel()[near]
        if not outside.any():
            continue
        rim = flat[near[outside]].mean(axis=0, dtype=np.float64)
        smooth = rim if len(group) > LARGE else _harmonic(flat, group, near, outside)
        inside = np.searchsorted(pixels, group)
        result[inside] = np.minimum(smooth.astype(np.float32), flat[group])
    return result


def _harmonic(
    flat: NDArray[np.float32],
    group: NDArray[np.intp],
    near: NDArray[np.intp],
    outside: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Each pixel of the group the mean of its four neighbours; those outside are given."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    count = len(group)
    own = np.arange(count)
    row, side = np.nonzero(~outside)
    column = np.searchsorted(group, near[row, side])
    values = np.concatenate([np.full(count, 4.0), np.full(len(row), -1.0)])
    places = np.concatenate([own, row]), np.concatenate([own, column])
    matrix = csc_array((values, places), shape=(count, count))
    given = np.where(outside[..., None], flat[near], 0).sum(axis=1, dtype=np.float64)
    return np.maximum(splu(matrix).solve(given), 0)


def without(environment: EnvironmentMap, cells: list[Cell]) -> NDArray[np.float32]:
    """The map less the light of these cells, float32 (height, width, 3)."""
    solid = sphere.row_solid_angles(environment.width, environment.height)
    residual = environment.radiance.copy()
    flat = residual.reshape(-1, 3)
    for cell in cells:
        rows = cell.pixels // environment.width
        flat[cell.pixels] = flat[cell.pixels] - cell.flux / solid[rows, None]
    np.maximum(flat, 0, out=flat)
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
