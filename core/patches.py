"""Light as patches: pixels where it is bright, blocks of pixels where it is faint.

What is decided about a light (where to cut it, how wrong a shadow is) depends on where much of it
is. A few thousand patches hold that as well as millions of pixels do, and sums over them are sums
over the pixels: each keeps its light, its mean direction and how far it spreads.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .cells import HALVES, squares_at, squares_of_pixels
from .memo import Memo
from .region import RegionLight

Floats = NDArray[np.float64]

MOST_PATCHES = 16_384
"""Of one light, about. In the benchmark `lights`, half as many gave errors 0 to 2 % larger with 64
and 256 suns, twice as many 1 to 3 % smaller ones in half as much time again."""

LARGEST_BLOCK = 16
"""Pixels along the side of the largest block, a power of two: 6 degrees of a map 1024 wide."""

IN_FOUR = 0.01
"""Part of a light above which a pixel counts as four patches: a square sun's corners are the last
thing that one disc gets wrong. Half a pixel is as narrow as a disc may be."""

_SUMS = 7
"""What is summed over blocks: flux (3), luminous flux, luminous flux times direction (3)."""


@dataclass(frozen=True, eq=False)
class Patches(Memo):
    """Pieces of light.

    directions: unit vectors to where each has its mean, (n, 3). flux: scalar irradiance, (n, 3).
    spread: how much its extent shortens a sum of directions, 1 - |mean direction|, (n,).
    brightness: the largest among its pixels, in what `patches_of` was given, (n,). squares: where
    each lies on the map, (n, 3); see `cells.Taken`.
    """

    directions: Floats
    flux: Floats
    spread: Floats
    brightness: Floats
    squares: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.flux)


def patches_of(
    light: RegionLight, brightness: Floats, most: int = MOST_PATCHES, key: Hashable = None
) -> Patches:
    """Patches of a light: about `most` of them, or its pixels where they are fewer; more where its
    largest blocks alone are more than half as many.

    brightness: of each pixel of the light, (p,), at least 0. key: tells it from others of the same
    light, which is then not summed again for another number of patches. Only pixels that shine
    count. Blocks with much light of any colour, squared and times their width, are divided first:
    by so much a shadow's edge across them could be wrong.
    """
    lit = light.luminous_flux > 0
    if not lit.all():
        light, brightness = light.part(lit), brightness[lit]
    if len(light.pixels) <= most:
        return _pixels(light, brightness)
    if key is None:
        pyramid = _pyramid(light, brightness)
    else:
        pyramid = light.latest("pyramid", key, lambda: _pyramid(light, brightness))
    sums, peaks, badness = pyramid.sums, pyramid.peaks, pyramid.badness
    limit = pyramid.limit(most)
    found = []
    whole = np.ones(sums[-1].shape[:2], bool)
    for k in range(len(sums), 0, -1):
        divided = whole & (badness[k - 1] > limit)
        kept = whole & ~divided & (sums[k - 1][..., 3] > 0)
        found.append(_blocks(sums[k - 1][kept], peaks[k - 1][kept], np.nonzero(kept), k, light))
        whole = divided.repeat(2, axis=0).repeat(2, axis=1)
    rows, columns = np.divmod(light.pixels, light.width)
    single = whole[rows, columns]
    found.append(_pixels(light.part(single), brightness[single]))
    return _joined(found)


def _joined(parts: list[Patches]) -> Patches:
    names = ("directions", "flux", "spread", "brightness", "squares")
    return Patches(*(np.concatenate([getattr(one, name) for one in parts]) for name in names))


def _pixels(light: RegionLight, brightness: Floats) -> Patches:
    """Each pixel as a patch, or as four if it holds much of the light and nothing tells where."""
    if light.given is not None:
        return _single(light, brightness)
    size = light.width, light.height
    four = light.luminous_flux > IN_FOUR * light.luminous_flux.sum()
    single, several = light.part(~four), light.part(four)
    found = [_single(single, brightness[~four])]
    finer = 2 * light.width, 2 * light.height
    rows, columns = np.divmod(several.pixels, light.width)
    solid, fine = sphere.row_solid_angles(*size)[rows], sphere.row_solid_angles(*finer)
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        row = 2 * rows + down
        pixels = row * finer[0] + 2 * columns + right
        found.append(
            Patches(
                sphere.pixel_directions(pixels, *finer),
                several.flux * (fine[row] / solid)[:, None],
                sphere.pixel_spread(pixels, *finer),
                brightness[four],
                squares_at(row, 2 * columns + right, HALVES // 2),
            )
        )
    return _joined(found)


def _single(light: RegionLight, brightness: Floats) -> Patches:
    """Each pixel as a patch."""
    squares = squares_of_pixels(light.pixels, light.width)
    return Patches(light.directions(), light.flux, light.spread(), brightness, squares)


def _squared(sums: Floats) -> Floats:
    """Light of blocks, (rows, columns, 7), squared: red, blue and luminance, each against all of
    its kind. By luminance alone a blue sky around a warm sun gets blocks that are too large."""
    kinds = sums[..., [0, 2, 3]]
    total = kinds.sum(axis=(0, 1))
    kinds = kinds / np.where(total > 0, total, np.inf)
    return (kinds**2).sum(axis=-1)


def _blocks(
    sums: Floats, peaks: Floats, places: tuple[NDArray[np.intp], ...], k: int, light: RegionLight
) -> Patches:
    """Blocks of 2^k pixels along a side, in these rows and columns of blocks, as patches."""
    rows, columns = places
    luminous, vector = sums[:, 3], sums[:, 4:]
    length = np.linalg.norm(vector, axis=1)
    # Pixels spread too, each as wide as those in the block's middle row.
    middle = np.minimum((rows << k) + (1 << (k - 1)), light.height - 1)
    spread = np.maximum(1 - length / luminous, 0) + light.own_spread(middle)
    squares = squares_at(rows, columns, HALVES << k)
    return Patches(vector / length[:, None], sums[:, :3], spread, peaks, squares)


@dataclass(frozen=True, eq=False)
class _Pyramid:
    """Blocks of 2, 4, ... LARGEST_BLOCK pixels along a side: they reach over the map's end where
    its size is no multiple, and hold nothing there.

    sums: (rows of blocks, columns of blocks, 7). peaks: the largest brightness, (rows, columns).
    badness: what tells which are divided first, (rows, columns). worst: of all that are not 0.
    """

    sums: list[Floats]
    peaks: list[Floats]
    badness: list[Floats]
    worst: Floats

    def limit(self, most: int) -> float:
        """Above this a block is divided, so that `most` patches come out: each division adds three.

        Half as many come out of divisions at least, however many blocks there are. A block is never
        better than one of its parts, so whatever is above has its parents above.
        """
        divisions = max(most - np.count_nonzero(self.badness[-1]), most // 2) // 3
        if divisions >= len(self.worst):
            return 0.0
        return float(np.partition(self.worst, -divisions - 1)[-divisions - 1])


def _pyramid(light: RegionLight, brightness: Floats) -> _Pyramid:
    """Of a light, with the brightness of each pixel."""
    tall = -(-light.height // LARGEST_BLOCK) * LARGEST_BLOCK // 2
    wide = -(-light.width // LARGEST_BLOCK) * LARGEST_BLOCK // 2
    rows, columns = np.divmod(light.pixels, light.width)
    block = (rows >> 1) * wide + (columns >> 1)
    finest = np.empty((tall * wide, _SUMS))
    values = (*light.flux.T, light.luminous_flux, *_vectors(light, rows, columns))
    for number, value in enumerate(values):
        finest[:, number] = np.bincount(block, value, tall * wide)
    peak = np.zeros(tall * wide)
    np.maximum.at(peak, block, brightness)
    sums, peaks = [finest.reshape(tall, wide, _SUMS)], [peak.reshape(tall, wide)]
    while 2 ** len(sums) < LARGEST_BLOCK:
        below = sums[-1]
        sums.append(below[::2, ::2] + below[::2, 1::2] + below[1::2, ::2] + below[1::2, 1::2])
        below = peaks[-1]
        pairs = np.maximum(below[::2], below[1::2])
        peaks.append(np.maximum(pairs[:, ::2], pairs[:, 1::2]))
    badness = [_squared(level) * 2.0**k for k, level in enumerate(sums, start=1)]
    return _Pyramid(sums, peaks, badness, np.concatenate([some[some > 0] for some in badness]))


def _vectors(
    light: RegionLight, rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[Floats, ...]:
    """Luminous flux times mean direction of each pixel: x, y and z, (p,) each."""
    if light.given is not None:
        return tuple(light.luminous_flux * axis for axis in light.given.T)
    azimuth, polar = sphere.centroid_angles(light.width, light.height)
    ring = np.sin(polar)[rows] * light.luminous_flux
    up = light.luminous_flux * np.cos(polar)[rows]
    return ring * np.cos(azimuth)[columns], ring * np.sin(azimuth)[columns], up
