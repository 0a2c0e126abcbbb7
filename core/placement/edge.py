"""Suns by the method "edge": cells for the truest shadows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..cells import Taken
from ..environment import LUMINANCE_WEIGHTS
from ..patches import Patches
from ..settings import ConversionSettings
from ..strata import Strata
from ..suns import Sun, disc_sun, point_sun
from .edge_cells import PatchCells
from .edge_split import edge_split
from .placement import ChosenSuns

NO_TRUER = 5e-5
"""Predicted error, as a part of all light, below which more lights are not used: a hundredth
of what the program allows by itself."""


def edge_suns(
    patches: Patches,
    strata: Strata,
    settings: ConversionSettings,
    lights: int,
    level: bool = False,
    rough: bool = False,
) -> ChosenSuns:
    """At most `lights` suns for light that is cut into patches, one patch at least. level: whether
    level ground must be right as well as shadows. rough: see `edge_split`."""
    share = float((patches.flux @ LUMINANCE_WEIGHTS).sum()) / strata.light
    cells = edge_split(
        patches, lights, settings.shape, NO_TRUER / share, level, rough, settings.in_eevee
    )
    notes = ()
    if settings.samples or settings.per_stratum or settings.position == "sample":
        notes = ("Samples, per stratum and position are of the other methods: edge has none.",)
    return replace(suns_of_cells(cells, patches, strata, settings), notes=notes)


def suns_of_cells(
    cells: PatchCells, patches: Patches, strata: Strata, settings: ConversionSettings
) -> ChosenSuns:
    """A sun for each of some cells of patches; not judged yet."""
    order = np.argsort(-(cells.flux @ LUMINANCE_WEIGHTS), kind="stable")
    rank = np.argsort(order)
    taken = Taken(patches.squares, rank[cells.owner])
    return ChosenSuns(_suns(cells, order, patches, strata, settings), np.nan, (), taken=taken)


def _suns(
    cells: PatchCells,
    order: NDArray[np.intp],
    patches: Patches,
    strata: Strata,
    settings: ConversionSettings,
) -> tuple[Sun, ...]:
    """The suns of cells in this order."""
    brightest = np.zeros(len(cells.flux))
    np.maximum.at(brightest, cells.owner, patches.brightness)
    suns = []
    for cell in order:
        flux, to_light = cells.flux[cell], cells.to_light[cell]
        # The rim of a light may be darker than region A, but belongs to it.
        stratum = max(strata.stratum(float(brightest[cell])), strata.count // 2 + 1)
        if settings.shape == "point":
            suns.append(point_sun(flux, to_light, stratum))
        else:
            suns.append(disc_sun(flux, to_light, float(cells.shortfall[cell]), stratum))
    return tuple(suns)
