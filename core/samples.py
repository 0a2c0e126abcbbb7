"""Map of samples: a map replaced by the Voronoi cells of a few samples (paper, 2.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .placement.sampled import sample
from .region import light_of_map
from .settings import ConversionSettings
from .voronoi import cell_sums, label_map, voronoi_map

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MapOfSamples:
    """n samples of a map and their spherical Voronoi cells.

    sites: unit vectors, (n, 3). flux: scalar irradiance of each cell, (n, 3): the paper's total
    radiance. area: of each cell, steradians, (n,). radiance: the Voronoi map, float32
    (height, width, 3): each cell shows its mean radiance.
    """

    sites: Floats
    flux: Floats
    area: Floats
    radiance: NDArray[np.float32]


def map_of_samples(
    radiance: NDArray[np.float32], settings: ConversionSettings
) -> tuple[MapOfSamples, tuple[str, ...]]:
    """The Voronoi map of `settings.residual_samples` samples of a map, and notes.

    Samples are placed by the settings' method, Penrose tiling where that places none.
    """
    height, width = radiance.shape[:2]
    light = light_of_map(radiance)
    light = light.part(light.luminous_flux > 0)
    if not len(light.pixels):
        return no_samples(radiance), ("The rest holds no light: its Voronoi map is black.",)
    count = settings.residual_samples
    sites = sample(light, count, settings).sites
    labels = label_map(sites, width, height)
    # On a narrow map a cell may lie between the centres of all pixels.
    used = np.bincount(labels.ravel(), minlength=len(sites)) > 0
    labels = (np.cumsum(used) - 1).astype(np.int32)[labels]
    sites = sites[used]
    sums = cell_sums(radiance, labels, len(sites))
    notes = ()
    if len(sites) < count:
        notes = (
            f"{len(sites)} cells of {count} in the Voronoi map: samples nearer than a pixel "
            "were clustered.",
        )
    return MapOfSamples(sites, sums.flux, sums.area, voronoi_map(sums.mean_radiance, labels)), notes


def no_samples(radiance: NDArray[np.float32]) -> MapOfSamples:
    """Of a black map."""
    return MapOfSamples(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.zeros_like(radiance))
