"""What a renderer is given: suns as far as it has such lights, the rest of them in the map.

A disc that is no light of a format becomes many parallel lights, which cast its shadows in small
steps, or is painted into the map, which casts them as well as the renderer samples maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..suns import Sun
from .lookup import widened
from .settings import Discs
from .skylight import Skylight

Floats = NDArray[np.float64]

WIDE_SUN = np.radians(5.0)
"""Angular diameter from which a sun is painted: 14 pixels of a map 1,024 wide, and so many parallel
lights as stand for one would cast steps of half a degree, as wide as the real sun."""

CANVAS = 1024
"""Pixels of the width of a map, at least, that suns are painted into."""

RINGS = 4
"""Of parallel lights around the middle one: 61 in all, a ninth of the disc apart."""

SUBPIXELS = 8
"""Along each side of a pixel on a disc's rim, to say how much of it the disc covers."""


@dataclass(frozen=True, eq=False)
class Emitters:
    """discs: suns that the format has as they are, points among them. rays: parallel lights that
    stand for the others, all of one sun in a row. radiance: of the map, None where there is none.
    turn: see `Skylight`. painted: how many suns are in the map.
    """

    name: str
    discs: tuple[Sun, ...]
    rays: tuple[Rays, ...]
    radiance: NDArray[np.float32] | None
    has_cells: bool
    turn: Floats
    painted: int

    @property
    def losses(self) -> list[str]:
        """What these cannot show of the suns, in sentences."""
        lines = []
        if many := [rays for rays in self.rays if len(rays.to_light) > 1]:
            lines.append(
                f"{_suns(len(many))} parallel lights, {len(many[0].to_light)} each: shadows fade "
                "in so many steps, and mirrors do not show them."
            )
        if points := [rays for rays in self.rays if len(rays.to_light) == 1 and rays.width]:
            lines.append(f"{_suns(len(points))} lights of no width: their shadows are sharp.")
        if self.painted:
            lines.append(f"{_suns(self.painted)} in the map, and cannot be changed by themselves.")
        return lines


@dataclass(frozen=True, eq=False)
class Rays:
    """Parallel lights of one sun. to_light: unit vectors, (n, 3). irradiance: of each, on a surface
    that faces it, (3,). width: of the sun, radians."""

    to_light: Floats
    irradiance: Floats
    width: float


Narrow = Literal["discs", "many rays", "one ray"]
"""What a format makes of suns that are not painted: each as it is, many rays each, or one each."""


def emitters_of(sky: Skylight, narrow: Narrow, discs: Discs, widest: float = WIDE_SUN) -> Emitters:
    """Share the suns out. widest: angular diameter, radians, from which `discs` = "auto" paints."""
    if discs == "auto":
        kept = [sun for sun in sky.suns if sun.angular_diameter < widest or narrow == "discs"]
    else:
        kept = [sun for sun in sky.suns if discs == "lights" or not sun.angular_diameter]
    painted = [sun for sun in sky.suns if sun not in kept]
    radiance = sky.radiance
    if painted:
        radiance = with_suns(radiance, painted, sky.turn, sky.has_cells)
    return Emitters(
        sky.name,
        tuple(kept) if narrow == "discs" else (),
        () if narrow == "discs" else tuple(_rays_of(sun, narrow) for sun in kept),
        radiance,
        sky.has_cells and not painted,
        sky.turn,
        len(painted),
    )


def _rays_of(sun: Sun, narrow: Narrow) -> Rays:
    if narrow == "one ray" or not sun.angular_diameter:
        return Rays(sun.to_light[None], sun.irradiance, sun.angular_diameter)
    to_light = rays_of_disc(sun.to_light, sun.angular_diameter / 2)
    return Rays(to_light, sun.scalar_irradiance / len(to_light), sun.angular_diameter)


def rays_of_disc(to_light: Floats, half_angle: float) -> Floats:
    """Directions, (n, 3), each for an equal part of a disc's solid angle: one in the middle, then
    rings of 6, 12, ... with an offset between them. Their mean is that of the disc exactly.

    to_light: of the middle, (3,). half_angle: radians.
    """
    first, second = sphere.tangents(to_light)
    rings = np.arange(1, RINGS + 1)
    ring = np.concatenate([[0], np.repeat(rings, 6 * rings)])
    place = np.concatenate([[0.0], *((np.arange(6 * k) + k % 2 / 2) / (6 * k) for k in rings)])
    # By Archimedes a zone's area is its height: each point lies at half the height of its zone.
    before = np.where(ring > 0, 3 * ring * (ring - 1) + 1, 0)
    middle = np.where(ring > 0, before + 3 * ring, 0)
    # The first one lies in the middle instead, and the others a trifle further out for it.
    part = middle / middle.sum() / 2 * len(ring)
    versine = 2 * np.sin(half_angle / 2) ** 2 * part
    along, aside = (1 - versine)[:, None], np.sqrt(versine * (2 - versine))[:, None]
    turn = 2 * np.pi * place[:, None]
    return along * to_light + aside * (np.cos(turn) * first + np.sin(turn) * second)


def with_suns(
    radiance: NDArray[np.float32] | None, suns: Sequence[Sun], turn: Floats, has_cells: bool
) -> NDArray[np.float32]:
    """A map with discs in it, float32, at least CANVAS wide; black where there was no map.

    turn: from directions in the map to the scene, (3, 3). Each disc adds what it gives, exactly.
    """
    if radiance is None:
        canvas = np.zeros((CANVAS // 2, CANVAS, 3))
    else:
        canvas = widened(radiance, CANVAS, has_cells).astype(np.float64)
    height, width = canvas.shape[:2]
    solid = sphere.row_solid_angles(width, height)[:, None]
    for sun in suns:
        covered = covered_by(turn.T @ sun.to_light, sun.angular_diameter / 2, width, height)
        canvas += (covered / (covered * solid).sum())[..., None] * sun.scalar_irradiance
    return canvas.astype(np.float32)


def covered_by(centre: Floats, half_angle: float, width: int, height: int) -> Floats:
    """Which part of each pixel of a map a disc covers, (height, width)."""
    rows, columns = np.indices((height, width)).reshape(2, -1)
    middles = sphere.to_directions((columns + 0.5) / width, (rows + 0.5) / height)
    away = sphere.angle_between(middles, centre)
    covered = (away < half_angle).astype(np.float64)
    # A pixel reaches three quarters of its height from its centre at most; pixels are square there.
    rim = np.flatnonzero(np.abs(away - half_angle) < 0.75 * np.pi / height)
    steps = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS
    u = (columns[rim, None, None] + steps[:, None]) / width
    v = (rows[rim, None, None] + steps) / height
    inside = sphere.angle_between(sphere.to_directions(u, v), centre) < half_angle
    covered[rim] = inside.mean(axis=(1, 2))
    return covered.reshape(height, width)


def _suns(count: int) -> str:
    return "1 sun is" if count == 1 else f"{count} suns are"
