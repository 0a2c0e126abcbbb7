"""What walls that stand on level ground get: it hides all light from below the horizon.

Nearly every scene has such walls. Level ground itself hardly tells a light at the horizon, a wall
tells it best: a disc that reaches below the horizon in the place of light above it is too faint.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import sphere

Floats = NDArray[np.float64]

WALLS = 8
"""Evenly around."""

PIECES = 64
"""Points of a disc."""

_TURNS = np.arange(WALLS) * (2 * np.pi / WALLS)
NORMALS = np.stack([np.cos(_TURNS), np.sin(_TURNS), np.zeros(WALLS)], axis=-1)


def on_walls(directions: Floats, half_width: Floats) -> Floats:
    """What each wall gets of pieces of light, as a part of what a wall gets that faces one in the
    open: (n, WALLS).

    directions: unit vectors, (n, 3). half_width: of each in radians, (n,): the horizon cuts off a
    part of a piece.
    """
    above = np.clip(0.5 + directions[:, 2] / (2 * np.maximum(half_width, 1e-300)), 0, 1)
    return np.maximum(directions @ NORMALS.T, 0) * above[:, None]


def discs_on_walls(to_light: Floats, half_angle: Floats) -> Floats:
    """The same of uniform discs: their directions, (n, 3), and half their widths in radians, (n,).

    Each is a spiral of pieces.
    """
    cap = 2 * np.sin(half_angle / 2) ** 2  # 1 - cos
    places = sphere.spirals(to_light, cap, np.full(len(cap), PIECES))
    half = np.repeat(np.sqrt(2 * np.pi * cap / PIECES) / 2, PIECES)
    found = on_walls(places, half)
    return found.reshape(len(to_light), PIECES, WALLS).mean(axis=1)
