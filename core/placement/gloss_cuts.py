"""Cells cut further, where a picture shows their discs in rough gloss.

Cells are made for shadows; most of them are out of such a picture's sight, and the others are cut,
the worst first, until what is mirrored is right enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..cells import Cells, Taken
from ..environment import LUMINANCE_WEIGHTS
from ..gloss import Gloss
from ..patches import Patches
from ..region import RegionLight
from ..shadow_edges import half_widths
from ..suns import disc_diameter
from .edge_light import EdgeLight, Floats, Owner, sums_of


def shown_light(gloss: Gloss, patches: Patches) -> Floats:
    """Luminance at each point of a picture from each patch, (k, p)."""
    return gloss.shown(patches.directions, half_widths(patches.spread)) * (
        patches.flux @ LUMINANCE_WEIGHTS
    )


def owners(taken: Taken, light: RegionLight, patches: Patches) -> Owner:
    """The sun that each patch of a light belongs to, (p,), where suns took other patches of it."""
    labels = Cells(light.pixels, taken, light.width, light.height).labels()
    side = patches.squares[:, 2]
    middle = np.minimum(patches.squares[:, :2] + (side // 2)[:, None], np.array(labels.shape) - 1)
    owner = labels[middle[:, 0], middle[:, 1]].astype(np.intp)
    known = np.flatnonzero(owner >= 0)
    for patch in np.flatnonzero(owner < 0):  # its middle does not shine
        near = patches.directions[known] @ patches.directions[patch]
        owner[patch] = owner[known[np.argmax(near)]]
    return owner


@dataclass(frozen=True, eq=False)
class _Cell:
    """members: its patches. wrong: what its disc shows too much at each point, (k,)."""

    members: Owner
    wrong: Floats


def cut_for_gloss(
    light: EdgeLight,
    patches: Patches,
    owner: Owner,
    gloss: Gloss,
    shown: Floats,
    all_light: float,
    allowed: float,
    most: int,
) -> Owner:
    """The cell of each patch, (p,), with about as few cells, `most` at most, as show what is
    allowed to be wrong, a part of what the map shows on average; else those that are least wrong.

    owner: cells to begin with. shown: see `shown_light`. all_light: see `Gloss.error`.
    """
    luminous = patches.flux @ LUMINANCE_WEIGHTS

    def cell(members: Owner) -> _Cell:
        alone = np.zeros(len(members), np.intp)
        held = sums_of(alone, light.held[members], 1)
        to_light, shortfall = light.moments(held, members, alone)
        flux = luminous[members].sum()[None]
        disc = gloss.shown_of_discs(to_light, disc_diameter(shortfall), flux)
        return _Cell(members, disc - shown[:, members].sum(axis=1))

    cells = [cell(np.flatnonzero(owner == number)) for number in np.unique(owner)]
    may_be_cut = [True] * len(cells)
    best, least = list(cells), np.inf
    while True:
        error = gloss.error(np.sum([one.wrong for one in cells], axis=0), all_light)
        if error < least:
            best, least = list(cells), error
        badness = [
            float(one.wrong @ one.wrong) if may else 0.0
            for one, may in zip(cells, may_be_cut, strict=True)
        ]
        worst = int(np.argmax(badness))
        if error <= allowed or len(cells) >= most or not badness[worst]:
            break
        first = light.halves(cells[worst].members)
        if first is None:
            may_be_cut[worst] = False
            continue
        members = cells[worst].members
        cells[worst : worst + 1] = [cell(members[first]), cell(members[~first])]
        may_be_cut[worst : worst + 1] = [True, True]
    found = np.empty_like(owner)
    for number, one in enumerate(best):
        found[one.members] = number
    return found
