"""What a map would show inside a region without the region's own light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere

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
    owner = labels.ravel()[pixels] - 1
    size = np.bincount(owner, minlength=count)
    result = np.zeros((len(pixels), 3))
    for group in np.flatnonzero(size > LARGE):
        mine = owner == group
        near = sphere.neighbours(pixels[mine], width, height)
        rim = near[~region.ravel()[near]]
        if len(rim):
            result[mine] = flat[rim].mean(axis=0, dtype=np.float64)
    small = np.flatnonzero((size <= LARGE)[owner])
    near = sphere.neighbours(pixels[small], width, height)
    outside = ~region.ravel()[near]
    rimmed = np.bincount(owner[small], outside.any(axis=1), count) > 0
    smooth = rimmed[owner[small]]
    if smooth.any():
        # All groups at once: what does not touch does not matter to each other.
        some = pixels[small[smooth]]
        result[small[smooth]] = _harmonic(flat, some, near[smooth], outside[smooth])
    return np.minimum(result.astype(np.float32), flat[pixels])


def _harmonic(
    flat: NDArray[np.float32],
    pixels: NDArray[np.intp],
    near: NDArray[np.intp],
    outside: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Each of the pixels, rising, the mean of its four neighbours; those outside are given."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    count = len(pixels)
    own = np.arange(count)[:, None]
    # The matrix is symmetric: what each row holds is what the column of that number holds.
    beside = np.where(outside, count, np.searchsorted(pixels, near))
    places = np.sort(np.concatenate([own, beside], axis=1), axis=1).astype(np.int32)
    held = places < count
    ends = np.concatenate([[0], np.cumsum(held.sum(axis=1))]).astype(np.int32)
    values = np.where(places == own, 4.0, -1.0)[held]
    matrix = csc_array((values, places[held], ends), shape=(count, count))
    given = np.where(outside[..., None], flat[near], 0).sum(axis=1, dtype=np.float64)
    # And it needs no pivots: so ordered, it takes less. Its columns have little in common: one at a
    # time takes half of what panels of many take.
    order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}, "panel_size": 1}
    return np.maximum(splu(matrix, diag_pivot_thresh=0.0, **order).solve(given), 0)
