"""Suns tilted up or down a little, so that level ground gets what the light gives it, and so do
walls that stand on it.

A disc across the horizon gives these more or less than the light in its place. That is wrong all
over a picture, and where the number of lights is chosen, half of them were for nothing else. A tilt
that shadows hardly tell is enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..environment import LUMINANCE_WEIGHTS
from ..standing import WALLS, discs_on_walls
from ..suns import Sun, disc_on_ground

Floats = NDArray[np.float64]

STEP = 0.02
"""Of half a disc's width, to see what a tilt changes."""

MOST = 0.5
"""Of half a disc's width: so far it may be tilted."""

COUNTS = 4.0, 1.0, 0.25, 0.0625, 0.0156, 0.0039
"""What a tilt costs counts so much, from one step to the next: less and less, until ground and
walls are right."""

FROZEN = 4
"""Discs that are tilted as far as they may be leave the rest to others: so often it is asked which
are."""

NEARLY = 0.95
"""Of what is allowed of ground and walls: no more is asked of a tilt."""


@dataclass(frozen=True, eq=False)
class Level:
    """What level ground and walls on it shall get.

    ground: parts of the light that suns replace, of each channel, nan where it has none, (3,).
    standing: parts of its luminance on each wall, (WALLS,), None where that is not asked.
    on_ground, on_walls: so far they may be off, the worst channel and root mean square. shadows: so
    much may be wrong at shadows' edges, as a part of the irradiance from the suns' light.
    """

    ground: Floats
    standing: Floats | None
    on_ground: float
    on_walls: float
    shadows: float


def levelled(suns: Sequence[Sun], level: Level, wrong: float, costs: float) -> tuple[Sun, ...]:
    """The same discs, tilted by about the least that makes ground and walls right enough, or by
    what makes the worst of these and of shadows best.

    wrong: what the suns get wrong at shadows' edges, in parts of `level.shadows`. costs: what a
    tilt adds to the square of that, by the disc's part of the suns' light in parts of
    `level.shadows`, squared, times the tilt, squared, by half the disc's width. Points stay where
    they are: none lies across the horizon.
    """
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    if not half.any() or np.isnan(level.ground).all():
        return tuple(suns)
    discs = _Discs.of(suns, level, half, costs)
    tilt = _tilt(discs, wrong)
    raised = _raised(discs.to_light, tilt)
    return tuple(
        replace(sun, to_light=after) if angle else sun
        for sun, after, angle in zip(suns, raised, tilt, strict=True)
    )


def _tilt(discs: _Discs, wrong: float) -> Floats:
    """Radians upwards for each disc, (n,)."""
    tilt = best = np.zeros(len(discs.half))
    given, least = discs.given(tilt), np.inf
    for counts in (*COUNTS, None):
        off = discs.off(given)
        shadows = float(np.hypot(wrong, np.sqrt(discs.cost @ tilt**2)))
        if max(off, shadows) < least:
            least, best = max(off, shadows), tilt
        if counts is None or off <= max(NEARLY, shadows):
            break
        tilt, given = discs.tilted(tilt, given, counts)
    return best


