"""Synthetic maps whose light is known in closed form."""

from __future__ import annotations

import numpy as np

from sunsplit.core import sphere
from sunsplit.core.environment import EnvironmentMap, environment_from_pixels


def direction(azimuth: float, elevation: float) -> np.ndarray:
    """Unit vector of angles in degrees."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def paint_disc(
    pixels: np.ndarray, to_light: np.ndarray, radius: float, radiance: object, fine: int = 6
) -> None:
    """Add a disc of this angular radius (degrees); pixels on its rim count by their covered part.

    The samples of a pixel are weighted by their solid angle and shifted from column to column, so
    that a rim along a row of pixels, as around a pole, is not rounded to the same step in all.
    """
    height, width = pixels.shape[:2]
    covered, whole = np.zeros((height, width)), np.zeros((height, width))
    limit = np.cos(np.radians(radius))
    shift = np.arange(width) * 0.6180339887
    for down in range(fine):
        v = (np.arange(height)[:, None] + (down + shift % 1) / fine) / height
        weight = np.sin(np.pi * v)
        for right in range(fine):
            u = (np.arange(width) + (right + 0.5) / fine) / width
            covered += weight * (sphere.to_directions(u[None, :], v) @ to_light >= limit)
            whole += weight
    pixels += (covered / whole)[..., None] * np.asarray(radiance, dtype=float)


def painted_radius(radius: float, width: int, to_light: np.ndarray) -> float:
    """Radius in degrees of the disc that a painted disc's second moment belongs to.

    Painting averages over a pixel, and each pixel is as large as it is: both add s^2 / 12 along
    either axis to the disc's a^2 / 4. At the poles a pixel has no width to speak of.
    """
    axes = 1 if abs(to_light[2]) > 0.99 else 2
    return float(np.hypot(radius, np.sqrt(axes / 3) * 360 / width))


def sky(width: int = 256, value: object = 0.3) -> np.ndarray:
    """A constant map, float64 (width / 2, width, 3)."""
    return np.broadcast_to(np.asarray(value, dtype=float), (width // 2, width, 3)).copy()


def environment(pixels: np.ndarray, name: str = "synthetic") -> EnvironmentMap:
    return environment_from_pixels(pixels, name)


def disc_energy(radius: float, radiance: float) -> float:
    """Scalar irradiance of a disc of this angular radius in degrees."""
    return 4 * np.pi * np.sin(np.radians(radius) / 2) ** 2 * radiance
