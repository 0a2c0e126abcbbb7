"""Straight shadow edges across light: how much of it each lets through.

The edge of a wall is a great circle for whoever looks at the sky. A half space with normal h lets
through what has h . w > 0; of a uniform cap it lets through a part that is known in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere

Floats = NDArray[np.float64]

FLAT = 0.05
"""Half-angle in radians up to which a cap is taken as a flat disc: wrong by a ten-thousandth of
its light, while the cap's own formula loses digits."""


def cap_beyond(height: Floats, half_angle: Floats | float) -> Floats:
    """Part of a uniform cap on one side of a great circle, 0 to 1.

    height: h . c of the side's normal and the cap's centre, unit vectors. half_angle: radians, up
    to a hemisphere; 0 is a point. Both broadcast.
    """
    half = np.maximum(half_angle, 1e-9)
    sine, cosine = np.sin(half), np.cos(half)
    u = np.clip(height / sine, -1, 1)
    flat = 0.5 + (u * np.sqrt(1 - u * u) + np.arcsin(u)) / np.pi
    if np.all(half < FLAT):
        return flat
    # Two spherical triangles (area of the cap's sector less that of the triangle in it).
    clipped = np.clip(height, -1 + 1e-12, 1 - 1e-12)
    v = np.clip(clipped * cosine / (sine * np.sqrt(1 - clipped * clipped)), -1, 1)
    round_ = 0.5 + (np.arcsin(u) - cosine * np.arcsin(v)) / (np.pi * np.maximum(1 - cosine, 1e-9))
    return np.where(half < FLAT, flat, round_)


def half_widths(spread: Floats) -> Floats:
    """Half the width of a uniform strip with the spread of a piece of light, chord lengths."""
    return np.sqrt(3 * spread)


def facing_up(directions: Floats, half_width: Floats) -> Floats:
    """What level ground gets of each piece of light, (n,): the cosine, 0 below the horizon; of a
    piece that the horizon crosses as much as of a strip of its width."""
    height = directions[:, 2]
    above = np.clip(height + half_width, 0, 2 * half_width)
    crossed = above**2 / (4 * np.maximum(half_width, 1e-300))
    return np.where(height >= half_width, height, crossed)


STEPS = 128
"""Steps across a cell in which light is summed to see how much lies beyond an edge."""


AT_ONCE = 1 << 14
"""Pieces of light times angles that are held in memory at a time: few enough for a processor's own
memory."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Edges that cross each of n cells of light, e of each.

    height: h . c of an edge's normal and the cell's centre, (n, e). part: of all great circles that
    each edge stands for; those that miss the cell are in none, (n, e). beyond: light that an edge
    lets through of each channel, (n, e, channels).
    """

    height: Floats
    part: Floats
    beyond: Floats


