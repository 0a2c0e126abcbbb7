"""The equirectangular layout: the only place that knows how pixels lie on the sphere.

Convention (Cycles): right-handed, Z up, the image centre looks along +X, u = 0.25 along +Y.
    azimuth   = pi - 2 pi u,   u = (column + 0.5) / width
    elevation = pi/2 - pi v,   v = (row + 0.5) / height   (rows run downwards)
The columns wrap at the seam (u = 0 and 1 look along -X); every pixel of the first and of the last
row touches a pole.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def row_solid_angles(width: int, height: int) -> Floats:
    """Exact solid angle of one pixel of each row, steradians, shape (height,).

    A difference of cosines, written as a product so that the rows at the poles lose no digits.
    """
    polar = (np.arange(height) + 0.5) * (np.pi / height)
    return (2 * np.pi / width) * 2 * np.sin(polar) * np.sin(np.pi / (2 * height))


def to_directions(u: ArrayLike, v: ArrayLike) -> Floats:
    """Unit vectors of image positions u, v in [0, 1] (v downwards), shape (..., 3)."""
    azimuth = np.pi - 2 * np.pi * np.asarray(u, dtype=np.float64)
    polar = np.pi * np.asarray(v, dtype=np.float64)
    ring = np.sin(polar)
    x, y, z = np.broadcast_arrays(ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar))
    return np.stack([x, y, z], axis=-1)


def to_image(directions: ArrayLike) -> tuple[Floats, Floats]:
    """Image positions (u, v) in [0, 1] of vectors (..., 3) of any length, as float64."""
    x, y, z = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
    u = 0.5 - np.arctan2(y, x) / (2 * np.pi)
    v = np.arctan2(np.hypot(x, y), z) / np.pi
    return u, v


def pixel_centres(indices: NDArray[np.intp], width: int, height: int) -> Floats:
    """Unit vectors to the centres of the pixels with these flat indices, shape (n, 3)."""
    rows, columns = np.divmod(indices, width)
    return to_directions((columns + 0.5) / width, (rows + 0.5) / height)


def pixels_at(directions: ArrayLike, width: int, height: int) -> NDArray[np.intp]:
    """Flat indices of the pixels that these unit vectors (n, 3) point into, (n,)."""
    u, v = to_image(directions)
    column = np.floor(u * width).astype(np.intp) % width
    return np.minimum((v * height).astype(np.intp), height - 1) * width + column


def pixel_narrowing(directions: ArrayLike) -> Floats:
    """How wide a pixel is there against its height, 1 on the horizon, 0 at a pole.

    directions: unit vectors (..., 3). Returns (...).
    """
    return np.hypot(*np.moveaxis(np.asarray(directions, np.float64)[..., :2], -1, 0))


def centroid_angles(width: int, height: int) -> tuple[Floats, Floats]:
    """Azimuth of each column, (width,), and polar angle of each row's centroid, (height,)."""
    rows = np.arange(height)
    azimuth = np.pi - 2 * np.pi * (np.arange(width) + 0.5) / width
    return azimuth, np.pi * (rows + 0.5) / height + _centroid_shift(rows, height)


def pixel_directions(indices: NDArray[np.intp], width: int, height: int) -> Floats:
    """Unit vectors to the centroids of the pixels with these flat indices, shape (n, 3).

    The centroid lies where the solid angle does, nearer to the equator than the centre: by a
    sixth of a pixel in the row at a pole, by nothing worth mentioning elsewhere.
    """
    rows, columns = np.divmod(indices, width)
    if len(rows) <= width + height:
        v = (rows + 0.5) / height + _centroid_shift(rows, height) / np.pi
        return to_directions((columns + 0.5) / width, v)
    # All of a row and all of a column share their sines and cosines.
    azimuth, polar = centroid_angles(width, height)
    ring = np.sin(polar)[rows]
    out = np.empty((len(rows), 3))
    np.multiply(ring, np.cos(azimuth)[columns], out=out[:, 0])
    np.multiply(ring, np.sin(azimuth)[columns], out=out[:, 1])
    out[:, 2] = np.cos(polar)[rows]
    return out


