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
                f"Suns that are {len(many[0].to_light)} parallel lights each: {len(many)}. Their "
                "shadows fade in so many steps, and mirrors do not show them."
            )
        if points := [rays for rays in self.rays if len(rays.to_light) == 1 and rays.width]:
            lines.append(
                f"Suns that have lost their width: {len(points)}. Their shadows are sharp."
            )
        if self.painted:
            lines.append(f"Suns in the map: {self.painted}. They cannot be changed by themselves.")
        return lines


@dataclass(frozen=True, eq=False)
class Rays:
    """Parallel lights of one sun. to_light: unit vectors, (n, 3). irradiance: of each, on a surface
    that faces it, (3,). width: of the sun, radians."""

    to_light: Floats
    irradiance: Floats
    width: float


CELLS_BLENDED = "The edges of the Voronoi map's cells are blended over a pixel."
"""Where a renderer always blends between a map's pixels."""

Narrow = Literal["discs", "many rays", "one ray"]
"""What a format makes of suns that are not painted: each as it is, many rays each, or one each."""


def emitters_of(
    sky: Skylight, narrow: Narrow, discs: Discs, widest: float | None = None
) -> Emitters:
    """Share the suns out. widest: angular diameter, radians, from which `discs` = "auto" paints; by
    default no native disc, and WIDE_SUN of rays."""
    if widest is None:
        widest = np.inf if narrow == "discs" else WIDE_SUN
    if discs == "auto":
        kept = [sun for sun in sky.suns if sun.angular_diameter < widest]
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
        canvas = np.zeros((CANVAS // 2, CANVAS, 3), np.float32)
    else:
        canvas = np.array(widened(radiance, CANVAS, has_cells))
    height, width = canvas.shape[:2]
    solid = sphere.row_solid_angles(width, height)
    for sun in suns:
        top, covered = covered_by(turn.T @ sun.to_light, sun.angular_diameter / 2, width, height)
        rows = slice(top, top + len(covered))
        shining = sun.scalar_irradiance / (covered.sum(axis=1) @ solid[rows])
        for row, part in zip(canvas[rows], covered, strict=True):
            row += part[:, None] * shining
    return canvas


def covered_by(centre: Floats, half_angle: float, width: int, height: int) -> tuple[int, Floats]:
    """Which part of each pixel of a map a disc covers: the first row that it may touch, and from
    there on (rows, width)."""
    polar = np.arctan2(np.hypot(centre[0], centre[1]), centre[2])
    reach = np.array([polar - half_angle, polar + half_angle]) * (height / np.pi)
    top, bottom = max(int(reach[0]) - 1, 0), min(int(reach[1]) + 2, height)
    rows = range(top, bottom)
    covered = np.stack([_covered(row, centre, half_angle, width, height) for row in rows])
    if not covered.any():  # so narrow that it lies between all places that were looked at
        row, column = divmod(int(sphere.pixels_at(centre[None], width, height)[0]), width)
        covered[row - top, column] = 1
    return top, covered


def _covered(row: int, centre: Floats, half_angle: float, width: int, height: int) -> Floats:
    """Of one row, (width,)."""
    columns = np.arange(width)
    middles = sphere.to_directions((columns + 0.5) / width, (row + 0.5) / height)
    away = sphere.angle_between(middles, centre)
    covered = (away < half_angle).astype(np.float64)
    # A pixel reaches three quarters of its height from its centre at most; pixels are square there.
    rim = np.flatnonzero(np.abs(away - half_angle) < 0.75 * np.pi / height)
    steps = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS
    u = (columns[rim, None, None] + steps[:, None]) / width
    inside = sphere.angle_between(sphere.to_directions(u, (row + steps) / height), centre)
    covered[rim] = (inside < half_angle).mean(axis=(1, 2))
    return covered
