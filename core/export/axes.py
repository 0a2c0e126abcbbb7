"""The axes of renderers, and how the map's layout lies in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .settings import Up

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Axes:
    """name: in words. matrix: (3, 3), from Sunsplit's axes (right-handed, Z up) to these."""

    name: str
    matrix: Floats

    def of(self, directions: Floats) -> Floats:
        """Vectors (..., 3) of Sunsplit's axes in these."""
        return directions @ self.matrix.T

    def rotation_of_map(self, turn: Floats, layout: Floats) -> Floats:
        """What a renderer must turn a map by, (3, 3) in its own axes. turn: from directions in the
        map to the scene. layout: where the renderer, without being told anything, puts a map's
        directions, (3, 3)."""
        return self.matrix @ turn @ layout.T


Z_UP = Axes("right-handed, Z up", np.eye(3))

Y_UP = Axes("right-handed, Y up", np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
"""(x, z, -y), as Blender's own exporters write it."""

Y_UP_LEFT = Axes("left-handed, Y up", np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]]))
"""(x, z, y)."""


def chosen_axes(up: Up, usual: Axes, y_up: Axes = Y_UP) -> Axes:
    """usual: of a format's users. y_up: what they mean by Y up."""
    return {"usual": usual, "y": y_up, "z": Z_UP}[up]
