"""Cells cut further, where a picture shows their discs in rough gloss.

Cells are made for shadows; most of them are out of such a picture's sight, and the others are cut,
the worst first, until what is mirrored is right enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..cells import Cells, Taken
from ..environment import LUMINANCE_WEIGHTS
from ..gloss import Gloss
from ..patches import Patches
from ..prediction import Prediction
from ..region import RegionLight
from ..settings import ConversionSettings
from ..shadow_edges import half_widths
from ..strata import Strata
from ..suns import disc_diameter
from .edge import suns_of_cells
from .edge_cells import cells_of
from .edge_light import EdgeLight, Floats, Owner, sums_of
from .judged import judged, tilted
from .placement import ON_GLOSS, ChosenSuns

MOST_IN_GLOSS = 64
"""By itself: more are not worth what they cost to show a floor's reflections a little truer."""

ROUNDS = 6
"""So often are cells cut further, if what tilts their discs for level ground is shown by gloss."""


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


def true_in_gloss(
    chosen: ChosenSuns,
    light: RegionLight,
    patches: Patches,
    strata: Strata,
    settings: ConversionSettings,
    prediction: Prediction,
    gloss: Gloss,
    of_shadows: float | None,
) -> ChosenSuns:
    """The same suns, or more where rough gloss shows them to be discs, with what is wrong of that.
    of_shadows: what is allowed of them; suns are tilted for that, which gloss shows too."""
    shown = light.latest("gloss", (strata, gloss.key), lambda: shown_light(gloss, patches))
    wanted = shown.sum(axis=1)

    def told(suns: ChosenSuns) -> ChosenSuns:
        wrong = gloss.shown_of(suns.suns) - wanted
        return replace(suns, gloss_error=gloss.error(wrong, strata.light))

    aim, most = settings.tolerated / 100, settings.most_lights
    allowed = ON_GLOSS * aim

    def badness(suns: ChosenSuns) -> float:
        shadows = suns.worst / of_shadows if of_shadows else 0.0
        return max(suns.gloss_error / allowed, shadows)

    best = told(chosen)
    if settings.lights is None:
        most = max(min(most, MOST_IN_GLOSS), len(chosen.suns))
    if best.gloss_error <= allowed or len(chosen.suns) >= most:
        return best
    parts, owner = EdgeLight.of(patches, settings.shape), owners(chosen.taken, light, patches)
    for _ in range(ROUNDS):
        owner = cut_for_gloss(parts, patches, owner, gloss, shown, strata.light, aim, most)
        cut = suns_of_cells(cells_of(parts, owner), patches, strata, settings)
        cut = judged(replace(cut, notes=chosen.notes), prediction, strata)
        cut = told(tilted(cut, prediction, strata, of_shadows) if of_shadows else cut)
        best = min(best, cut, key=badness)
        if cut.gloss_error <= allowed or len(cut.suns) >= most:
            break
        aim *= allowed / cut.gloss_error
    return best


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
