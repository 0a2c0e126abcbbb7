"""Noise of a path tracer, and the border between suns and residual that leaves least of it.

A path tracer looks for light in two ways: towards a sun, chosen by its strength, and along its
own next ray, which meets the residual. On white surfaces of all orientations that nothing shades,
one sample of each has, in squares of the mean irradiance, the mean variance

    suns:      16 (F_A^2 / 6 - K_A) / F^2              F: light, the integral of L
    residual:  16 (pi/4 * integral of R^2 - K_B) / F^2   K: mean square of the irradiance

In a closed scene whose openings the path tracer knows it looks for the residual through these. If
they take a part f of the half sphere above a place, of which 2 pi f is the solid angle, that leaves
pi f / 3 instead of pi/4; what is seen of suns and of the residual is as rare, so that the mean
squares K do not count. There it looks for one of both at a time, which makes either as much noisier
as it is seldom looked for: a little light in suns is noisier than left where it is.

Renders are less noisy than that, but least noisy for about the same border
(docs/benchmarks/region_a.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .sums import weighted_sum

Floats = NDArray[np.float64]

OTHERWISE = 0.1
"""Variance of a sample that no border changes: penumbrae, edges, mirrors."""

WORTH = 1.1
"""So much more variance is taken for a higher border: each sun costs time."""

WITHOUT = 3.0
"""And so much for no suns at all: looking for suns takes two thirds of a picture's time."""

OF_TABLE = 1.0
"""Variance, about, if the residual is looked for by a table of its light instead: what is left of
noise where a residual is not calm at all."""

SAMPLES = 256
"""Noise counts against wrong shadows as in a picture of so many samples a pixel."""

PER_OCTAVE = 4
"""Borders that are tried; between two of them the variance is flat."""

ROWS = 128
"""Of blocks, down a map."""

LOWEST = 1.5
"""The lowest border, in means of the map."""

_LOBE = np.array([np.pi] + 3 * [2 * np.pi / 3] + 5 * [np.pi / 4])
"""A cosine lobe in spherical harmonics of order 0, 1 and 2: all but 1 % of its square
(Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps, 2001)."""


def harmonics(directions: Floats) -> Floats:
    """Real spherical harmonics of order 0 to 2, orthonormal, of unit vectors (n, 3): (n, 9)."""
    x, y, z = directions.T
    first, second = np.sqrt(3 / (4 * np.pi)), np.sqrt(15 / (4 * np.pi))
    return np.stack(
        [
            np.full_like(x, np.sqrt(1 / (4 * np.pi))),
            *(first * axis for axis in (x, y, z)),
            *(second * pair for pair in (x * y, y * z, z * x)),
            second / np.sqrt(12) * (3 * z**2 - 1),
            second / 2 * (x**2 - y**2),
        ],
        axis=-1,
    )


def mean_square_irradiance(coefficients: Floats) -> Floats:
    """Over all orientations, of light with these harmonics (..., 9): (...)."""
    return ((coefficients * _LOBE) ** 2).sum(axis=-1) / (4 * np.pi)


def square_from_one_place(coefficients: Floats) -> Floats:
    """The same if all of that light came from one place: a sixth of it squared, but for what
    higher orders hold."""
    light = coefficients[..., 0] * np.sqrt(4 * np.pi)
    per_order = np.array([1, 3, 5]) @ _LOBE[[0, 1, 4]] ** 2 / (4 * np.pi) ** 2
    return light**2 * per_order


def squared_noise(variance: float) -> float:
    """What the variance of a sample comes to in a picture, to compare with squared errors."""
    return min(variance, OF_TABLE) / SAMPLES


@dataclass(frozen=True, eq=False)
class Borders:
    """Borders that a map could be cut at, the highest first, which leaves no suns; all (n,).

    level: luminance. suns: variance of what lies above it. residual: of the map cut off there.
    without: so much more variance is taken for no suns at all.
    """

    level: Floats
    suns: Floats
    residual: Floats
    without: float = WITHOUT

    @property
    def variance(self) -> Floats:
        return self.suns + self.residual + OTHERWISE

    @property
    def best(self) -> int:
        """The highest that is about as calm as the calmest, or 0: no suns."""
        variance = self.variance
        if variance[0] <= self.without * variance.min():
            return 0
        return int(np.argmax(variance <= WORTH * variance.min()))

    @property
    def best_level(self) -> float:
        return float(self.level[self.best])


