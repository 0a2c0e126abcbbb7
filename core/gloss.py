"""What rough gloss mirrors in a picture: a floor that shines shows lamps as blurred discs.

Shadows do not tell that: under many wide windows a dozen discs cast the same shadows, and a floor
that is looked at from low down shows a dozen discs. What each point of it mirrors is known from
where it is seen, so that only what is seen there need be told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS
from .suns import Sun

Floats = NDArray[np.float64]

PIECE = np.radians(1.5)
"""Points in a spiral stand for a disc, so far from each other at most. Each is blurred by its own
width, too: of a roughness of .25 light is seen blurred by 7 degrees."""

AT_ONCE = 32
"""Points that are told at a time: few enough for a processor's own memory."""

FEWEST, MOST = 16, 1024
"""Of these points."""

GRAZING = 1e-3
"""The least cosine to a surface that is told: nothing is seen from lower down."""


@dataclass(frozen=True, eq=False)
class Gloss:
    """Points of a picture that mirror the map.

    to_viewer, normals: unit vectors, (k, 3), in the axes of the map. roughness: of each, (k,); its
    square is the alpha of GGX. facing: what each reflects of light that it faces, (k,). rays:
    points of the whole picture, glossy or not, that were looked at.
    """

    to_viewer: Floats
    normals: Floats
    roughness: Floats
    facing: Floats
    rays: int

    @cached_property
    def key(self) -> bytes:
        """The same for the same points."""
        numbers = self.to_viewer, self.normals, self.roughness, self.facing
        return sha256(b"".join(some.tobytes() for some in numbers)).digest()

    def shown(self, directions: Floats, half_width: Floats) -> Floats:
        """Radiance at each point from pieces of light of a scalar irradiance of 1, (k, n).
        directions: to them, (n, 3). half_width: of each, radians, (n,).

        By GGX with the shadowing of Smith and Schlick's Fresnel (Walter and others, Microfacet
        Models for Refraction through Rough Surfaces, 2007).
        """
        found = np.empty((len(self.roughness), len(directions)))
        for start in range(0, len(found), AT_ONCE):
            some = slice(start, start + AT_ONCE)
            found[some] = self._shown(some, directions, half_width)
        return found

    def _shown(self, some: slice, directions: Floats, half_width: Floats) -> Floats:
        to_viewer, normals = self.to_viewer[some], self.normals[some]
        seen = np.maximum((normals * to_viewer).sum(axis=1), GRAZING)[:, None]
        facing = normals @ directions.T
        between = np.sqrt(np.maximum(2 + 2 * (to_viewer @ directions.T), GRAZING**2))
        half = np.clip((seen + facing) / between, 0, 1)  # cosine between normal and half vector
        # A piece that is 2 w wide spreads half vectors as a surface of so much more does.
        squared = self.roughness[some, None] ** 4 + half_width**2 / 6
        facets = squared / (np.pi * (half**2 * (squared - 1) + 1) ** 2)
        lit = np.maximum(facing, GRAZING)
        hidden = 1 + _smith(squared, lit) + _smith(squared, seen)
        fresnel = self.facing[some, None]
        fresnel = fresnel + (1 - fresnel) * np.maximum(1 - between / 2, 0) ** 5
        return np.where(facing > 0, facets * fresnel / (4 * seen * hidden), 0)

    def shown_of(self, suns: Sequence[Sun]) -> Floats:
        """Luminance at each point from some suns, (k,)."""
        if not len(suns):
            return np.zeros(len(self.roughness))
        to_light = np.array([sun.to_light for sun in suns]).reshape(-1, 3)
        flux = np.array([sun.scalar_irradiance for sun in suns]).reshape(-1, 3) @ LUMINANCE_WEIGHTS
        return self.shown_of_discs(to_light, np.array([sun.angular_diameter for sun in suns]), flux)

    def shown_of_discs(self, to_light: Floats, diameters: Floats, flux: Floats) -> Floats:
        """The same of discs: (n, 3), radians, (n,), and luminous scalar irradiance, (n,)."""
        cap = 2 * np.sin(diameters / 4) ** 2
        counts = np.clip(np.ceil(2 * np.pi * cap / PIECE**2), FEWEST, MOST).astype(int)
        half = np.sqrt(2 * np.pi * cap / counts) / 2
        points = sphere.spirals(to_light, cap, counts)
        return self.shown(points, np.repeat(half, counts)) @ np.repeat(flux / counts, counts)

    def error(self, wrong: Floats, all_light: float) -> float:
        """Root mean square over the picture, as a part of what the map shows on average. wrong:
        luminance at each point, (k,). all_light: luminance of the map's scalar irradiance."""
        return float(np.sqrt((wrong**2).sum() / self.rays)) / (all_light / (4 * np.pi))


def _smith(squared: Floats, cosine: Floats) -> Floats:
    """How much more of a surface of alpha `squared`, its square, hides itself from a direction."""
    return (np.sqrt(1 + squared * (1 / cosine**2 - 1)) - 1) / 2
