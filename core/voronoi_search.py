"""The nearest site of every pixel of a map, tile by tile.

Labels are constant over large parts of a map. So tiles of pixels carry the list of the sites that
may own any of them; a tile with one left is filled, others are cut in four, by rows near the
poles, where they would be much higher than wide. What a site's absence from the list rests on is
a proof, not a guess: see `_within_reach`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .tolerances import TIE

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

SLACK = 4 * TIE
"""A tie for dot products with a direction p: (b - s).p is (|s - p|^2 - |b - p|^2) / 2, and
chords are 2 at most, so a tie is at most 2 TIE; the rest is room for rounding."""

LEAF = 8
"""Tiles of so many pixels squared are looked at pixel by pixel: 4 and 16 cost more."""

COARSE = 8
"""Tiles around the equator that the search starts with."""

AT_ONCE = 256
"""Tiles whose pixels are looked at together: they fit into the processor's cache."""

CANDIDATES = 1 << 16
"""Pairs of a tile and a site that are worked on at once: bounds the memory."""


def owners(sites: Floats, width: int, height: int) -> NDArray[np.int32]:
    """Index of the site nearest to each pixel's centre, (height, width); of equals the lowest.

    sites: unit vectors (n, 3), no two alike.
    """
    size = LEAF
    while size * COARSE < width:
        size *= 2
    down, right = -(-height // size), -(-width // size)
    search = _Search(sites, width, height, np.empty((down * size, right * size), np.int32))
    tiles = np.arange(down * right)
    at_once = max(1, CANDIDATES // len(sites))
    for part in np.split(tiles, range(at_once, len(tiles), at_once)):
        search.settle(search.begin(part // right * size, part % right * size, size), size, size)
    return np.ascontiguousarray(search.labels[:height, :width])


@dataclass(frozen=True, eq=False)
class _Tiles:
    """Tiles of one shape and the sites that may own any of their pixels.

    top, left: first row and column, (t,). count: how many sites, (t,). site: one tile's after the
    other's, rising in each, (sum of count,).
    """

    top: Indices
    left: Indices
    count: Indices
    site: Indices

    @property
    def start(self) -> Indices:
        return np.cumsum(self.count) - self.count

    @property
    def tile(self) -> Indices:
        """The tile that each site in `site` is listed for."""
        return np.repeat(np.arange(len(self.top)), self.count)

    def part(self, begin: int, end: int) -> _Tiles:
        of_site = slice(self.count[:begin].sum(), self.count[:end].sum())
        tiles = slice(begin, end)
        return _Tiles(self.top[tiles], self.left[tiles], self.count[tiles], self.site[of_site])

    def kept(self, listed: NDArray[np.bool_]) -> _Tiles:
        """Without the sites that a mask over `site` leaves out."""
        count = np.add.reduceat(listed, self.start, dtype=np.intp)
        return _Tiles(self.top, self.left, count, self.site[listed])

    def only(self, tiles: NDArray[np.bool_]) -> _Tiles:
        listed = np.repeat(tiles, self.count)
        return _Tiles(self.top[tiles], self.left[tiles], self.count[tiles], self.site[listed])

    def cut(self, high: int, wide: int, down: int, height: int, width: int) -> _Tiles:
        """Fourths of this shape, so many of them one below the other; each inherits the list.

        Those that lie outside of the map are left out.
        """
        step = np.arange(4)
        top = (self.top[:, None] + step % down * high).ravel()
        left = (self.left[:, None] + step // down * wide).ravel()
        inside = (top < height) & (left < width)
        count, start = np.repeat(self.count, 4)[inside], np.repeat(self.start, 4)[inside]
        return _Tiles(top[inside], left[inside], count, self.site[_ranges(start, count)])


class _Search:
    """The sites, where the pixels of one map lie, and the labels that are found for them.

    sites: (n, 3). labels: (h, w), of the map's size or more, so that whole tiles fit in.
    """

    def __init__(self, sites: Floats, width: int, height: int, labels: NDArray[np.int32]) -> None:
        self.sites, self.labels = sites, labels
        self.width, self.height = width, height
        # A direction is (r x, r y, z), with (x, y) its column's on the equator and (r, z) its
        # row's in the plane of the image centre.
        self.column = sphere.to_directions((np.arange(width) + 0.5) / width, 0.5)[:, :2]
        self.row = sphere.to_directions(0.5, (np.arange(height) + 0.5) / height)[:, [0, 2]]

    def begin(self, top: Indices, left: Indices, size: int) -> _Tiles:
        """Square tiles with all sites that may own one of their pixels."""
        centre, radius = self.caps(top, left, size, size)
        dot = centre @ self.sites.T
        best = dot.argmax(axis=1)
        # Sites may be so near to each other that this product says nothing of how near.
        apart = np.sqrt(np.maximum(2 - 2 * (self.sites[best] @ self.sites.T), 0) + SLACK)
        ahead = dot[np.arange(len(top)), best][:, None] - dot
        tile, site = np.nonzero(_within_reach(ahead, apart, radius[:, None]))
        return _Tiles(top, left, np.bincount(tile, minlength=len(top)), site)

    def settle(self, tiles: _Tiles, high: int, wide: int) -> None:
        """Write the owner of each pixel of these tiles, all of one shape."""
        if len(tiles.site) > CANDIDATES and len(tiles.top) > 1:
            half = len(tiles.top) // 2
            self.settle(tiles.part(0, half), high, wide)
            self.settle(tiles.part(half, len(tiles.top)), high, wide)
            return
        done = tiles.only(tiles.count == 1)
        self.write(done.top, done.left, done.site[:, None, None], high, wide)
        left = tiles.only(tiles.count > 1)
        if high * wide > LEAF * LEAF:
            slender = self.slender(left.top, high, wide)
            self.settle_fourths(left.only(slender), high, wide, 4)
            self.settle_fourths(left.only(~slender), high, wide, min(high, 2))
            return
        by_count = np.argsort(-left.count, kind="stable")
        for begin in range(0, len(by_count), AT_ONCE):
            part = by_count[begin : begin + AT_ONCE]
            owner = self.owners(left, part, high, wide)
            self.write(left.top[part], left.left[part], owner, high, wide)

    def settle_fourths(self, tiles: _Tiles, high: int, wide: int, down: int) -> None:
        if len(tiles.top):
            high, wide = high // down, wide * down // 4
            fourths = tiles.cut(high, wide, down, self.height, self.width)
            self.settle(self.narrowed(fourths, high, wide), high, wide)

    def slender(self, top: Indices, high: int, wide: int) -> NDArray[np.bool_]:
        """Whether tiles are more than twice as high as wide on the sphere, (t,)."""
        bottom = np.minimum(top + high, self.height) - 1
        ring = np.maximum(self.row[top, 0], self.row[bottom, 0])
        return (high >= 4) & (high / self.height > 2 * (2 * wide / self.width) * ring)

    def write(self, top: Indices, left: Indices, owner: Indices, high: int, wide: int) -> None:
        rows, columns = self.labels.shape
        tiles = self.labels.reshape(rows // high, high, columns // wide, wide)
        tiles[top // high, :, left // wide] = owner

    def caps(self, top: Indices, left: Indices, high: int, wide: int) -> tuple[Floats, Floats]:
        """Centre (t, 3) and radius (t,), a chord, of a cap around all pixel centres of each tile.

        Up to half a turn wide, a tile is farthest from its middle at its corners.
        """
        bottom, right = np.minimum(top + high, self.height), np.minimum(left + wide, self.width)
        u, v = (left + right) / (2 * self.width), (top + bottom) / (2 * self.height)
        centre = sphere.to_directions(u, v)
        corners = [self.pixels(row, left) for row in (top, bottom - 1)]
        radius = np.max([np.linalg.norm(corner - centre, axis=-1) for corner in corners], axis=0)
        return centre, np.where(2 * (right - left) > self.width, 2.0, radius)

    def pixels(self, row: Indices, column: Indices) -> Floats:
        """Directions of pixels, (..., 3); bit for bit those of `sphere.to_directions`."""
        (ring, z), (x, y) = self.row[row].T, self.column[column].T
        return np.stack([ring * x, ring * y, z], axis=-1)

    def narrowed(self, tiles: _Tiles, high: int, wide: int) -> _Tiles:
        """Without the sites that the one nearest to a tile's centre beats all over the tile."""
        centre, radius = self.caps(tiles.top, tiles.left, high, wide)
        tile, place = tiles.tile, self.sites[tiles.site]
        dot = np.einsum("ij,ij->i", centre[tile], place)
        most = np.maximum.reduceat(dot, tiles.start)[tile]
        leads = np.flatnonzero(dot == most)
        best = np.empty(len(tiles.top), np.intp)
        best[tile[leads]] = leads
        gap = place[best][tile] - place
        apart = np.sqrt(np.einsum("ij,ij->i", gap, gap))
        return tiles.kept(_within_reach(most - dot, apart, radius[tile]))

    def owners(self, tiles: _Tiles, part: Indices, high: int, wide: int) -> Indices:
        """The nearest site of each pixel of some tiles, (p, high, wide).

        part: indices of tiles, (p,), falling in how many sites these have: so those that still
        have one more are the first. Pixels outside of the map repeat its last row and column.
        """
        rows = np.minimum(tiles.top[part, None] + np.arange(high), self.height - 1)
        columns = np.minimum(tiles.left[part, None] + np.arange(wide), self.width - 1)
        ring, z = self.row[rows, 0], self.row[rows, 1]
        x, y = self.column[columns, 0], self.column[columns, 1]
        start, count = tiles.start[part], tiles.count[part]
        owner = np.empty((len(part), high, wide), np.intp)
        best, second = np.full(owner.shape, -np.inf), np.full(owner.shape, -np.inf)
        for turn in range(count[0]):
            k = np.searchsorted(-count, -turn)
            site = tiles.site[start[:k] + turn]
            to_x, to_y, to_z = self.sites[site].T[:, :, None]
            dot = ring[:k, :, None] * (x[:k] * to_x + y[:k] * to_y)[:, None]
            dot += (z[:k] * to_z)[:, :, None]
            np.copyto(owner[:k], site[:, None, None], where=dot > best[:k])
            np.maximum(second[:k], np.minimum(dot, best[:k]), out=second[:k])
            np.maximum(best[:k], dot, out=best[:k])
        t, i, j = np.nonzero(best - second <= SLACK)
        if len(t):
            pixels = self.pixels(rows[t, i], columns[t, j])
            owner[t, i, j] = self.first_of_equals(pixels, tiles.site, start[t], count[t])
        return owner

    def first_of_equals(
        self, pixels: Floats, site: Indices, start: Indices, count: Indices
    ) -> Indices:
        """The nearest of the `count` sites from `start` on for each of pixels (p, 3), by chords."""
        listed = site[_ranges(start, count)]
        begin = np.cumsum(count) - count
        apart = np.linalg.norm(self.sites[listed] - np.repeat(pixels, count, axis=0), axis=1)
        equal = apart <= np.repeat(np.minimum.reduceat(apart, begin) + TIE, count)
        return np.minimum.reduceat(np.where(equal, listed, len(self.sites)), begin)


def _ranges(start: Indices, count: Indices) -> Indices:
    """`count` numbers from `start` on, one range after the other."""
    return np.arange(count.sum()) + np.repeat(start - (np.cumsum(count) - count), count)


def _within_reach(ahead: Floats, apart: Floats, radius: Floats) -> NDArray[np.bool_]:
    """Whether a site s may own a point of a cap, though another one, b, is nearer to its centre c.

    ahead: (b - s).c. apart: |b - s|. For a point p = c + e of the cap, |e| <= radius, b leads by
    (b - s).p >= (b - s).c - |b - s| radius: where that is positive, s owns nothing here.
    """
    return ahead <= apart * radius + SLACK
