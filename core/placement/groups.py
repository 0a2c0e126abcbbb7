"""Connected groups of region A, cut further only where one disc does not stand for a group."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import numpy as np

from ..cells import Cell, split
from .placement import WIDEST_DISC

ALLOWED_MISFIT = 0.002
"""Predicted shadow-edge error, as a part of all light, up to which a disc may stand for a group."""

GAIN_OF_A_CUT = 0.75
"""A cut must bring the misfit down to this part of what it was, or it is not made.

On 15 maps, cutting a sun with its halo in two gives 0.9 to 1.1 (it only makes two bad half discs),
a round soft box 1.6; tubes, windows and clusters of lamps give 0.3 to 0.6.
"""


def cut_misfits(
    groups: Sequence[Cell],
    lights: int,
    all_light: float,
    widest: float = WIDEST_DISC,
    keep_all: bool = False,
) -> tuple[list[Cell], list[Cell]]:
    """At most `lights` cells from groups, and the cells for which there was no light left.

    Where one disc is a bad stand-in and two are better, a cell is cut in two, the worst first.
    When all lights are taken, the faintest cell makes room as long as what the cut repairs is
    more than that cell gives. Both lists are sorted, brightest first.

    all_light: luminance of the map's scalar irradiance. widest: angular diameter in radians above
    which a cell is cut whatever it brings. keep_all: no cell may make room for another, as there
    is no residual that would take its light.
    """
    cells = list(groups)
    misfits = [_badness(cell, all_light, widest) for cell in cells]
    left_out: list[Cell] = []
    while cells:
        worst = int(np.argmax(misfits))
        if misfits[worst] <= 0:
            break
        if not (len(cells) < lights or keep_all):
            faintest = min(range(len(cells)), key=lambda i: cells[i].total)
            if faintest == worst or cells[faintest].total >= misfits[worst]:
                break
        elif len(cells) >= lights:
            break
        parts = _cut(cells[worst], widest)
        if not parts:
            misfits[worst] = 0.0
            continue
        cells[worst : worst + 1] = parts
        misfits[worst : worst + 1] = [_badness(part, all_light, widest) for part in parts]
        while len(cells) > lights and not keep_all:
            faintest = min(range(len(cells)), key=lambda i: cells[i].total)
            left_out.append(cells.pop(faintest))
            misfits.pop(faintest)
    cells.sort(key=lambda cell: -cell.total)
    left_out += cells[lights:]
    return cells[:lights], sorted(left_out, key=lambda cell: -cell.total)


def _badness(cell: Cell, all_light: float, widest: float) -> float:
    """The misfit of a cell that may want a cut, else 0."""
    misfit = cell.misfit()
    wants_a_cut = misfit > ALLOWED_MISFIT * all_light or cell.angular_diameter > widest
    return misfit if wants_a_cut else 0.0


def _cut(cell: Cell, widest: float) -> tuple[Cell, ...]:
    parts = split(cell)
    if parts and cell.angular_diameter <= widest:
        gain = hypot(*(part.misfit() for part in parts)) / cell.misfit()
        return parts if gain <= GAIN_OF_A_CUT else ()
    return parts