def _centroid_shift(rows: NDArray[np.intp], height: int) -> Floats:
    """From the centre of a row to the mean polar angle of its solid angle, radians.

    For a density sin t over an interval of length h around m it is h^2 / 12 cot m to second
    order, and exact in the row at the pole, where the density is linear.
    """
    step = np.pi / height
    polar = (rows + 0.5) * step
    return step**2 / 12 * np.cos(polar) / np.sin(polar)


def pixel_spread(indices: NDArray[np.intp], width: int, height: int) -> Floats:
    """How much each pixel's own extent shortens a sum of directions: 1 - |mean direction|.

    A patch has the second moment w^2 / 12 + h^2 / 12 about its centre, less the square of its
    centroid's shift about its centroid, and 1 - R is half of it. Without this a light of one
    pixel would have no size. Shape (n,).
    """
    rows = np.arange(height)
    high = np.pi / height
    shift = _centroid_shift(rows, height)
    wide = np.minimum((2 * np.pi / width) * np.sin((rows + 0.5) * high + shift), np.pi)
    return ((wide**2 + high**2) / 24 - shift**2 / 2)[np.asarray(indices) // width]


def neighbours(
    indices: NDArray[np.intp], width: int, height: int, corners: bool = False
) -> NDArray[np.intp]:
    """Flat indices of the 4 pixels beside each pixel, or 8 with corners, over seam and poles.

    indices: (n,). Returns (n, 4) or (n, 8). Over a pole lies the pixel half a turn away.
    """
    steps = [(0, -1), (0, 1), (-1, 0), (1, 0)]
    if corners:
        steps += [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    found = np.add.outer(indices, [down * width + right for down, right in steps])
    columns = indices % width
    ends = (columns == 0) | (columns == width - 1)
    ends |= (indices < width) | (indices >= (height - 1) * width)
    at = np.flatnonzero(ends)
    rows, columns = np.divmod(indices[at], width)
    for number, (down, right) in enumerate(steps):
        row = rows + down
        over = (row < 0) | (row >= height)
        column = (columns + right + np.where(over, width // 2, 0)) % width
        found[at, number] = np.clip(row, 0, height - 1) * width + column
    return found


def grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Larger by one pixel on all sides, corners included, over seam and poles: (height, width)."""
    wide = mask | np.roll(mask, 1, axis=1) | np.roll(mask, -1, axis=1)
    tall = wide.copy()
    tall[1:] |= wide[:-1]
    tall[:-1] |= wide[1:]
    for row in (0, -1):
        tall[row] |= np.roll(wide[row], mask.shape[1] // 2)
    return tall


def grow_groups(labels: NDArray[np.int32], brightness: Floats) -> NDArray[np.int32]:
    """Groups larger by one pixel on all sides; where two claim it, the brighter neighbour's wins.

    labels: (height, width), 0 outside of groups. brightness: of every pixel, (height, width).
    """
    height, width = labels.shape
    grown = labels.copy()
    inside = np.flatnonzero(labels)
    around = neighbours(inside, width, height, corners=True)
    claimed = around.ravel()
    owner = np.repeat(labels.ravel()[inside], 8)
    light = np.repeat(brightness.ravel()[inside], 8)
    free = labels.ravel()[claimed] == 0
    # Written in rising order of brightness, so the brightest claim stays.
    order = np.argsort(light[free], kind="stable")
    grown.ravel()[claimed[free][order]] = owner[free][order]
    return grown


def angle_between(a: ArrayLike, b: ArrayLike) -> Floats:
    """Angle in radians between unit vectors, accurate at 0 and at pi (no arccos)."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def circle(to_centre: Floats, angular_radius: float, count: int = 361) -> Floats:
    """Directions along a circle on the sphere around `to_centre`, closed, shape (count, 3)."""
    first, second = tangents(to_centre)
    turn = np.linspace(0, 2 * np.pi, count)[:, None]
    rim = np.cos(turn) * first + np.sin(turn) * second
    return np.cos(angular_radius) * to_centre + np.sin(angular_radius) * rim


def spirals(centres: Floats, caps: Floats, counts: NDArray[np.intp]) -> Floats:
    """Points spread evenly over caps, each of the same part of its cap: first those of the first
    cap, (counts.sum(), 3).

    centres: unit vectors, (n, 3). caps: 1 - cos of the half-angle of each, (n,). counts: so many
    points each, one at least, (n,).
    """
    cap = np.repeat(np.arange(len(caps)), counts)
    number = np.arange(len(cap)) - (np.cumsum(counts) - counts)[cap]
    along = 1 - caps[cap] * ((number + 0.5) / counts[cap])
    aside = np.sqrt(np.maximum(1 - along**2, 0))
    turns = _golden_turns(int(counts.max()))
    first, second = tangents(centres)
    points = along[:, None] * centres[cap]
    points += (aside * turns[0].take(number))[:, None] * first[cap]
    points += (aside * turns[1].take(number))[:, None] * second[cap]
    return points


@lru_cache(maxsize=8)
def _golden_turns(count: int) -> Floats:
    """Cosines and sines of 0, 1, ... times the golden angle, (2, count)."""
    turn = np.arange(count) * (np.pi * (3 - np.sqrt(5)))
    return np.stack([np.cos(turn), np.sin(turn)])


def tangents(directions: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that stand upright on each direction and on each other, (..., 3)."""
    helper = np.zeros_like(directions)
    least = np.argmin(np.abs(directions), axis=-1)[..., None]
    np.put_along_axis(helper, least, 1.0, axis=-1)
    first = _cross(directions, helper)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, _cross(directions, first)


def _cross(a: Floats, b: Floats) -> Floats:
    """What np.cross says of vectors (..., 3), without the time that it takes to look at axes."""
    out = np.empty_like(a)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return out


def connected_groups(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int32], int]:
    """Groups of pixels that touch on the sphere, corners included: (labels from 1, how many).

    The plane's groups come from scikit-image; here they are joined across the seam and over the
    poles. Labels follow the first pixel of each group in reading order.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from skimage.measure import label

    labels, count = label(mask, return_num=True, connectivity=2)
    pairs = [_pole_pairs(labels[0]), _pole_pairs(labels[-1]), _seam_pairs(labels)]
    first, second = np.concatenate(pairs).T
    graph = coo_array((np.ones(len(first), bool), (first, second)), shape=(count + 1, count + 1))
    joined, component = connected_components(graph, directed=False)
    # Component 0 is the background's, because label 0 is in no pair.
    return component[labels].astype(np.int32), joined - 1


def touching(indices: NDArray[np.intp], width: int, height: int) -> NDArray[np.intp]:
    """The group, from 0, of each of a few pixels of a large map, (n,): those that share a side,
    over the seam and the poles too, are of one group. indices: flat, each once."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    order = np.argsort(indices)
    around = neighbours(indices, width, height)
    found = np.searchsorted(indices, around, sorter=order)
    there = order[np.minimum(found, len(indices) - 1)]
    first, second = np.nonzero(indices[there] == around)
    pairs = first, there[first, second]
    graph = coo_array((np.ones(len(first), bool), pairs), shape=(len(indices), len(indices)))
    return connected_components(graph, directed=False)[1].astype(np.intp)


def group_pixels(labels: NDArray[np.int32], count: int) -> list[NDArray[np.intp]]:
    """Flat indices, rising, of the pixels of each label from 1 to count."""
    if not count:
        return []
    pixels = np.flatnonzero(labels)
    owner = labels.ravel()[pixels]
    ends = np.cumsum(np.bincount(owner, minlength=count + 1)[1:])
    return np.split(pixels[np.argsort(owner, kind="stable")], ends[:-1])


def _pole_pairs(row: NDArray[np.integer]) -> NDArray[np.integer]:
    lit = row[row > 0]
    return np.stack([lit[:-1], lit[1:]], axis=-1) if len(lit) else np.empty((0, 2), row.dtype)


def _seam_pairs(labels: NDArray[np.integer]) -> NDArray[np.integer]:
    left, right = labels[:, 0], labels[:, -1]
    pairs = np.concatenate(
        [
            np.stack([left, right], axis=-1),
            np.stack([left[:-1], right[1:]], axis=-1),
            np.stack([left[1:], right[:-1]], axis=-1),
        ]
    )
    return pairs[(pairs > 0).all(axis=-1)]
