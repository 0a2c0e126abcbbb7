"""Cells that share out their borders among each other, until each patch is where it is best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .edge_cells import PatchCells, cells_of, judged
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
class Trial:
    """Cells that borders are shared out among. together: see TOGETHER."""

    light: EdgeLight
    cells: PatchCells
    together: float = TOGETHER


def balanced(trials: Sequence[Trial], steps: int) -> list[Trial]:
    """The same trials, one at least, after so many steps, or when nothing moves any more; judged.

    All of the same patches, with parts of their own: worked on side by side they take less time.
    """
    light = EdgeLight.joined([one.light for one in trials])
    before = np.cumsum([0] + [len(one.cells.held) for one in trials])
    owner = np.concatenate([one.cells.owner + n for one, n in zip(trials, before, strict=False)])
    trial = np.repeat(np.arange(len(trials)), np.diff(before))
    together = np.array([one.together for one in trials])
    cells, features = cells_of(light, owner), _features(light) if steps else None
    for _ in range(steps):
        owner = _shared_out(light, features, cells, trial, together)
        if np.array_equal(owner, cells.owner):
            break
        trial = trial[np.bincount(owner, minlength=len(trial)) > 0]
        cells = cells_of(light, owner)
    cells = judged(light, cells)
    ends = np.searchsorted(trial, np.arange(len(trials) + 1))
    return [
        replace(one, cells=_part(cells, slice(*ends[n : n + 2]), n, len(trials)))
        for n, one in enumerate(trials)
    ]


def _part(cells: PatchCells, some: slice, trial: int, trials: int) -> PatchCells:
    """The cells of one of the trials."""
    patches = len(cells.owner) // trials
    owner = cells.owner[trial * patches : (trial + 1) * patches] - some.start
    arrays = (cells.held, cells.to_light, cells.shortfall, cells.wrong, cells.on_ground)
    return PatchCells(owner, *(array[some] for array in arrays))


def _shared_out(
    light: EdgeLight, features: Floats, cells: PatchCells, trial: Owner, together: Floats
) -> Owner:
    """For each patch the cell of its trial that is best to have it: a new owner, (p,).

    Near, in a measure of each cell's own: bright and narrow cells take little from around
    them. And where it brings the colours of a cell back together: see TOGETHER. trial: of each
    cell, rising, (n,). together: of each trial.
    """
    whole = cells.held[:, RELATIVE] @ SEEN_BY / SEEN_BY.sum()
    of_cells = _of_cells(cells, whole, together[trial])
    ends = np.searchsorted(trial, np.arange(len(together) + 1))
    owner = np.empty(len(light), np.intp)
    patches = len(light) // len(together)
    for n in range(len(together)):
        some = slice(n * patches, (n + 1) * patches)
        mine = slice(*ends[n : n + 2])
        owner[some] = _nearest(features[some], of_cells[:, mine]) + mine.start
    stays = light.light > HEAVY * whole[cells.owner]
    owner[stays] = cells.owner[stays]
    return owner


def _features(light: EdgeLight) -> Floats:
    """What distances of patches are linear in, (p, 10): direction, 1, and mean direction times red
    and times blue against all of the patch's light."""
    whole = np.maximum(light.light, 1e-300)[:, None]
    parts = [light.directions, np.ones_like(whole)]
    vectors = light.held[:, VECTORS]
    parts += [vectors[:, 3 * c : 3 * c + 3] / whole for c in PULLED]
    return np.concatenate(parts, axis=1)


def _of_cells(cells: PatchCells, whole: Floats, together: Floats) -> Floats:
    """What each of the `_features` counts for the distance to each cell, (10, n).

    whole: light of each cell, (n,). together: see TOGETHER, (n,).
    """
    scale = np.sqrt(whole / (2 * np.maximum(cells.shortfall, 1e-9)))
    # The squared chord, 2 - 2 cos, and how far a channel's mean lies aside of the cell's: both
    # linear in a patch's direction, so that one product of matrices holds them all.
    of_cells = [-2 * cells.to_light * scale[:, None], 2 * scale[:, None]]
    for channel in PULLED:
        vector = cells.held[:, VECTORS][:, 3 * channel : 3 * channel + 3]
        aside = vector - (vector * cells.to_light).sum(axis=1)[:, None] * cells.to_light
        aside *= (together * scale / np.maximum(whole, 1e-300))[:, None]
        of_cells.append(aside)
    return np.concatenate(of_cells, axis=1).T


def _nearest(features: Floats, of_cells: Floats) -> Owner:
    """The cell, of (10, n), to which the distance of each patch, (p, 10), is the least: (p,)."""
    count, patches = of_cells.shape[1], len(features)
    owner = np.empty(patches, np.intp)
    # Two patches at least, as one alone is another kind of product, with limits of its own.
    at_once = min(max(DISTANCES // count, 2), patches)
    distances = np.empty((at_once, count))
    for start in range(0, patches, at_once):
        some = slice(min(start, patches - at_once), start + at_once)
        np.matmul(features[some], of_cells, out=distances)
        np.argmin(distances, axis=1, out=owner[some])
    return owner