def borders(lum: Floats, solid: Floats, through: float | None = None) -> Borders:
    """What each border would leave of noise.

    lum: luminance (height, width), not all 0. solid: of a pixel of each row, (height,). through:
    the part f of a half sphere that openings take, where they are known.
    """
    height, width = lum.shape
    weight, flat = np.repeat(solid, width), lum.ravel()
    light = float(weighted_sum(solid, lum.sum(axis=1)))
    square = float(weighted_sum(solid, (lum**2).sum(axis=1)))
    level = _levels(float(flat.max()), LOWEST * light / (4 * np.pi))
    bright = np.flatnonzero(flat > level[-1])
    value, weight_of = flat[bright], weight[bright]
    first = np.searchsorted(-level, -value, side="right")  # the highest level that is below
    # Of the pixels above each level: of the pixels themselves, and of their light.
    pixels = weight_of[:, None] * harmonics(sphere.pixel_directions(bright, width, height))
    area = _sums_to(pixels, first, len(level))
    pixels *= value[:, None]
    suns = _sums_to(pixels, first, len(level)) - level[:, None] * area
    of_squares = np.stack([weight_of, weight_of * value**2], axis=-1)
    squares = _sums_to(of_squares, first, len(level))
    above = squares[:, 1] - level**2 * squares[:, 0]
    unit = 16 / light**2
    if through is not None:  # light is looked for anyway: suns cost no more time
        of_suns = unit * square_from_one_place(suns)
        residual = unit * np.pi / 3 * through * (square - above)
        to_suns, through_them = _looks(np.maximum(suns[:, 0], 0) * np.sqrt(4 * np.pi) / light)
        return Borders(level, of_suns / to_suns, residual / through_them, WORTH)
    rest = _all_harmonics(lum * solid[:, None]) - suns
    return Borders(
        level,
        unit * (square_from_one_place(suns) - mean_square_irradiance(suns)),
        unit * (np.pi / 4 * (square - above) - mean_square_irradiance(rest)),
    )


def _looks(share: Floats) -> tuple[Floats, Floats]:
    """Chances that a path tracer looks for suns, and through openings for the rest, where it does
    one of both: each by its strength, as Cycles' light tree has it. share: of all light that suns
    have, 0 to 1.

    The rest counts as an even sky, with a quarter of its light; a sun with its irradiance. Averaged
    over surfaces of all orientations, weighted by what is found.
    """
    rest, suns = np.maximum([1 - share, share], 1e-9)  # what is not there is not divided by
    return 1 / (1 + 0.375 * rest / suns), 1 / (1 + suns / rest)


def _levels(highest: float, lowest: float) -> Floats:
    """Falling evenly in logarithms, the highest at least."""
    count = max(int(PER_OCTAVE * np.log2(highest / lowest)), 0) + 1
    return highest * 2.0 ** (-np.arange(count) / PER_OCTAVE)


def _sums_to(values: Floats, first: NDArray[np.intp], count: int) -> Floats:
    """Sums of values (p, c) with a first of 0, of 0 and 1, ... up to count - 1: (count, c)."""
    from scipy.sparse import csc_array

    pixels = len(first)
    of_first = csc_array((np.ones(pixels), first, np.arange(pixels + 1)), shape=(count, pixels))
    return np.cumsum(of_first @ values, axis=0)


def _all_harmonics(light: Floats) -> Floats:
    """Harmonics of a whole map, (9,), of the light of its pixels, (height, width).

    Order 2 does not tell the pixels of a small block apart.
    """
    height, width = light.shape
    rows = np.arange(0, height, -(-height // ROWS))
    columns = np.arange(0, width, -(-height // ROWS))
    blocks = np.add.reduceat(np.add.reduceat(light, rows, axis=0), columns, axis=1)
    down, across = (np.append(rows, height) / height, np.append(columns, width) / width)
    u, v = np.meshgrid((across[1:] + across[:-1]) / 2, (down[1:] + down[:-1]) / 2)
    return weighted_sum(blocks.ravel(), harmonics(sphere.to_directions(u.ravel(), v.ravel())))
