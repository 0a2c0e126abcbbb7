"""White plates that face all ways, and what they get by a map in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sunsplit.core import load, sphere

ORIENTATIONS = {
    "up": (0, 0, 1),
    "down": (0, 0, -1),
    "east": (1, 0, 0),
    "north": (0, 1, 0),
    "west": (-1, 0, 0),
    "south": (0, -1, 0),
    "tilted": (1, 1, 1),
    "tilted away": (-1, 1, -1),
}
"""Normals, of any length."""

ALBEDO = 0.8


def irradiance(path: Path, normal: np.ndarray) -> np.ndarray:
    """Irradiance of a plate in closed form: the map integrated in float64, (3,)."""
    return irradiance_by(load(path).radiance, normal)


def irradiance_by(radiance: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The same of a map's pixels, (height, width, 3). normal: a unit vector."""
    height, width = radiance.shape[:2]
    v, u = (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width
    cosine = np.maximum(sphere.to_directions(u[None, :], v[:, None]) @ normal, 0)
    weight = cosine * sphere.row_solid_angles(width, height)[:, None]
    return np.einsum("ijk,ij->k", radiance, weight, dtype=np.float64)


def unit(vector: tuple[float, ...]) -> np.ndarray:
    return np.array(vector, np.float64) / np.linalg.norm(vector)
