"""Irradiance of surfaces under occluders: what lights must get right, without rendering.

A set-up is a surface that faces anywhere and occluders at infinity: a half space (a wall), a cone
(3 to 50 degrees) or a group of small cones (leaves). Seven of ten are aimed at light: a direction
is drawn in proportion to the map's light, and the occluder's edge passes near it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sunsplit.core import EnvironmentMap, sphere
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.suns import Sun

Floats = NDArray[np.float64]
OfCosine = Callable[[Floats, slice], Floats]

AIMED = 0.7
"""Part of the set-ups whose occluder is aimed at light."""

NEVER = 2.0
"""The cosine of a cone that hides nothing."""

AT_ONCE = 256
"""Directions that are looked at together: what fits into a processor's own memory, where the same
sums take less than half of the time."""

FINE_FLUX = ((1e-2, 64), (1e-3, 32), (1e-4, 16), (1e-5, 4))
"""A pixel with more than this part of all light counts as so many pieces along either side: as
one point it would be hidden or not, and as 16 by 16 an edge along a row would still hide a
sixteenth at once, which is an error of the judge and not of the lights."""

POINTS = 1 << 16
"""Directions that stand for all discs together, in proportion to their light; each gets 128 at
least and 16,384 at most."""


@dataclass(frozen=True, eq=False)
class Occluders:
    """Surfaces and what stands in front of them.

    normals: unit vectors (s, 3). axes: of each surface's cones, (s, k, 3). cosines: of their
    radii, (s, k). A half space is a cone of 90 degrees.
    """

    normals: Floats
    axes: Floats
    cosines: Floats

    def without_occluders(self) -> Occluders:
        """The same surfaces in the open."""
        return Occluders(self.normals, self.axes, np.full_like(self.cosines, NEVER))

    def irradiance(
        self, directions: Floats, flux: Floats, of_cosine: OfCosine | None = None
    ) -> Floats:
        """Of each surface, (s, c), from lights of no width: directions (n, 3), flux (n, c).

        of_cosine: what counts instead of the cosine, given the cosines (m, s) of some lights, and
        which of all they are.
        """
        total = np.zeros((len(self.normals), flux.shape[1]))
        cones = (self.cosines < NEVER).sum(axis=1)  # the first ones of each
        for some in (cones == 0, cones == 1, cones > 1):
            normals = self.normals[some].T
            for start in range(0, len(directions), AT_ONCE):
                part = directions[start : start + AT_ONCE]
                facing = part @ normals
                np.maximum(facing, 0, out=facing)
                for cone in range(cones[some].max(initial=0)):
                    facing *= part @ self.axes[some, cone].T <= self.cosines[some, cone]
                if of_cosine:
                    facing = of_cosine(facing, slice(start, start + len(part)))
                total[some] += facing.T @ flux[start : start + AT_ONCE]
        return total


def draw_occluders(environment: EnvironmentMap, count: int, seed: int) -> Occluders:
    """`count` set-ups for a map, a third of each kind."""
    random = np.random.default_rng(seed)
    height, width = environment.radiance.shape[:2]
    light = environment.radiance @ LUMINANCE_WEIGHTS
    light = (light * sphere.row_solid_angles(width, height)[:, None]).ravel()
    chosen = random.choice(len(light), count, p=light / light.sum())
    u = (chosen % width + random.random(count)) / width
    v = (chosen // width + random.random(count)) / height
    target = sphere.to_directions(u, v)
    anywhere = random.random(count) >= AIMED
    target[anywhere] = _unit(random.normal(size=(anywhere.sum(), 3)))
    most = 12
    axes, cosines = np.zeros((count, most, 3)), np.full((count, most), NEVER)
    for i in range(count):
        if i % 3 == 0:  # a wall whose edge passes within 10 degrees
            axes[i, 0] = _around(target[i], np.pi / 2 + np.radians(random.uniform(-10, 10)), random)
            cosines[i, 0] = 0
        elif i % 3 == 1:  # a cone that mostly hides the target
            radius = np.radians(random.uniform(3, 50))
            away = 1.5 * radius * np.sqrt(random.random())
            axes[i, 0] = _around(target[i], away, random)
            cosines[i, 0] = np.cos(radius)
        else:  # leaves about it
            leaves = random.integers(4, most + 1)
            for k in range(leaves):
                away = np.radians(25) * np.sqrt(random.random())
                axes[i, k] = _around(target[i], away, random)
                cosines[i, k] = np.cos(np.radians(random.uniform(2, 8)))
    return Occluders(_unit(random.normal(size=(count, 3))), axes, cosines)


def light_of(environment: EnvironmentMap) -> tuple[Floats, Floats]:
    """The whole map as directions (n, 3) and scalar irradiances (n, 3), float64; bright pixels
    in pieces."""
    height, width = environment.radiance.shape[:2]
    solid = np.repeat(sphere.row_solid_angles(width, height), width)
    flux = environment.radiance.reshape(-1, 3) * solid[:, None]
    bright = flux @ LUMINANCE_WEIGHTS
    pieces = np.ones(len(flux), np.intp)
    for part, fine in reversed(FINE_FLUX):
        pieces[bright > part * bright.sum()] = fine
    directions, light = [], []
    for fine in np.unique(pieces):
        pixels = np.flatnonzero((pieces == fine) & (flux.max(axis=1) > 0))
        rows, columns = np.divmod(pixels, width)
        for down in range(fine):
            row = rows * fine + down
            part = sphere.row_solid_angles(width * fine, height * fine)[row] / solid[pixels]
            for right in range(fine):
                column = columns * fine + right
                directions.append(
                    sphere.pixel_directions(
                        row * (width * fine) + column, width * fine, height * fine
                    )
                )
                light.append(flux[pixels] * part[:, None])
    return np.concatenate(directions), np.concatenate(light)


def light_of_suns(suns: tuple[Sun, ...]) -> tuple[Floats, Floats]:
    """Suns as directions (n, 3) and scalar irradiances (n, 3); a disc as many directions."""
    light = sum(sun.scalar_irradiance for sun in suns) @ LUMINANCE_WEIGHTS
    directions, flux = [], []
    for sun in suns:
        if sun.angular_diameter == 0:
            directions.append(sun.to_light[None])
            flux.append(sun.irradiance[None])
            continue
        part = float(sun.scalar_irradiance @ LUMINANCE_WEIGHTS / light)
        count = int(np.clip(POINTS * part, 128, 16_384))
        directions.append(disc(sun.to_light, sun.angular_diameter / 2, count))
        flux.append(np.repeat(sun.scalar_irradiance[None] / count, count, axis=0))
    return np.concatenate(directions), np.concatenate(flux)


def disc(to_light: Floats, half_angle: float, count: int) -> Floats:
    """Directions evenly over a disc, (count, 3); half_angle: radians."""
    index = np.arange(count) + 0.5
    turn = index * (np.pi * (3 - np.sqrt(5)))  # a sunflower
    first, second = sphere.tangents(to_light)
    along = 1 - index / count * 2 * np.sin(half_angle / 2) ** 2
    aside = np.sqrt(1 - along**2)
    return (
        along[:, None] * to_light
        + (aside * np.cos(turn))[:, None] * first
        + (aside * np.sin(turn))[:, None] * second
    )


def _around(direction: Floats, angle: float, random: np.random.Generator) -> Floats:
    """A direction at this angle from another, to any side."""
    first, second = sphere.tangents(direction)
    turn = random.uniform(0, 2 * np.pi)
    aside = np.cos(turn) * first + np.sin(turn) * second
    return np.cos(angle) * direction + np.sin(angle) * aside


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
