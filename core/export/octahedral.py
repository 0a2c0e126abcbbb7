"""The equal-area octahedral layout of pbrt-v4's maps (Clarberg 2008, "Fast Equal-Area Mapping of
the (Hemi)Sphere using SIMD"): a square whose pixels have all the same solid angle."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ..cores import usable
from ..environment import scalar_irradiance
from .lookup import kept, look_up

Floats = NDArray[np.float64]

WIDEST = 4096
"""Pixels of the side of the largest map that is made: 50 million looked up four times."""

LEAST = 64
"""Of the smallest: pbrt does not blend between pixels."""

AT_ONCE = 1 << 17
"""Directions that are looked up at a time, about."""


def to_sphere(s: Floats, t: Floats) -> Floats:
    """Unit vectors, (..., 3), of places in the square, 0 to 1 each, t downwards in a file."""
    s, t = np.broadcast_arrays(2 * np.asarray(s, np.float64) - 1, 2 * np.asarray(t, np.float64) - 1)
    across, down = np.abs(s), np.abs(t)
    from_edge = 1 - (across + down)
    radius = 1 - np.abs(from_edge)
    safe = np.where(radius > 0, radius, 1)
    turn = np.where(radius > 0, (down - across) / safe + 1, 1) * np.pi / 4
    z = np.copysign(1 - radius**2, from_edge)
    ring = radius * np.sqrt(2 - radius**2)
    x, y = np.copysign(np.cos(turn), s) * ring, np.copysign(np.sin(turn), t) * ring
    return np.stack([x, y, z], axis=-1)


def from_sphere(directions: Floats) -> tuple[Floats, Floats]:
    """Places (s, t) in the square of unit vectors, (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    # 1 - |z| as a product, which loses no digits near the middle of the square.
    radius = np.hypot(x, y) / np.sqrt(1 + np.abs(z))
    part = np.arctan2(np.abs(y), np.abs(x)) * (2 / np.pi)
    across, down = radius * (1 - part), radius * part
    across, down = np.where(z < 0, 1 - down, across), np.where(z < 0, 1 - across, down)
    return (np.copysign(across, x) + 1) / 2, (np.copysign(down, y) + 1) / 2


def octahedral(radiance: NDArray[np.float32], has_cells: bool) -> NDArray[np.float32]:
    """A map in that layout, float32 (side, side, 3), with the light of each channel as it was.

    radiance: (height, width, 3) in the layout of `sphere`. The side is the map's width, so a pixel
    is a third of one on the horizon; each is the mean of places spread evenly over it.
    """
    width = radiance.shape[1]
    side = min(max(width, LEAST), WIDEST)
    parts = max(2, -(-width // side))  # a third of one of the map's pixels each, at most
    places = (np.arange(side * parts) + 0.5) / (side * parts)
    out = np.empty((side, side, 3))

    def fill(rows: slice) -> None:
        some = places[rows.start * parts : rows.stop * parts]
        directions = to_sphere(places[None, :], some[:, None]).reshape(-1, 3)
        light = look_up(radiance, directions, has_cells)
        out[rows] = light.reshape(-1, parts, side, parts, 3).mean(axis=(1, 3))

    step = max(AT_ONCE // (side * parts**2), 1)
    with ThreadPoolExecutor(usable()) as pool:
        list(pool.map(fill, (slice(k, min(k + step, side)) for k in range(0, side, step))))
    return (out * kept(light_of_octahedral(out), scalar_irradiance(radiance))).astype(np.float32)


def light_of_octahedral(radiance: NDArray[np.floating]) -> Floats:
    """Integral over the sphere of a map in that layout, (3,)."""
    return radiance.mean(axis=(0, 1), dtype=np.float64) * 4 * np.pi
