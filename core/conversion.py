"""The pipeline: an environment map goes in; suns, a residual map and an account come out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .account import Account, settle
from .cells import Cell
from .environment import EnvironmentMap
from .placement.groups import WIDEST_DISC, cut_misfits
from .progress import Progress, silent
from .residual import surroundings
from .settings import ConversionSettings
from .strata import Strata, stratify
from .suns import Sun, disc_sun

SMALLEST_SUN = 0.005
"""Part of all light below which the automatic choice makes no sun: nobody would see its shadow."""


WIDEST_OF_A_SHARE = np.radians(10)
"""Angular diameter above which cells of a share that the user has set are cut while lights last:
a large region wants all the lights that it may have."""


@dataclass(frozen=True, eq=False)
class Conversion:
    """What became of a map.

    suns: brightest first. residual: float32 (height, width, 3), or None when not asked for.
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
    residual = without(environment, cells) if settings.residual == "map" else None
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


def choose_cells(
    groups: list[Cell],
    environment: EnvironmentMap,
    strata: Strata,
    settings: ConversionSettings,
) -> tuple[list[Cell], list[str]]:
    """The cells that become suns, brightest first, and what the user should know of the rest."""
    solid = sphere.row_solid_angles(environment.width, environment.height)
    all_light = float(strata.luminance.sum(axis=1) @ solid)
    groups = sorted(groups, key=lambda group: -group.total)
    if settings.share is not None:
        return _cells_of_a_share(groups, all_light, strata, settings)
    seen = [group for group in groups if group.total >= SMALLEST_SUN * all_light]
    notes = _left_out(groups[len(seen) :], f"each below {SMALLEST_SUN:.1%}", all_light)
    if not groups:
        notes.append("No pixel is much brighter than the rest: the map needs no sun.")
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
    notes = []
    if abs(strata.share - settings.share) > 0.02:
        notes.append(
            f"A share of {settings.share:.0%} was asked for; pixels of equal brightness stay "
            f"together, so region A holds {strata.share:.1%}."
        )
    cells, without_light = cut_misfits(
        groups, settings.lights, all_light, widest=WIDEST_OF_A_SHARE, keep_all=settings.share == 1
    )
    notes += _left_out(without_light, _limit(settings), all_light)
    wide = [cell for cell in cells if cell.angular_diameter > WIDEST_DISC]
    if wide:
        widest = np.degrees(max(cell.angular_diameter for cell in wide))
        notes.append(
            f"The widest sun spans {widest:.0f}° and stands for its light only roughly: "
            "more lights or a smaller share would be truer."
        )
    return cells, notes


def _limit(settings: ConversionSettings) -> str:
    return f"beyond the limit of {settings.lights} lights"


def _left_out(groups: list[Cell], why: str, all_light: float) -> list[str]:
    if not groups:
        return []
    part = sum(group.total for group in groups) / all_light
    peaks = "1 bright spot" if len(groups) == 1 else f"{len(groups)} bright spots"
    return [f"{peaks} with {part:.2%} of all light stay in the residual: {why}."]


def without(environment: EnvironmentMap, cells: list[Cell]) -> NDArray[np.float32]:
    """The map less the light of these cells, float32 (height, width, 3)."""
    solid = sphere.row_solid_angles(environment.width, environment.height)
    residual = environment.radiance.copy()
    flat = residual.reshape(-1, 3)
    for cell in cells:
        rows = cell.pixels // environment.width
        flat[cell.pixels] = flat[cell.pixels] - cell.flux / solid[rows, None]
    np.maximum(flat, 0, out=flat)
    return residual


def _stratum(cell: Cell, strata: Strata) -> int:
    return strata.stratum(float(strata.luminance.ravel()[cell.pixels].max()))