@dataclass(frozen=True, eq=False)
class _Discs:
    """Discs to be tilted, and what ground and walls shall get of them.

    to_light: unit vectors, (n, 3). half: of their widths, radians, (n,). part: of all light of each
    channel that is asked for, (n, c). luminous: of all luminance, (n,). cost: of a tilt's square,
    in what shadows may be wrong by, squared, (n,). wanted: by ground, then by walls, (k,). limits:
    so far each channel of ground may be off, and for each wall all of them together, (k,).
    """

    to_light: Floats
    half: Floats
    part: Floats
    luminous: Floats
    cost: Floats
    wanted: Floats
    limits: Floats

    @classmethod
    def of(cls, suns: Sequence[Sun], level: Level, half: Floats, costs: float) -> _Discs:
        flux = np.array([sun.scalar_irradiance for sun in suns])
        luminous = flux @ LUMINANCE_WEIGHTS
        luminous /= luminous.sum()
        channels = ~np.isnan(level.ground)
        wanted = level.ground[channels]
        limits = np.full(len(wanted), level.on_ground)
        if level.standing is not None:
            wanted = np.concatenate([wanted, level.standing])
            limits = np.append(limits, np.full(WALLS, level.on_walls * np.sqrt(WALLS)))
        # A tilted disc is wrong at shadows' edges by the square of its light and of its tilt, the
        # less the wider it is.
        cost = costs * (luminous / level.shadows) ** 2 / np.maximum(half, 1e-9)
        part = flux[:, channels] / flux[:, channels].sum(axis=0)
        to_light = np.array([sun.to_light for sun in suns])
        return cls(to_light, half, part, luminous, cost, wanted, limits)

    def given(self, tilt: Floats) -> Floats:
        """What ground and walls get of each disc, in parts of the limits, (n, k)."""
        raised = _raised(self.to_light, tilt)
        given = self.part * disc_on_ground(raised[:, 2], self.half)[:, None]
        if len(self.wanted) > given.shape[1]:
            walls = discs_on_walls(raised, self.half) * self.luminous[:, None]
            given = np.concatenate([given, walls], axis=1)
        return given / self.limits

    def lacks(self, given: Floats) -> Floats:
        """In parts of the limits, (k,)."""
        return self.wanted / self.limits - given.sum(axis=0)

    def off(self, given: Floats) -> float:
        """The worst channel of ground, or walls together, in parts of what is allowed."""
        lacks, channels = self.lacks(given), self.part.shape[1]
        return float(max(np.abs(lacks[:channels]).max(), np.linalg.norm(lacks[channels:])))

    def tilted(self, tilt: Floats, given: Floats, counts: float) -> tuple[Floats, Floats]:
        """A step to the least of what is lacking, squared, and of what tilts cost, which counts so
        much against it: tilts, (n,), and what is given then."""
        step = STEP * np.maximum(self.half, 1e-9)
        gain = (self.given(tilt + step) - given) / step[:, None]
        aim = self._least(gain, self.lacks(given) + tilt @ gain, counts)

        def both(tilt: Floats, given: Floats) -> float:
            return float(counts * self.cost @ tilt**2 + np.sum(self.lacks(given) ** 2))

        before = both(tilt, given)
        # What ground and walls get does not change evenly: the whole way may be too far.
        for way in (1.0, 0.5, 0.25):
            after = tilt + way * (aim - tilt)
            then = self.given(after)
            if both(after, then) < before:
                return after, then
        return tilt, given

    def _least(self, gain: Floats, lacks: Floats, counts: float) -> Floats:
        """About the tilts, (n,), for which it is the least if each gains evenly, (n, k), and none
        of them is more than it may be."""
        elevation = np.arcsin(np.clip(self.to_light[:, 2], -1, 1))
        lowest = np.maximum(-MOST * self.half, -np.pi / 2 - elevation)
        highest = np.minimum(MOST * self.half, np.pi / 2 - elevation)
        ease = 1 / np.sqrt(np.maximum(counts * self.cost, 1e-300))
        tilt = np.zeros(len(self.half))
        free = np.ones(len(tilt), bool)
        for _ in range(FROZEN):
            eased = np.where(free, ease, 0)[:, None] * gain
            fixed = np.where(free, 0, tilt)
            # Where one disc alone has all of two channels, products of these are singular.
            way, size, of_each = np.linalg.svd(eased.T, full_matrices=False)
            missing = (size / (1 + size**2)) * (way.T @ (lacks - fixed @ gain))
            tilt = np.where(free, ease * (of_each.T @ missing), fixed)
            tilt = np.clip(tilt, lowest, highest)
            still = free & (tilt > lowest) & (tilt < highest)
            if still.sum() == free.sum():
                break
            free = still
        return tilt


def _raised(to_light: Floats, angle: Floats) -> Floats:
    """Directions, (n, 3), tilted upwards by angles in radians, (n,), at most to a pole."""
    ring = np.hypot(to_light[:, 0], to_light[:, 1])
    sine, cosine = np.sin(angle), np.cos(angle)
    narrower = cosine - to_light[:, 2] * sine / np.where(ring > 0, ring, np.inf)
    raised = np.concatenate(
        [
            to_light[:, :2] * narrower[:, None],
            (to_light[:, 2] * cosine + ring * sine)[:, None],
        ],
        axis=1,
    )
    return np.where((ring > 0)[:, None], raised, to_light)
