"""A map's radiance in directions, as renderers look it up, and maps of other layouts and sizes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..environment import scalar_irradiance

Floats = NDArray[np.float64]


def look_up(radiance: NDArray[np.floating], directions: Floats, has_cells: bool) -> Floats:
    """Radiance, (n, 3), in directions (n, 3) of any length: that of the pixel where a map has
    cells, else blended between the centres of four, over the seam and the poles too."""
    height, width = radiance.shape[:2]
    u, v = sphere.to_image(directions)
    flat = radiance.reshape(-1, 3)
    if has_cells:
        column = np.floor(u * width).astype(np.intp) % width
        return flat[np.minimum((v * height).astype(np.intp), height - 1) * width + column]
    x, y = u * width - 0.5, v * height - 0.5
    left, above = np.floor(x), np.floor(y)
    right_part, below_part = (x - left)[:, None], (y - above)[:, None]
    column, row = left.astype(np.intp), above.astype(np.intp)
    upper, lower = (
        flat[_index(row + k, column, width, height)] * (1 - right_part)
        + flat[_index(row + k, column + 1, width, height)] * right_part
        for k in (0, 1)
    )
    return upper * (1 - below_part) + lower * below_part


def _index(
    row: NDArray[np.intp], column: NDArray[np.intp], width: int, height: int
) -> NDArray[np.intp]:
    """Over a pole lies the row itself, half a turn away."""
    over = (row < 0) | (row >= height)
    return np.clip(row, 0, height - 1) * width + (column + over * (width // 2)) % width


def widened(radiance: NDArray[np.float32], least: int, has_cells: bool) -> NDArray[np.float32]:
    """A map at least so wide, with the light of each channel as it was."""
    if radiance.shape[1] >= least:
        return radiance
    v, u = (np.arange(least // 2) + 0.5) / (least // 2), (np.arange(least) + 0.5) / least
    directions = sphere.to_directions(u[None, :], v[:, None]).reshape(-1, 3)
    wide = look_up(radiance, directions, has_cells).reshape(least // 2, least, 3)
    return (wide * kept(scalar_irradiance(wide), scalar_irradiance(radiance))).astype(np.float32)


def narrower(radiance: NDArray[np.floating], width: int) -> Floats:
    """A map at most so wide, whatever its own width is: each pixel the mean of what lies in it."""
    if radiance.shape[1] <= width:
        return radiance.astype(np.float64)
    solid = sphere.row_solid_angles(radiance.shape[1], radiance.shape[0])
    light = _sums(_sums(radiance * solid[:, None, None], width // 2, 0), width, 1)
    return light / sphere.row_solid_angles(width, width // 2)[:, None, None]


def _sums(values: Floats, count: int, axis: int) -> Floats:
    """Over so many equal parts of an axis; a pixel on the edge of two is shared out."""
    length = values.shape[axis]
    up_to = np.concatenate([np.zeros_like(values.take([0], axis)), values.cumsum(axis)], axis)
    edges = np.arange(count + 1) * (length / count)
    whole = np.minimum(np.floor(edges), length - 1).astype(np.intp)
    shape = [-1 if k == axis else 1 for k in range(values.ndim)]
    part = (edges - whole).reshape(shape)
    at_edges = up_to.take(whole, axis) * (1 - part) + up_to.take(whole + 1, axis) * part
    return np.diff(at_edges, axis=axis)


def kept(found: Floats, wanted: Floats) -> Floats:
    """Factors, (3,), that make of one sum of light another; 1 where there is none."""
    return np.divide(wanted, found, out=np.ones(3), where=found > 0)
