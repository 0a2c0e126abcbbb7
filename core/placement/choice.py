"""Which groups of region A become suns, and what the user should know of the others."""

from __future__ import annotations

import numpy as np

from ..cells import Cell
from ..region import RegionLight, bright_groups
from ..settings import ConversionSettings
from ..strata import Strata
from ..suns import Sun, disc_sun, point_sun
from .groups import cut_misfits
from .placement import NO_SUN, WIDEST_DISC, ChosenSuns, widest_note

SMALLEST_SUN = 0.005
"""Part of all light below which the automatic choice makes no sun: nobody would see its shadow."""

WIDEST_OF_A_SHARE = np.radians(10)
"""Angular diameter above which cells of a share that the user has set are cut while lights last:
a large region wants all the lights that it may have."""


def edge_suns(light: RegionLight, strata: Strata, settings: ConversionSettings) -> ChosenSuns:
    """Suns for the connected groups of region A, cut where a disc would cast wrong shadows."""
    cells, notes = choose_cells(bright_groups(light, strata), strata, settings)
    if 0 < len(cells) < settings.lights:
        notes.append(f"{len(cells)} of {settings.lights} lights: more would cast no truer shadows.")
    if settings.samples or settings.per_stratum or settings.position == "sample":
        notes.append("Samples, per stratum and position are of the other methods: edge has none.")
    suns = tuple(_sun(cell, strata, settings) for cell in cells)
    if settings.share is not None:  # by itself it takes no light into a lamp that is too wide
        notes += widest_note(suns)
    return ChosenSuns(suns, tuple(cells), tuple(notes))


def _sun(cell: Cell, strata: Strata, settings: ConversionSettings) -> Sun:
    flux = cell.flux.sum(axis=0)
    brightest = float(strata.luminance.ravel()[cell.pixels].max())
    stratum = strata.stratum(brightest)
    if settings.shape == "point":
        return point_sun(flux, cell.to_light, stratum)
    return disc_sun(flux, cell.to_light, cell.shortfall, stratum)


def choose_cells(
    groups: list[Cell], strata: Strata, settings: ConversionSettings
) -> tuple[list[Cell], list[str]]:
    """The cells that become suns, brightest first, and what the user should know of the rest."""
    all_light = strata.light
    groups = sorted(groups, key=lambda group: -group.total)
    if settings.share is not None:
        return _cells_of_a_share(groups, all_light, strata, settings)
    seen = [group for group in groups if group.total >= SMALLEST_SUN * all_light]
    notes = _left_out(groups[len(seen) :], f"each below {SMALLEST_SUN:.1%}", all_light)
    if not groups:
        notes.append(NO_SUN)
    cells, without_light = cut_misfits(seen, settings.lights, all_light)
    wide = [cell for cell in cells if cell.angular_diameter > WIDEST_DISC]
    cells = [cell for cell in cells if cell.angular_diameter <= WIDEST_DISC]
    notes += _left_out(wide, "too wide for a lamp", all_light)
    notes += _left_out(without_light, _limit(settings), all_light)
    return cells, notes


def _cells_of_a_share(
    groups: list[Cell], all_light: float, strata: Strata, settings: ConversionSettings
) -> tuple[list[Cell], list[str]]:
    """Cells where the user has set the share: wide ones stay, but are cut as far as lights go."""
    cells, without_light = cut_misfits(
        groups, settings.lights, all_light, widest=WIDEST_OF_A_SHARE, keep_all=settings.share == 1
    )
    return cells, _left_out(without_light, _limit(settings), all_light)


def _limit(settings: ConversionSettings) -> str:
    return f"beyond the limit of {settings.lights} lights"


def _left_out(groups: list[Cell], why: str, all_light: float) -> list[str]:
    if not groups:
        return []
    part = sum(group.total for group in groups) / all_light
    peaks = "1 bright spot" if len(groups) == 1 else f"{len(groups)} bright spots"
    return [f"{peaks} with {part:.2%} of all light stay in the residual: {why}."]
