"""What every method of placement takes and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..cells import Taken
from ..region import RegionLight
from ..suns import Sun
from ..voronoi import label_map, nearest

DENSE = 1 / 16
"""Part of a map's pixels from which labelling the whole map is faster than asking for each."""

NO_SUN = "No pixel is much brighter than the rest: the map needs no sun."


@dataclass(frozen=True, eq=False)
class Placement:
    """Samples of a region's light and the cell of each.

    sites: unit vectors (n, 3), at most as many as were asked for. given: the owner of each pixel
    where the method itself says so; None: the nearest site on the sphere.
    """

    sites: NDArray[np.float64]
    light: RegionLight
    given: NDArray[np.intp] | None = None

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """For each pixel of the region the site whose cell it lies in, (p,)."""
        return _nearest_sites(self.light, self.sites) if self.given is None else self.given


ON_GROUND = 0.25
"""So much of a tolerance is allowed on level ground: what it gets wrong is wrong all over a
picture, not only at shadows' edges."""

ON_WALLS = 1.0
"""And so much on walls that stand on it: each is wrong all over, but they are many."""


ON_GLOSS = 1.2
"""So much of a tolerance is allowed of what rough gloss shows in a picture: it is predicted no
better than to a fifth."""


@dataclass(frozen=True, eq=False)
class ChosenSuns:
    """Suns, brightest first, and notes for the user.

    predicted_error: see `prediction.Prediction`. ground_error: of the irradiance of level ground in
    the open, by the worst channel. Both nan before they are known. standing_error: what walls on
    that ground get wrong, root mean square, as a part of the mean irradiance; None where that is
    not predicted. gloss_error: what a picture shows wrong in rough gloss, root mean square, as a
    part of what the map shows on average; None where that is not known. taken: the light of each,
    None without suns.
    """

    suns: tuple[Sun, ...]
    predicted_error: float
    notes: tuple[str, ...]
    ground_error: float = np.nan
    standing_error: float | None = None
    gloss_error: float | None = None
    taken: Taken | None = None

    @property
    def worst(self) -> float:
        """What a tolerance is held against; gloss is held against it by itself."""
        walls = self.standing_error or 0.0
        return max(self.predicted_error, self.ground_error / ON_GROUND, walls / ON_WALLS)


Place = Callable[[RegionLight, int], Placement]
"""A method: it takes light, of which some must be there, and how many samples to place in it."""


def _nearest_sites(light: RegionLight, sites: NDArray[np.float64]) -> NDArray[np.intp]:
    if len(light.pixels) > DENSE * light.width * light.height:
        labels = label_map(sites, light.width, light.height)
        return labels.ravel()[light.pixels].astype(np.intp)
    return nearest(sphere.pixel_centres(light.pixels, light.width, light.height), sites)


_HOMES = {
    "penrose": ("penrose", "penrose"),
    "median-cut": ("boxes", "median_cut"),
    "variance": ("boxes", "variance"),
    "kmeans": ("kmeans", "kmeans"),
}


def method_named(name: str) -> Place:
    """The placement method of that name; each is imported when it is first used."""
    from importlib import import_module

    module, function = _HOMES[name]
    return getattr(import_module(f".{module}", __package__), function)