def edges_across(
    directions: Floats,
    half_width: Floats,
    light: Floats,
    owner: NDArray[np.intp],
    centres: Floats,
    turns: int,
    places: int,
) -> Crossings:
    """Edges at `turns` angles in `places` positions each, half of these spread evenly from one end
    of a cell to the other, half where its light is.

    directions: of pieces of light, (p, 3), sorted by their owner. half_width: of each in radians,
    (p,): an edge that crosses a piece lets through a part of it, as of a strip; as a point it would
    be hidden or not, and a sun of one pixel could not be told from a point. light: (p, channels).
    owner: the cell of each, rising from 0, each has one. centres: unit vectors, (n, 3).
    """
    cells = _Cells.of(directions, half_width, light, owner, centres)
    turn = np.arange(turns) * (np.pi / turns)
    at_once = max(AT_ONCE // len(owner), 1)
    found = [
        _turned_edges(cells, turn[start : start + at_once], places)
        for start in range(0, turns, at_once)
    ]
    height, part, beyond = (np.concatenate(arrays, axis=1) for arrays in zip(*found, strict=True))
    return Crossings(height, part / turns, beyond)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Pieces of light as their cells' centres see them.

    first, second, forward: where they are, along two axes across and one to the centre, (p,).
    signed: light of each channel, less than nothing behind the observer's back, and then all of it,
    (channels + 1, p). starts: of each cell, (n,). behind: light behind that back, (n, channels).
    """

    first: Floats
    second: Floats
    forward: Floats
    half_width: Floats
    signed: Floats
    owner: NDArray[np.intp]
    starts: NDArray[np.intp]
    behind: Floats

    @classmethod
    def of(
        cls,
        directions: Floats,
        half_width: Floats,
        light: Floats,
        owner: NDArray[np.intp],
        centres: Floats,
    ) -> _Cells:
        count = len(centres)
        axes = np.stack([*sphere.tangents(centres), centres], axis=-1).take(owner, axis=0)
        first, second, forward = np.einsum("pc,pca->ap", directions, axes)
        back = forward < 0
        signed = np.concatenate([light.T, light.sum(axis=1)[None]])
        behind = np.zeros((count, light.shape[1]))
        if back.any():
            for channel in range(light.shape[1]):
                behind[:, channel] = np.bincount(owner[back], light[back, channel], count)
            signed[:-1, back] *= -1
        starts = np.searchsorted(owner, np.arange(count))
        return cls(first, second, forward, half_width, signed, owner, starts, behind)


def _turned_edges(cells: _Cells, turn: Floats, places: int) -> tuple[Floats, Floats, Floats]:
    """Heights, parts and light beyond of edges at some angles, (n, e, ...); see `Crossings`."""
    owner, count, turns = cells.owner, len(cells.starts), len(turn)
    aside = np.cos(turn)[:, None] * cells.first
    aside += np.sin(turn)[:, None] * cells.second
    # Edges turn about an axis through the observer: half the angle's tangent is the place.
    reach = aside * aside
    reach += cells.forward**2
    np.sqrt(reach, out=reach)
    place, other = aside, reach + np.abs(cells.forward)
    place /= other
    back = cells.forward < 0
    if back.any():
        place[:, back] *= -1
    width = np.multiply(place, place, out=other)
    width += 1
    width *= cells.half_width
    np.maximum(reach, 1e-3, out=reach)
    reach *= 2
    width /= reach
    low = np.minimum.reduceat(np.subtract(place, width, out=reach), cells.starts, axis=1)
    high = np.maximum.reduceat(np.add(place, width, out=reach), cells.starts, axis=1)
    # So that an edge on either side lets all through, or nothing.
    margin = 0.03 * (high - low) + 0.002
    low, high = np.maximum(low - margin, -1), np.minimum(high + margin, 1)
    step = (high - low) / STEPS
    of_each = low.take(owner, axis=1)
    place -= of_each
    of_each = step.take(owner, axis=1)
    place /= of_each
    width /= of_each
    sums = _sums_before(place, width, cells.signed, owner, count)
    sums = sums.reshape(turns, count, STEPS + 1, -1)
    ends = _places(sums[..., -1], places)
    middle = (ends[..., 1:] + ends[..., :-1]) / 2
    # Behind the observer's back an edge lets through what lies before it.
    beyond = sums[..., -1:, :-1] - _between(sums[..., :-1], middle)
    beyond += cells.behind[:, None, :]
    ends = 2 * np.arctan(low[..., None] + step[..., None] * ends)
    angle = 2 * np.arctan(low[..., None] + step[..., None] * middle)
    part = np.cos(angle) * (ends[..., 1:] - ends[..., :-1]) / 2

    def by_cell(values: Floats) -> Floats:
        return np.moveaxis(values, 0, 1).reshape(count, turns * places, *values.shape[3:])

    return by_cell(-np.sin(angle)), by_cell(part), by_cell(beyond)


def _sums_before(
    place: Floats, width: Floats, light: Floats, owner: NDArray[np.intp], count: int
) -> Floats:
    """Light before each step, (turns * count, STEPS + 1, channels).

    place, width: of strips of light in steps, (turns, p): the middle and half of the width.
    light: (channels, p).
    """
    turns, channels = len(place), len(light)
    row = ((np.arange(turns) * count)[:, None] + owner) * (STEPS + 1)
    # To the nearest steps: strips are many, or much wider than one.
    low = np.clip(place - width + 0.5, 0, STEPS - 1).astype(np.intp)
    high = np.clip((place + width + 0.5).astype(np.intp), low + 1, STEPS)
    slope = 1 / (high - low)
    low += row
    high += row
    sums = np.empty((turns * count, STEPS + 1, channels))
    for channel in range(channels):
        # The sum's second difference: up where a strip begins, down where it ends.
        part = (slope * light[channel]).ravel()
        bent = np.bincount(low.ravel(), part, turns * count * (STEPS + 1))
        bent -= np.bincount(high.ravel(), part, len(bent))
        twice = bent.reshape(-1, STEPS + 1).cumsum(axis=1).cumsum(axis=1)
        sums[:, 0, channel] = 0
        sums[:, 1:, channel] = twice[:, :-1]
    return sums


def _places(sums: Floats, places: int) -> Floats:
    """Where positions of edges end, in steps: half of them even, half by light, (..., places + 1).

    sums: of light before each step, (..., STEPS + 1).
    """
    shape = sums.shape[:-1]
    whole = np.maximum(sums[..., -1:], 1e-300)
    dense = (0.5 * sums / whole + np.linspace(0, 0.5, STEPS + 1)).reshape(-1, STEPS + 1)
    dense[:, 0], dense[:, -1] = 0, 1
    row = 2.0 * np.arange(len(dense))[:, None]
    wanted = np.arange(places + 1) / places
    after = np.searchsorted((dense + row).ravel(), (wanted + row).ravel()).reshape(len(dense), -1)
    first = np.arange(len(dense))[:, None] * (STEPS + 1)
    after = np.clip(after - first, 1, STEPS)
    low, high = dense.take(after + first - 1), dense.take(after + first)
    return (after - 1 + (wanted - low) / (high - low)).reshape(*shape, places + 1)


def _between(sums: Floats, at: Floats) -> Floats:
    """Values at places between steps, (..., places, channels)."""
    step = np.minimum(at.astype(np.intp), STEPS - 1)
    within = (at - step)[..., None]
    low = np.take_along_axis(sums, step[..., None], axis=-2)
    high = np.take_along_axis(sums, step[..., None] + 1, axis=-2)
    return low + within * (high - low)
