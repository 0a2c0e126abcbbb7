"""Cells that share out their borders among each other, until each patch is where it is best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .edge_cells import PatchCells, cells_of
from .edge_light import RELATIVE, SEEN_BY, VECTORS, EdgeLight, Floats, Owner

TOGETHER = 7.0
"""How much a piece of light is drawn to where it brings the colours of a cell back to one place,
against how much it is drawn to the nearest cell. Of 4, 16 and 64 lights for 17 maps the worst
channel is wrong by 1.32, 1.36 and 1.28 times what luminance is, with 10 by 1.30, 1.32 and 1.32
times: neither is better for all, so that more is tried later (`edge_split.STRONGER`)."""

PULLED = 0, 2
"""The channels that are brought back, red and blue: green lies between."""

HEAVY = 0.1
"""A patch with more than this part of its cell's light stays there: from hand to hand it would
turn the widths of whole cells at each step, and never settle."""

DISTANCES = 1 << 14
"""Distances of patches to cells that are worked out at a time: few enough for a processor's own
memory, and so few that BLAS gives them to one thread (see `sums`)."""


@dataclass(frozen=True, eq=False)
class Balance:
    """What sharing out borders asks of a light's patches."""

    light: EdgeLight

    def after(self, cells: PatchCells, steps: int, together: float = TOGETHER) -> PatchCells:
        """The cells after so many steps, or when nothing moves any more."""
        for _ in range(steps):
            owner = self.shared_out(cells, together)
            if np.array_equal(owner, cells.owner):
                break
            cells = cells_of(self.light, owner)
        return cells

    def shared_out(self, cells: PatchCells, together: float) -> Owner:
        """For each patch the cell that is best to have it: a new owner, (p,).

        Near, in a measure of each cell's own: bright and narrow cells take little from around
        them. And where it brings the colours of a cell back together: see TOGETHER.
        """
        whole = cells.held[:, RELATIVE] @ SEEN_BY / SEEN_BY.sum()
        owner = self._nearest(cells, whole, together)
        stays = self.light.light > HEAVY * whole[cells.owner]
        owner[stays] = cells.owner[stays]
        return owner

    @cached_property
    def features(self) -> Floats:
        """What distances of patches are linear in, (p, 10): direction, 1, and mean direction times
        red and times blue against all of the patch's light."""
        whole = np.maximum(self.light.light, 1e-300)[:, None]
        parts = [self.light.patches.directions, np.ones_like(whole)]
        vectors = self.light.held[:, VECTORS]
        parts += [vectors[:, 3 * c : 3 * c + 3] / whole for c in PULLED]
        return np.concatenate(parts, axis=1)

    def _nearest(self, cells: PatchCells, whole: Floats, together: float) -> Owner:
        """The cell to which the distance of each patch is the least, (p,).

        whole: light of each cell, (n,).
        """
        count = len(whole)
        scale = np.sqrt(whole / (2 * np.maximum(cells.shortfall, 1e-9)))
        # The squared chord, 2 - 2 cos, and how far a channel's mean lies aside of the cell's: both
        # linear in a patch's direction, so that one product of matrices holds them all.
        of_cells = [-2 * cells.to_light * scale[:, None], 2 * scale[:, None]]
        for channel in PULLED:
            vector = cells.held[:, VECTORS][:, 3 * channel : 3 * channel + 3]
            aside = vector - (vector * cells.to_light).sum(axis=1)[:, None] * cells.to_light
            aside *= (together * scale / np.maximum(whole, 1e-300))[:, None]
            of_cells.append(aside)
        cell_parts = np.concatenate(of_cells, axis=1).T
        owner = np.empty(len(self.light.patches), np.intp)
        # Two patches at least, as one alone is another kind of product, with limits of its own.
        at_once = min(max(DISTANCES // count, 2), len(owner))
        distances = np.empty((at_once, count))
        for start in range(0, len(owner), at_once):
            some = slice(min(start, len(owner) - at_once), start + at_once)
            np.matmul(self.features[some], cell_parts, out=distances)
            np.argmin(distances, axis=1, out=owner[some])
        return owner
