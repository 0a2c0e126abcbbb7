"""How wrong shadows are if suns stand in for light: predicted, without rendering.

Surfaces that face anywhere look at walls and cones in front of the sky; most of those are aimed at
the light that suns replace. The difference of their irradiance, with the light and with the suns,
is what a picture would be wrong by. Indoors, where the openings are known that light comes in
through, it is told for places that are there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import LUMINANCE_WEIGHTS
from .indoors import BOUNCED, Indoors
from .patches import Patches
from .shadow_edges import facing_up, half_widths
from .standing import discs_on_walls, on_walls
from .sums import weighted_sum
from .suns import Sun, disc_on_ground
from .two_orders import irradiance_of_two_orders, part_shadowed

Floats = NDArray[np.float64]

SURFACES = 512
"""Surfaces that look. The root of a mean of so many squares is good to about a tenth."""

AIMED = 0.7
"""Part of the occluders whose edge passes near light, in proportion to the light."""

CONES = np.radians([3, 50])
"""Narrowest and widest angular radius of a cone."""

NEAR = np.radians(10)
"""A wall's edge passes at most so far from what it is aimed at."""

PIECES, FEWEST = 1024, 16
"""Points that stand for all discs together, and for one of them at least. By light and the root of
its width each disc gets its part. They tell what 32,768 do to 1.2 %, root mean square of 159 sets
of suns, at most 7 %: so many surfaces are good to a tenth."""

AT_ONCE = 128
"""Pieces of light that are held against all surfaces at a time, with single precision: few enough
for a processor's own memory. Single precision takes half the time; of a narrow disc behind a cone
it is right to 1e-4, mostly far better, where predictions are good to a tenth."""

SHARP = 1e-7
"""Half the width of a point, radians."""

DARKEST = 1e-3
"""Of the mean irradiance in the open, and of what falls in: a room that gets less light is dark
whatever is wrong of it."""

BALANCED, BALANCED_INDOORS = 1.6, 25.0
"""What is predicted of lights, about, against what is wrong of their cells when these are cut:
guesses to begin with. Indoors it is a part of what falls in directly."""


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
        width = 2 * half_width[:, None]
        one = np.ones_like(width)
        # How far outside of the cone, in widths of the piece: at most half of one decides.
        pieces = _single(np.concatenate([directions / width, 1 / width, one], axis=1))
        sine, cosine = np.sin(self.radii), np.cos(self.radii)
        half = np.full_like(sine, 0.5)
        cones = _single(np.concatenate([-self.axes.T / sine, [cosine / sine], [half]]))
        whole = max(float(flux.sum()), 1e-300)
        light, normals = _single(directions * (flux / whole)[:, None]), _single(self.normals.T)
        total = np.zeros(len(self.radii))
        space = np.empty((2, min(AT_ONCE, len(directions)), len(total)), np.float32)
        for start in range(0, len(directions), AT_ONCE):
            some = slice(start, start + AT_ONCE)
            seen, given = space[:, : len(pieces[some])]
            np.clip(np.matmul(pieces[some], cones, out=seen), 0, 1, out=seen)
            np.maximum(np.matmul(light[some], normals, out=given), 0, out=given)
            seen *= given
            total += seen.sum(axis=0)
        return total * whole

    def in_the_open(self) -> Surfaces:
        """The same surfaces without anything in front of them."""
        return Surfaces(self.normals, self.axes, np.full_like(self.radii, SHARP))


def _lit(surfaces: Surfaces | Indoors, patches: Patches) -> Floats:
    """Luminance that each surface gets, (s,)."""
    flux = patches.flux @ LUMINANCE_WEIGHTS
    return surfaces.irradiance(patches.directions, flux, half_widths(patches.spread))


