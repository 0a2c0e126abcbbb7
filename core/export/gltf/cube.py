"""Cube maps in the layout of OpenGL: six faces, +X, -X, +Y, -Y, +Z, -Z, rows downwards."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_ACROSS = np.array([[0, 0, -1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [1, 0, 0], [-1, 0, 0]])
_DOWN = np.array([[0, -1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, -1, 0], [0, -1, 0]])
_MIDDLE = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
"""Of each face (OpenGL 4.6, table 8.19)."""


def cube_directions(side: int) -> Floats:
    """Towards the middles of all pixels, of lengths 1 to sqrt(3), (6, side, side, 3)."""
    place = (np.arange(side) + 0.5) * (2 / side) - 1
    across = place[None, None, :, None] * _ACROSS[:, None, None, :]
    down = place[None, :, None, None] * _DOWN[:, None, None, :]
    return _MIDDLE[:, None, None, :] + across + down


def averaged(faces: NDArray[np.floating], step: int) -> Floats:
    """Faces, (6, side, side, n), with each step x step pixels as one."""
    count, side = len(faces), faces.shape[1] // step
    return faces.reshape(count, side, step, side, step, -1).mean(axis=(2, 4))
