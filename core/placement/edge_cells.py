"""Cells of patches, the disc or point in the place of each, and what these would get wrong.

A shadow's edge crosses a cell with a probability that grows with its width, and costs what the disc
in its place gets wrong of the cell's light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..shadow_edges import cap_beyond, edges_across
from ..suns import disc_diameter, disc_on_ground
from ..two_orders import part_shadowed
from .edge_light import FLUX, JUDGED, SEEN, TOTAL, EdgeLight, Floats, Owner, sums_of

TURNS, PLACES = 4, 24
"""Edges across a cell: at so many angles, in so many places each. With 6 angles or 48 places the
errors of 4 to 64 lights are the same."""

GROUND = 1.0
"""How much what level ground gets wrong counts against a shadow's edge anywhere: the horizon is one
edge that nearly every scene has. With 10, shadows of 4 lights get 15 % worse."""

HIDDEN = 0.5
"""Of all walls, those that hide a piece of light: what fades of its shadow is wrong behind them."""

CELLS = 512
"""Cells whose edges are held in memory at a time."""


@dataclass(frozen=True, eq=False)
class PatchCells:
    """Cells of patches and the disc or point in the place of each.

    owner: the cell of each patch, (p,). held: sums over each cell, see `EdgeLight.held`, (n, HELD).
    to_light: unit vectors, (n, 3). shortfall: 1 - R of each, where R is the length of its mean
    direction, (n,). wrong: what each is predicted to get wrong, see `squared_errors`, (n, JUDGED);
    infinite before they are judged. on_ground: what level ground gets too much or too little of
    each, (n, JUDGED).
    """

    owner: Owner
    held: Floats
    to_light: Floats
    shortfall: Floats
    wrong: Floats
    on_ground: Floats

    @property
    def error(self) -> float:
        """Predicted for all of them together, as a part of all light of the channel that is most
        wrong."""
        return error_of(self.wrong.sum(axis=0))

    @property
    def level_error(self) -> float:
        """The same where level ground must be right too. A shadow's edge crosses few cells, but all
        of them shine on the ground, and discs that reach below the horizon err to one side."""
        alone, together = (self.on_ground**2).sum(axis=0), self.on_ground.sum(axis=0) ** 2
        return error_of(self.wrong.sum(axis=0) + GROUND * (together - alone))

    @property
    def flux(self) -> Floats:
        """Scalar irradiance of each cell, (n, 3)."""
        return self.held[:, FLUX]


def cells_of(light: EdgeLight, owner: Owner) -> PatchCells:
    """Cells by their moments; those that have lost all patches are left out."""
    occupied = np.bincount(owner) > 0
    count = int(occupied.sum())
    if count < len(occupied):
        owner = (np.cumsum(occupied) - 1)[owner]
    held = sums_of(owner, light.held, count)
    to_light, shortfall = light.moments(held, np.arange(len(owner)), owner)
    unknown, none = np.full((count, JUDGED), np.inf), np.zeros((count, JUDGED))
    return PatchCells(owner, held, to_light, shortfall, unknown, none)


def judged(light: EdgeLight, cells: PatchCells) -> PatchCells:
    """The same cells with what they are predicted to get wrong."""
    order = np.argsort(cells.owner, kind="stable")
    owner = cells.owner[order]
    found = []
    for first in range(0, len(cells.held), CELLS):
        some = slice(first, first + CELLS)
        mine = slice(*np.searchsorted(owner, (first, first + CELLS)))
        discs = cells.held[some], cells.to_light[some], cells.shortfall[some]
        found.append(_wrong(light, order[mine], owner[mine] - first, *discs))
    wrong, on_ground = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return replace(cells, wrong=wrong, on_ground=on_ground)


def squared_errors(light: EdgeLight, members: Owner, owner: Owner, count: int) -> Floats:
    """Mean over all great circles of what each cell's disc lets through too much or too
    little, squared, and of what level ground gets, as parts of all light: (n, JUDGED).

    members: patches, (m,), with the cell of each, rising from 0: every cell has one.
    """
    held = sums_of(owner, light.held.take(members, axis=0), count)
    return _wrong(light, members, owner, held, *light.moments(held, members, owner))[0]


def widths(light: EdgeLight, members: Owner, owner: Owner, count: int) -> Floats:
    """About what `squared_errors` says, at a fifth of the time; see `widths_of`."""
    return widths_of(light, sums_of(owner, light.held.take(members, axis=0), count))


def widths_of(light: EdgeLight, held: Floats) -> Floats:
    """Light of cells squared, times how wide it is, (n, JUDGED). held: of each, (n, HELD)."""
    return held[:, TOTAL] ** 2 * np.sqrt(light.shortfalls(held))[:, None]


def _wrong(
    light: EdgeLight,
    members: Owner,
    owner: Owner,
    held: Floats,
    to_light: Floats,
    shortfall: Floats,
) -> tuple[Floats, Floats]:
    """See `squared_errors`, and `PatchCells` for what cells hold and where their discs are."""
    half = np.zeros(len(held))
    if light.shape == "disc":
        half = disc_diameter(shortfall) / 2
    parts = light.judged.take(members, axis=0)
    directions = light.directions.take(members, axis=0)
    half_width = light.half_width.take(members)
    edges = edges_across(directions, half_width, parts, owner, to_light, TURNS, PLACES)
    of_disc = cap_beyond(edges.height, half[:, None])
    wrong = edges.beyond - held[:, None, TOTAL] * of_disc[..., None]
    squared = np.einsum("ne,nek->nk", edges.part, wrong**2)
    if light.fades:
        squared += HIDDEN * (held[:, TOTAL] * (1 - part_shadowed(2 * half))[:, None]) ** 2
    seen = held[:, TOTAL] * disc_on_ground(to_light[:, 2], half)[:, None]
    on_ground = seen - held[:, SEEN]
    return squared + GROUND * on_ground**2, on_ground


def error_of(squared: Floats) -> float:
    """Of the channel that is most wrong, from squared errors of each, (JUDGED,)."""
    return float(np.sqrt(squared.max()))