def surfaces_for(light: Sequence[Patches], all_light: float) -> Surfaces:
    """SURFACES surfaces, half of them behind walls and half behind cones.

    light: what may be wrong. all_light: of the whole map; the rest of it is right whatever stands
    in front of it, so that fewer of the occluders matter.
    """
    random = np.random.default_rng(0)
    target = _unit(random.normal(size=(SURFACES, 3)))
    sums = np.cumsum(np.concatenate([some.flux @ LUMINANCE_WEIGHTS for some in light]))
    aimed = round(AIMED * min(float(sums[-1]) / all_light, 1) * SURFACES)
    if aimed:
        at = (np.arange(aimed) + 0.5) / aimed * sums[-1]
        directions = np.concatenate([some.directions for some in light])
        target[:aimed] = directions[np.minimum(np.searchsorted(sums, at), len(sums) - 1)]
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
    """What surfaces should get from suns.

    irradiance: of each surface, luminance, (s,). mean: what surfaces get in the open from the
    whole map, on average over all that they may face; indoors what a picture shows on average.
    ground: what level ground gets in the open, as a part of the light that suns replace, of each
    channel; nan where a channel has none, (3,).
    standing: what walls on level ground get, as parts of the luminous light that suns replace,
    (WALLS,); None where the ground does not hide all light below the horizon, as in EEVEE.
    part: of all light that suns replace; part_inside: indoors, of what falls in. of_residual: what
    the rest of the light is wrong by, where it is shown without its shadows, as `error` counts: no
    suns mend that. of_cuts: how wrong suns are, about, against what is wrong of their cells when
    these are cut. in_eevee: see `two_orders`.
    """

    surfaces: Surfaces | Indoors
    irradiance: Floats
    mean: float
    ground: Floats
    standing: Floats | None
    part: float
    of_residual: float = 0.0
    of_cuts: float = 0.0
    in_eevee: bool = False
    part_inside: float = 0.0

    @classmethod
    def indoors(cls, patches: Patches, all_light: float, indoors: Indoors) -> Prediction:
        """For a scene that light comes into through openings only. Level ground and walls count as
        what is there. patches, all_light: see `of`."""
        flux = patches.flux @ LUMINANCE_WEIGHTS
        wanted = _lit(indoors, patches)
        least = DARKEST * all_light / (4 * BOUNCED)
        direct = max(indoors.mean_irradiance(patches.directions, flux, wanted), least)
        part, inside = float(flux.sum()) / all_light, float(np.mean(wanted)) / direct
        of_cuts = BALANCED_INDOORS * max(inside, DARKEST) / BOUNCED
        return cls(
            indoors,
            wanted,
            BOUNCED * direct,
            np.full(3, np.nan),
            None,
            part,
            of_cuts=of_cuts,
            part_inside=inside,
        )

    @classmethod
    def of(
        cls,
        patches: Patches | None,
        all_light: float,
        unshadowed: Patches | None = None,
        in_eevee: bool = False,
    ) -> Prediction:
        """patches: the light that suns shall replace. all_light: luminance of the whole map's
        scalar irradiance. unshadowed: a residual that is shown as if nothing stood before it; then
        the suns are asked to make up for the shadows that it lacks. in_eevee: all is shown as
        EEVEE does (see `two_orders`)."""
        given = [some for some in (patches, unshadowed) if some is not None]
        surfaces = surfaces_for(given, all_light)
        wanted = np.zeros(SURFACES)
        of_residual = 0.0
        if patches is not None:
            wanted += _lit(surfaces, patches)
        if unshadowed is not None:
            if in_eevee:
                shown = irradiance_of_two_orders(unshadowed, surfaces.normals)
            else:
                shown = _lit(surfaces.in_the_open(), unshadowed)
            lacking = _lit(surfaces, unshadowed) - shown
            wanted += lacking
            of_residual = float(np.sqrt(np.mean(lacking**2))) / (all_light / 4)
        ground, standing, part = np.full(3, np.nan), None, 0.0
        if patches is not None:
            flux = patches.flux @ LUMINANCE_WEIGHTS
            if not in_eevee:
                walls = on_walls(patches.directions, half_widths(patches.spread))
                standing = weighted_sum(flux, walls) / flux.sum()
            ground = _parts(
                patches.flux, facing_up(patches.directions, half_widths(patches.spread))
            )
            part = float(flux.sum()) / all_light
        return cls(
            surfaces,
            wanted,
            all_light / 4,
            ground,
            standing,
            part,
            of_residual,
            BALANCED * part,
            in_eevee,
        )

    def expected(self, error_of_cuts: float) -> float:
        """How wrong suns are, about, by what is wrong of their cells when these are cut."""
        return hypot(self.of_cuts * error_of_cuts, self.of_residual)

    def error(self, suns: Sequence[Sun]) -> float:
        """Root mean square of what surfaces get wrong under shadows if these suns stand in for
        the light, as a part of `mean`."""
        lights = [(self.surfaces, np.ones(len(suns)))]
        if self.in_eevee:
            parts = part_shadowed(np.array([sun.angular_diameter for sun in suns]))
            lights = [(self.surfaces, parts), (self.surfaces.in_the_open(), 1 - parts)]
        wrong = -self.irradiance
        for surfaces, lit in lights:
            given = [(sun, part) for sun, part in zip(suns, lit, strict=True) if part > 0]
            if given:
                wrong = wrong + surfaces.irradiance(*_pieces(*zip(*given, strict=True)))
        return float(np.sqrt(np.mean(wrong**2))) / self.mean

    def wrong_on_ground(self, suns: Sequence[Sun]) -> float:
        """What level ground in the open gets wrong of the worst channel, as a part of all light."""
        if not len(suns) or np.isnan(self.ground).all():
            return 0.0
        height = np.array([sun.to_light[2] for sun in suns])
        half = np.array([sun.angular_diameter for sun in suns]) / 2
        seen = disc_on_ground(height, half)
        given = _parts(np.array([sun.scalar_irradiance for sun in suns]), seen)
        return float(self.part * np.nanmax(np.abs(given - self.ground)))

    def wrong_on_walls(self, suns: Sequence[Sun]) -> float | None:
        """What walls on level ground get wrong of luminance, root mean square, as a part of the
        mean irradiance in the open; None where the ground does not hide what is below the
        horizon."""
        if self.standing is None:
            return None
        if not len(suns):
            return 0.0
        flux = np.array([sun.scalar_irradiance for sun in suns]) @ LUMINANCE_WEIGHTS
        half = np.array([sun.angular_diameter / 2 for sun in suns])
        seen = discs_on_walls(np.array([sun.to_light for sun in suns]), half)
        wrong = weighted_sum(flux, seen) / flux.sum() - self.standing
        return 4 * self.part * float(np.sqrt(np.mean(wrong**2)))


