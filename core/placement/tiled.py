"""Penrose importance sampling of a map's light: the paper's method (2.1)."""

from __future__ import annotations

from .. import sphere
from ..region import RegionLight
from .penrose import penrose_points
from .placement import Placement


def penrose(light: RegionLight, count: int) -> Placement:
    """Samples as dense on the map as its light, pixels weighted by their area on the sphere."""
    x, y = penrose_points(light.plane(), count).T
    return Placement(sphere.to_directions(x / light.width, y / light.height), light)
