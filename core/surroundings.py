"""What a map would show inside a region without the region's own light."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .cores import usable

LARGE = 40_000
"""Pixels above which a group gets the mean of its rim instead of a smooth fill: a region that
large has no one surroundings, and solving for it would take seconds."""

PARTS, A_PART = 8, 4000
"""Groups are solved for in so many parts at most, of so many pixels on average at least, by all
cores. Even one core is done sooner than with all of them at once, by a tenth."""


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
    smooth = np.flatnonzero(rimmed[owner[small]])
    # What does not touch does not matter to each other.
    groups = owner[small[smooth]]
    part = _parts(np.bincount(groups, minlength=count))[groups]
    numbers = np.empty(height * width, np.int32)

    def fill(number: int) -> None:
        some = smooth[part == number]
        mine = pixels[small[some]]
        numbers[mine] = np.arange(len(mine))
        result[small[some]] = _harmonic(flat, near[some], outside[some], numbers)

    with ThreadPoolExecutor(usable()) as pool:
        list(pool.map(fill, range(part.max(initial=-1) + 1)))
    return np.minimum(result.astype(np.float32), flat[pixels])


def _parts(size: NDArray[np.intp]) -> NDArray[np.intp]:
    """To which part each group of so many pixels belongs, (n,), the largest to the first: as even
    as whole groups allow, and the same however many cores there are, as digits hang on it."""
    part, order = np.zeros(len(size), np.intp), np.argsort(-size, kind="stable")
    order = order[: np.count_nonzero(size)]
    ends = np.cumsum(size[order])
    parts = np.clip(size.sum() // A_PART, 1, PARTS)
    middle = (2 * ends - size[order]) * parts // (2 * max(size.sum(), 1))
    part[order] = np.unique(middle, return_inverse=True)[1]
    return part


def _harmonic(
    flat: NDArray[np.float32],
    near: NDArray[np.intp],
    outside: NDArray[np.bool_],
    numbers: NDArray[np.int32],
) -> NDArray[np.float64]:
    """Each of n pixels, rising, the mean of its four neighbours; those outside are given.

    numbers: of each pixel of the map among the n, where it is one of them.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    count = len(near)
    # The matrix is symmetric: what each row holds is what the column of that number holds. So
    # ordered, it is rising in nearly all of them.
    left, right, above, below = range(4)
    order = [above, left, right, below]
    held = np.insert(~outside[:, order], 2, True, axis=1)
    places = np.insert(numbers[near[:, order]], 2, np.arange(count), axis=1)[held]
    values = np.broadcast_to([-1.0, -1.0, 4.0, -1.0, -1.0], held.shape)[held]
    ends = np.concatenate([[0], np.cumsum(held.sum(axis=1))]).astype(np.int32)
    matrix = csc_array((values, places, ends), shape=(count, count))
    rows, rim = np.nonzero(outside)[0], flat[near[outside]]
    given = np.stack([np.bincount(rows, channel, count) for channel in rim.T], axis=-1)
    # And it needs no pivots: so ordered, it takes less. Its columns have little in common: one at a
    # time takes half of what panels of many take.
    ways = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}, "panel_size": 1}
    return np.maximum(splu(matrix, diag_pivot_thresh=0.0, **ways).solve(given), 0)
