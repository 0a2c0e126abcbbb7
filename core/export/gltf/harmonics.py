"""Irradiance as nine spherical harmonics (Ramamoorthi and Hanrahan 2001)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ... import sphere

Floats = NDArray[np.float64]

_COSINE_LOBE = np.array([np.pi, *[2 * np.pi / 3] * 3, *[np.pi / 4] * 5])
"""By how much irradiance has of each harmonic what radiance has."""


def harmonics(directions: Floats) -> Floats:
    """The nine real harmonics of degree 0 to 2 with the sign of Condon and Shortley, by degree and
    then by order from below, of unit vectors (..., 3): (..., 9)."""
    x, y, z = np.moveaxis(directions, -1, 0)
    first, second = np.sqrt(3 / (4 * np.pi)), np.sqrt(15 / (4 * np.pi))
    return np.stack(
        [
            np.full_like(x, np.sqrt(1 / (4 * np.pi))),
            -first * y,
            first * z,
            -first * x,
            second * x * y,
            -second * y * z,
            np.sqrt(5 / (16 * np.pi)) * (3 * z * z - 1),
            -second * x * z,
            second / 2 * (x * x - y * y),
        ],
        axis=-1,
    )


def irradiance_harmonics(radiance: NDArray[np.floating], rotation: Floats) -> Floats:
    """How much irradiance has of each, (9, 3). rotation: from the map's directions to those that
    the harmonics are of, (3, 3), a mirrored one too."""
    height, width = radiance.shape[:2]
    directions = sphere.pixel_directions(np.arange(height * width), width, height)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    solid = np.repeat(sphere.row_solid_angles(width, height), width)
    light = radiance.reshape(-1, 3) * solid[:, None]
    return _COSINE_LOBE[:, None] * (harmonics(directions @ rotation.T).T @ light)
