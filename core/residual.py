"""Region B as a map: the source without what the suns give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

Floats32 = NDArray[np.float32]

MARGIN = 4
"""Pixels around a group that say how bright its surroundings are."""


def surroundings(
    radiance: Floats32, region: NDArray[np.bool_], group: NDArray[np.intp]
) -> Floats32:
    """What the map would show in a group of pixels if region A's light were not there.

    The values just outside region A are carried smoothly into the group, by averaging them down
    a pyramid until no hole is left and interpolating back up (pull and push).

    group: flat indices of the group's pixels, (n,). Returns radiance (n, 3), never above the
    map's own; 0 where the whole map is region A.
    """
    height, width = region.shape
    rows, columns = np.divmod(group, width)
    top, bottom = max(rows.min() - MARGIN, 0), min(rows.max() + MARGIN + 1, height)
    first, count = _column_window(columns, width)
    wrapped = (first + np.arange(count)) % width
    window = np.ix_(np.arange(top, bottom), wrapped)
    known = (~region[window]).astype(np.float64)
    if not known.any():
        return np.zeros((len(group), 3), np.float32)
    filled = _fill(np.where(known[..., None] > 0, radiance[window], 0.0), known)
    inside = filled[rows - top, (columns - first) % width]
    return np.minimum(inside.astype(np.float32), radiance[rows, columns])


def _column_window(columns: NDArray[np.intp], width: int) -> tuple[int, int]:
    """First column and number of columns of the narrowest window around these, over the seam
    where that is narrower, with a margin."""
    used = np.unique(columns)
    gaps = np.diff(used, append=used[0] + width)
    widest = int(np.argmax(gaps))
    first = int(used[(widest + 1) % len(used)]) - MARGIN
    count = width - int(gaps[widest]) + 1 + 2 * MARGIN
    return first, min(count, width)


def _fill(values: NDArray[np.float64], known: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (h, w, 3) where known (h, w) is 0 replaced by what lies around. Known ones stay."""
    if known.all() or min(known.shape) == 1:
        mean = (values * known[..., None]).sum(axis=(0, 1)) / known.sum()
        return np.where(known[..., None] > 0, values, mean)
    height, width = known.shape
    pad = ((0, height % 2), (0, width % 2))
    weights = _pool(np.pad(known, pad))
    sums = _pool(np.pad(values * known[..., None], (*pad, (0, 0))))
    averages = sums / np.maximum(weights, 1e-300)[..., None]
    smaller = _fill(averages, (weights > 0).astype(np.float64))
    scale = 2 if min(smaller.shape[:2]) > 1 else (2, 2, 1)
    larger = zoom(
        smaller, (2, 2, 1) if scale == 2 else scale, order=1, mode="nearest", grid_mode=True
    )
    return np.where(known[..., None] > 0, values, larger[:height, :width])


def _pool(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of 2 x 2 blocks of the first two axes, both of even length."""
    return array[0::2, 0::2] + array[1::2, 0::2] + array[0::2, 1::2] + array[1::2, 1::2]
