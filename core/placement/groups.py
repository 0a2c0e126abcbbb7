"""Connected groups of region A, cut further only where one disc does not stand for a group."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from math import hypot

import numpy as np

from ..cells import Cell, split

ALLOWED_MISFIT = 0.002
"""Predicted shadow-edge error, as a part of all light, up to which a disc may stand for a group."""

GAIN_OF_A_CUT = 0.75
"""A cut must bring the misfit down to this part of what it was, or it is not made.

On 15 maps, cutting a sun with its halo in two gives 0.9 to 1.1 (it only makes two bad half discs),
a round soft box 1.6; tubes, windows and clusters of lamps give 0.3 to 0.6.
"""

WIDEST_DISC = np.radians(45)
"""Wider cells are cut whatever it brings: a lamp of 74 degrees made a picture 29 % wrong."""


def cut_misfits(groups: Sequence[Cell], lights: int, all_light: float) -> list[Cell]:
    """Cells from groups: where one disc is a bad stand-in and two are better, a group is cut in
    two, the worst first, while there are fewer than `lights` cells.

    all_light: luminance of the map's scalar irradiance. Returns the cells, brightest first.
    """
    done: list[Cell] = []
    # The running number keeps equal misfits in a fixed order: results are the same on every run.
    open_cells = [(-group.misfit(), number, group) for number, group in enumerate(groups)]
    heapq.heapify(open_cells)
    number = len(open_cells)
    while open_cells and len(done) + len(open_cells) < lights:
        badness, _, cell = heapq.heappop(open_cells)
        misfit = -badness
        parts = split(cell) if misfit > ALLOWED_MISFIT * all_light else ()
        misfits = [part.misfit() for part in parts]
        narrow = cell.angular_diameter <= WIDEST_DISC
        if not parts or (narrow and hypot(*misfits) > GAIN_OF_A_CUT * misfit):
            done.append(cell)
            continue
        for part, badness in zip(parts, misfits, strict=True):
            heapq.heappush(open_cells, (-badness, number, part))
            number += 1
    done += [cell for _, _, cell in open_cells]
    return sorted(done, key=lambda cell: -cell.total)
