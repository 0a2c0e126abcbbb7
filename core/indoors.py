"""Places that light reaches through openings only, and what they get of it.

What suns get wrong in a room is not what they get wrong in the open: a light as wide as a window
across the street draws that window's outline on the floor, and next to nothing else is lit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .openings import Opening

Floats = NDArray[np.float64]

BOUNCED = 3.0
"""So much brighter than what falls in directly is a picture of a room, whose walls give most of it
back: so much less is it wrong by. What comes of that: docs/benchmarks/portals.md."""

SOFT = 0.02
"""Of an opening's side: shadows of its edges are told as soft as that at least. Much narrower than
a pixel shows, a few places would tell of them by chance."""

AT_ONCE = 128
"""Pieces of light that are held against all places at a time: few enough for a processor's own
memory."""


@dataclass(frozen=True, eq=False)
class Indoors:
    """places: that matter, (p, 3), with normals, (p, 3). openings: rectangles that the light of a
    map comes in through; nothing is thought to stand between. All in the axes of the map. light:
    luminance of the scalar irradiance, of what of the map may come in, from each cell of an
    equirectangular grid of twice as many columns as rows, (cells,)."""

    places: Floats
    normals: Floats
    openings: tuple[Opening, ...]
    light: Floats

    @cached_property
    def key(self) -> bytes:
        """The same for the same places, openings and light."""
        numbers = [self.places, self.normals, self.light]
        numbers += [
            np.array([*one.centre, *one.across, *one.inwards, one.width, one.height])
            for one in self.openings
        ]
        return sha256(b"".join(some.tobytes() for some in numbers)).digest()

    def irradiance(self, directions: Floats, flux: Floats, half_width: Floats) -> Floats:
        """Luminance at each place, (p,), from pieces of light: directions (n, 3), luminous scalar
        irradiance (n,), half their width in radians (n,)."""
        total = np.zeros(len(self.places))
        for opening in self.openings:
            facing = -(directions @ opening.inwards)
            before = opening.is_before(self.places)
            come_in = np.flatnonzero(facing > 0)
            for start in range(0, len(come_in), AT_ONCE):
                some = come_in[start : start + AT_ONCE]
                pieces = directions[some], flux[some], half_width[some]
                total[before] += self._through(opening, before, *pieces, facing[some])
        return total

    def _through(
        self,
        opening: Opening,
        before: NDArray[np.bool_],
        directions: Floats,
        flux: Floats,
        half_width: Floats,
        facing: Floats,
    ) -> Floats:
        """Through one opening, at places before it."""
        from_centre = self.places[before] - opening.centre
        along = (from_centre @ opening.inwards)[:, None] / facing
        blur = 2 * along * half_width
        given = np.maximum(self.normals[before] @ directions.T, 0)
        for axis, side in ((opening.across, opening.width), (opening.up, opening.height)):
            at = (from_centre @ axis)[:, None] + along * (directions @ axis)
            soft = np.maximum(blur, SOFT * side)
            # Of a piece wider than the opening no more comes in than it has room for.
            most = np.minimum(side / soft, 1)
            given *= np.clip((side / 2 - np.abs(at)) / soft + 0.5, 0, most)
        return given @ flux

    def mean_irradiance(self, directions: Floats, flux: Floats, irradiance: Floats) -> float:
        """Of all light of the map, at all places. directions, flux: of some of it, (n, 3) and (n,),
        of which `irradiance` is known, (p,); the rest counts as even within each cell."""
        rows = int(np.sqrt(len(self.light) / 2))
        size = 2 * rows, rows
        some = np.bincount(sphere.pixels_at(directions, *size), flux, len(self.light))
        cells = np.arange(len(self.light))
        half = np.sqrt(sphere.row_solid_angles(*size)[cells // (2 * rows)]) / 2
        rest = np.maximum(self.light - some, 0)
        # A piece counts where its middle is, and takes from the next cell what that has not.
        rest *= max(self.light.sum() - flux.sum(), 0) / max(rest.sum(), 1e-300)
        given = self.irradiance(sphere.pixel_directions(cells, *size), rest, half)
        return float(np.mean(irradiance + given))