def _parts(flux: Floats, seen: Floats) -> Floats:
    """Of each channel of all light, flux (n, 3), the part that is seen; nan of no light."""
    total = flux.sum(axis=0)
    return np.where(total > 0, weighted_sum(seen, flux) / np.where(total > 0, total, 1), np.nan)


def _pieces(suns: Sequence[Sun], lit: Sequence[float]) -> tuple[Floats, Floats, Floats]:
    """Suns, one at least, as points in a spiral over the disc of each: directions, luminous light
    and half widths. lit: how much of each sun's light."""
    to_light = np.array([sun.to_light for sun in suns])
    diameter = np.array([sun.angular_diameter for sun in suns])
    light = np.array([sun.scalar_irradiance for sun in suns]) @ LUMINANCE_WEIGHTS * lit
    weight = light * np.sqrt(diameter)
    parts = PIECES * weight / max(weight.sum(), 1e-300)
    counts = np.maximum(np.round(parts).astype(int), FEWEST)
    counts[diameter == 0] = 1
    cap = 2 * np.sin(diameter / 4) ** 2  # 1 - cos of the half-angle
    half = np.sqrt(2 * np.pi * cap / counts) / 2
    half[diameter == 0] = SHARP
    sun = np.repeat(np.arange(len(suns)), counts)
    return sphere.spirals(to_light, cap, counts), (light / counts)[sun], half[sun]


def _single(values: Floats) -> NDArray[np.float32]:
    return values.astype(np.float32)


def _around(targets: Floats, angles: Floats, turns: Floats) -> Floats:
    """Directions at these angles from others, (s, 3), turned about them."""
    helper = np.where(np.abs(targets[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
    first = _unit(np.cross(targets, helper))
    second = np.cross(targets, first)
    aside = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    return np.cos(angles)[:, None] * targets + np.sin(angles)[:, None] * aside


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
