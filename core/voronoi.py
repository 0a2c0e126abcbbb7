"""Voronoi cells on the sphere: which site each pixel is nearest to, what light its cell holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .tolerances import TIE
from .voronoi_search import owners

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

CROWDED = 64
"""Pixels for each site, on average, below which asking for each pixel is faster than tiles are:
where sites crowd, a tile has more of them than it has pixels."""


@dataclass(frozen=True, eq=False)
class CellSums:
    """What the cells hold. flux: scalar irradiance per channel, (n, 3). area: steradians, (n,)."""

    flux: Floats
    area: Floats

    @property
    def mean_radiance(self) -> Floats:
        """Mean radiance of each cell, (n, 3); 0 in a cell without a pixel."""
        area = self.area[:, None]
        return np.divide(self.flux, area, out=np.zeros_like(self.flux), where=area > 0)


def cell_sums(radiance: NDArray[np.float32], labels: NDArray[np.int32], count: int) -> CellSums:
    """Sums of radiance (H, W, 3) over the cells that labels (H, W) from 0 to count - 1 make.

    Row by row, so that each sum has few terms of one size and loses nothing even at 16k.
    """
    height, width = labels.shape
    flux, area = np.zeros((count, 3)), np.zeros(count)
    for row, solid in enumerate(sphere.row_solid_angles(width, height)):
        area += solid * np.bincount(labels[row], minlength=count)
        for channel in range(3):
            light = np.bincount(labels[row], radiance[row, :, channel], minlength=count)
            flux[:, channel] += solid * light
    return CellSums(flux, area)


def voronoi_map(mean_radiance: Floats, labels: NDArray[np.int32]) -> NDArray[np.float32]:
    """Each pixel its cell's mean radiance, (H, W, 3): M_V of the paper (section 2.3), or M_BV."""
    cells = mean_radiance.astype(np.float32)
    out = np.empty((*labels.shape, 3), np.float32)
    for row, owner in zip(out, labels, strict=True):
        row[:] = cells[owner]
    return out


def nearest(directions: Floats, sites: Floats) -> Indices:
    """Index of the nearest of sites (n, 3) for each of directions (p, 3), unit vectors, (p,).

    Ties go to the lowest index. Raises ValueError where there is no site.
    """
    from scipy.spatial import cKDTree

    distinct, index = _distinct(sites)
    if len(distinct) == 1:
        return np.zeros(len(directions), np.intp)
    tree = cKDTree(distinct)
    distance, found = tree.query(directions, k=2)
    owner = found[:, 0]
    tied = np.flatnonzero(distance[:, 1] <= distance[:, 0] + TIE)
    if len(tied):
        reach = distance[tied, 0] + TIE
        equals = tree.query_ball_point(directions[tied], reach, return_sorted=True)
        owner[tied] = [near[0] for near in equals]
    return index[owner]


def label_map(sites: Floats, width: int, height: int) -> NDArray[np.int32]:
    """Index of the site nearest to each pixel's centre, (height, width).

    sites: unit vectors (n, 3). Ties go to the lowest index, so that of equal sites only the first
    has a cell; two sites in one pixel may leave one of them none. Raises ValueError where there
    is no site.
    """
    distinct, index = _distinct(sites)
    if len(distinct) * CROWDED > width * height:
        pixels = sphere.pixel_centres(np.arange(width * height), width, height)
        return nearest(pixels, sites).astype(np.int32).reshape(height, width)
    labels = owners(distinct, width, height)
    return labels if len(distinct) == len(sites) else index.astype(np.int32)[labels]


def _distinct(sites: Floats) -> tuple[Floats, Indices]:
    """The sites that are unlike all before them, and their indices."""
    if not len(sites):
        raise ValueError("there is no site")
    length = np.linalg.norm(sites, axis=1)
    if not np.all(np.abs(length - 1) < 1e-6):
        raise ValueError("sites must be unit vectors")
    order = np.lexsort(sites.T)
    fresh = (np.diff(sites[order], axis=0) != 0).any(axis=1)
    index = np.sort(order[np.concatenate([[True], fresh])])
    return sites[index] / length[index, None], index
