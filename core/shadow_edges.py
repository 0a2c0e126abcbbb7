"""Straight shadow edges across light: how much of it each lets through.

The edge of a wall is a great circle for whoever looks at the sky. A half space with normal h lets
through what has h . w > 0; of a uniform cap it lets through a part that is known in closed form.
"""

from __future__ import annotations

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


def let_through(directions: Floats, half_width: Floats, normals: Floats) -> Floats:
    """Part of each piece of light on the side of each edge, (n, m), 0 to 1.

    A piece that an edge crosses lets through as much as a strip of its width: as a point it would
    be hidden or not, and a sun of one pixel could not be told from a point.
    """
    part = directions @ normals.T
    part /= 2 * half_width[:, None]
    part += 0.5
    return np.clip(part, 0, 1, out=part)


def facing_up(directions: Floats, half_width: Floats) -> Floats:
    """What level ground gets of each piece of light, (n,): the cosine, 0 below the horizon; of a
    piece that the horizon crosses as much as of a strip of its width."""
    height = directions[:, 2]
    above = np.clip(height + half_width, 0, 2 * half_width)
    crossed = above**2 / (4 * np.maximum(half_width, 1e-300))
    return np.where(height >= half_width, height, crossed)


FINE = 512
"""Steps in which the light across a cell is looked at to place edges."""


def edges_across(
    directions: Floats, weight: Floats, centre: Floats, turns: int, places: int
) -> tuple[Floats, Floats]:
    """Edges that cross some light, and what part of all great circles each stands for.

    directions: (n, 3), weight: (n,). Edges at `turns` angles and `places` positions each, half of
    them spread evenly from one end of the light to the other, half where the light is. Returns
    normals (turns * places, 3) and weights; edges that miss the light are in neither.
    """
    turn = np.arange(turns) * (np.pi / turns)
    first, second = sphere.tangents(centre)
    across = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    forward = directions @ centre
    angle = np.arctan((across @ directions.T) / np.where(forward == 0, 1e-300, forward))
    low, high = angle.min(axis=1), angle.max(axis=1)
    # So that an edge on either side lets all through, or nothing.
    margin = 0.03 * (high - low) + 0.004
    low, high = np.maximum(low - margin, -np.pi / 2), np.minimum(high + margin, np.pi / 2)
    step = (high - low) / FINE
    place = ((angle - low[:, None]) / step[:, None]).astype(np.intp)
    np.minimum(place, FINE - 1, out=place)
    place += (FINE * np.arange(turns))[:, None]
    light = np.bincount(place.ravel(), np.tile(weight, turns), FINE * turns).reshape(turns, FINE)
    dense = np.zeros((turns, FINE + 1))
    np.cumsum(0.5 / FINE + light * (0.5 / weight.sum()), axis=1, out=dense[:, 1:])
    wanted, steps = np.arange(places + 1) / places, np.arange(FINE + 1)
    ends = np.stack([np.interp(wanted, one, steps) for one in dense])
    ends = low[:, None] + step[:, None] * ends
    middle = (ends[:, 1:] + ends[:, :-1]) / 2
    cosine = np.cos(middle)
    normals = cosine[..., None] * across[:, None] - np.sin(middle)[..., None] * centre
    weights = cosine * (ends[:, 1:] - ends[:, :-1]) / (2 * turns)
    return normals.reshape(-1, 3), weights.ravel()
