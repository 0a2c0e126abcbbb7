"""How wrong shadows are if suns stand in for light: predicted, without rendering.

Surfaces that face anywhere look at walls and cones in front of the sky; most of those are aimed at
the light that suns replace. The difference of their irradiance, with the light and with the suns,
is what a picture would be wrong by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS
from .patches import Patches
from .shadow_edges import half_widths
from .suns import Sun

Floats = NDArray[np.float64]

SURFACES = 512
"""Surfaces that look. The root of a mean of so many squares is good to about a tenth."""

AIMED = 0.7
"""Part of the occluders whose edge passes near light, in proportion to the light."""

CONES = np.radians([3, 50])
"""Narrowest and widest angular radius of a cone."""

NEAR = np.radians(10)
"""A wall's edge passes at most so far from what it is aimed at."""

PIECES = 16_384
"""Points that stand for all discs together; each disc gets 64 to 2,048."""

SHARP = 1e-7
"""Half the width of a point, radians."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Surfaces and what stands in front of each.

    normals: unit vectors, (s, 3). axes: of the cones that hide the sky, (s, 3); a wall is a cone
    of 90 degrees. radii: of the cones, radians, (s,).
    """

    normals: Floats
    axes: Floats
    radii: Floats

    def irradiance(self, directions: Floats, flux: Floats, half_width: Floats) -> Floats:
        """Of each surface, (s,), from pieces of light: directions (n, 3), luminous scalar
        irradiance (n,), half their width in radians (n,)."""
        seen = np.cos(self.radii) - directions @ self.axes.T
        # How far outside of the cone, in widths of the piece: at most half of one decides.
        seen /= np.sin(self.radii)
        seen /= 2 * half_width[:, None]
        seen += 0.5
        np.clip(seen, 0, 1, out=seen)
        seen *= np.maximum(directions @ self.normals.T, 0)
        return flux @ seen


def surfaces_for(patches: Patches, share: float) -> Surfaces:
    """SURFACES surfaces, half of them behind walls and half behind cones.

    share: the part of all light that the patches hold; the rest is right whatever stands in front
    of it, so that fewer of the occluders matter.
    """
    random = np.random.default_rng(0)
    target = _unit(random.normal(size=(SURFACES, 3)))
    aimed = round(AIMED * share * SURFACES)
    if aimed:
        light = np.cumsum(patches.flux @ LUMINANCE_WEIGHTS)
        at = (np.arange(aimed) + 0.5) / aimed * light[-1]
        target[:aimed] = patches.directions[np.minimum(np.searchsorted(light, at), len(light) - 1)]
    order = random.permutation(SURFACES)  # so that walls and cones are aimed alike
    target = target[order]
    walls = np.arange(SURFACES) % 2 == 0
    radii = np.where(walls, np.pi / 2, random.uniform(*CONES, SURFACES))
    near = np.pi / 2 + random.uniform(-NEAR, NEAR, SURFACES)
    within = 1.5 * radii * np.sqrt(random.random(SURFACES))
    axes = _around(target, np.where(walls, near, within), random.uniform(0, 2 * np.pi, SURFACES))
    return Surfaces(_unit(random.normal(size=(SURFACES, 3))), axes, radii)


@dataclass(frozen=True, eq=False)
class Prediction:
    """What surfaces get from light, to compare suns with.

    irradiance: of each surface, luminance, (s,). mean: what surfaces get in the open from the
    whole map, on average over all that they may face.
    """

    surfaces: Surfaces
    irradiance: Floats
    mean: float

    @classmethod
    def of(cls, patches: Patches, all_light: float) -> Prediction:
        """patches: the light that suns shall replace, one at least. all_light: luminance of the
        whole map's scalar irradiance."""
        flux = patches.flux @ LUMINANCE_WEIGHTS
        surfaces = surfaces_for(patches, min(float(flux.sum()) / all_light, 1.0))
        given = surfaces.irradiance(patches.directions, flux, half_widths(patches.spread))
        return cls(surfaces, given, all_light / 4)

    def error(self, suns: Sequence[Sun]) -> float:
        """Root mean square of what surfaces get wrong under shadows if these suns stand in for
        the light, as a part of the mean irradiance in the open."""
        given = self.surfaces.irradiance(*_pieces(suns))
        return float(np.sqrt(np.mean((given - self.irradiance) ** 2))) / self.mean


def _pieces(suns: Sequence[Sun]) -> tuple[Floats, Floats, Floats]:
    """Each sun, one at least, as points in a spiral over its disc: directions, luminous light and
    half widths."""
    count = int(np.clip(PIECES // max(len(suns), 1), 64, 2048))
    found = []
    for sun in suns:
        light = float(sun.scalar_irradiance @ LUMINANCE_WEIGHTS)
        if sun.angular_diameter == 0:
            found.append((sun.to_light[None], np.array([light]), np.array([SHARP])))
            continue
        part = (np.arange(count) + 0.5) / count
        turn = np.arange(count) * (np.pi * (3 - np.sqrt(5)))
        cap = 2 * np.sin(sun.angular_diameter / 4) ** 2  # 1 - cos of the half-angle
        along = 1 - part * cap
        aside = np.sqrt(1 - along**2)
        first, second = sphere.tangents(sun.to_light)
        directions = (
            along[:, None] * sun.to_light
            + (aside * np.cos(turn))[:, None] * first
            + (aside * np.sin(turn))[:, None] * second
        )
        half = np.sqrt(2 * np.pi * cap / count) / 2
        found.append((directions, np.full(count, light / count), np.full(count, half)))
    directions, light, half = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(light), np.concatenate(half)


def _around(targets: Floats, angles: Floats, turns: Floats) -> Floats:
    """Directions at these angles from others, (s, 3), turned about them."""
    helper = np.where(np.abs(targets[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
    first = _unit(np.cross(targets, helper))
    second = np.cross(targets, first)
    aside = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    return np.cos(angles)[:, None] * targets + np.sin(angles)[:, None] * aside


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
