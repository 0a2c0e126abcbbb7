"""The pipeline: an environment map goes in; suns, a residual map and an account come out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .account import Account, settle
from .cells import Cell
from .environment import EnvironmentMap
from .placement.choice import choose_cells
from .progress import Progress, silent
from .residual import reduced, surroundings, without
from .settings import ConversionSettings
from .strata import Strata, stratify
from .suns import Sun, disc_sun


@dataclass(frozen=True, eq=False)
class Conversion:
    """What became of a map.

    suns: brightest first. residual: float32 (height, width, 3) of the width that was asked for,
    or None.
    notes: plain sentences for the user.
    """

    environment: EnvironmentMap
    settings: ConversionSettings
    strata: Strata
    suns: tuple[Sun, ...]
    residual: NDArray[np.float32] | None
    account: Account
    notes: tuple[str, ...]


def convert(
    environment: EnvironmentMap,
    settings: ConversionSettings | None = None,
    progress: Progress = silent,
) -> Conversion:
    """Split a map into suns (region A) and a residual map (region B)."""
    settings = settings or ConversionSettings()
    progress("strata", 0.0)
    strata = stratify(environment, settings.share, settings.strata)
    progress("groups", 0.3)
    groups = bright_groups(environment, strata)
    progress("suns", 0.5)
    cells, notes = choose_cells(groups, environment, strata, settings)
    suns = tuple(disc_sun(cell, _stratum(cell, strata)) for cell in cells)
    progress("residual", 0.7)
    residual = None
    if settings.residual == "map":
        residual = reduced(without(environment, cells), settings.residual_width)
    progress("account", 0.9)
    account = settle(environment.radiance, suns, residual)
    progress("done", 1.0)
    return Conversion(environment, settings, strata, suns, residual, account, tuple(notes))


def bright_groups(environment: EnvironmentMap, strata: Strata) -> list[Cell]:
    """What each connected group of region A shines above its surroundings.

    Groups are taken with one pixel around them: it holds the light's blurred rim, which would
    otherwise be left as a bright ring and raise what is filled in.
    """
    height, width = environment.height, environment.width
    labels, count = sphere.connected_groups(strata.region_a)
    labels = sphere.grow_groups(labels, strata.luminance)
    pixels = np.flatnonzero(labels)
    solid = sphere.row_solid_angles(width, height)
    # In float64 from the float32 that will be stored: the account then closes by itself.
    beneath = surroundings(environment.radiance, labels > 0)
    excess = environment.radiance.reshape(-1, 3)[pixels].astype(np.float64) - beneath
    flux = excess * solid[pixels // width, None]
    groups = [
        Cell.of(group, flux[np.searchsorted(pixels, group)], width, height)
        for group in sphere.group_pixels(labels, count)
    ]
    return [group for group in groups if group.total > 0]


def _stratum(cell: Cell, strata: Strata) -> int:
    return strata.stratum(float(strata.luminance.ravel()[cell.pixels].max()))
