"""Suns tilted up or down a little, so that level ground gets what the light gives it, and so do
walls that stand on it.

A disc across the horizon gives these more or less than the light in its place. That is wrong all
over a picture, and where the number of lights is chosen, half of them were for nothing else. A tilt
that no shadow tells is enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..environment import LUMINANCE_WEIGHTS
from ..standing import discs_on_walls
from ..suns import Sun, disc_on_ground

Floats = NDArray[np.float64]

STEP = 0.02
"""Of half a disc's width, to see what a tilt changes."""

MOST = 0.5
"""Of half a disc's width: so far it may be tilted."""

TIMES = 3
"""What the ground gets does not change evenly: by so many steps."""

ALIKE = 0.01
"""Channels that differ by less than this part are tilted for as one, and so are walls."""

WALLS_COUNT = 0.3
"""How much walls count against level ground: what is allowed of either would make it a tenth, but
then walls are taken for alike."""


def levelled(
    suns: Sequence[Sun], ground: Floats, standing: Floats | None = None
) -> tuple[Sun, ...]:
    """The same discs, tilted by the least that gives level ground and walls what they shall get.

    ground, standing: that, as parts of all light, see `prediction.Prediction`. Points stay where
    they are: none of them lies across the horizon.
    """
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    flux = np.array([sun.scalar_irradiance for sun in suns])
    lit = ~np.isnan(ground) & (flux.sum(axis=0) > 0)
    if not lit.any() or not half.any():
        return tuple(suns)
    part = flux[:, lit] / flux[:, lit].sum(axis=0)
    luminous = flux @ LUMINANCE_WEIGHTS
    luminous /= luminous.sum()
    to_light = np.array([sun.to_light for sun in suns])

    def each_gives(tilt: Floats) -> Floats:
        """Of the light of each channel on the ground, and of luminance on walls, (n, c + WALLS)."""
        tilted = _raised(to_light, tilt)
        given = part * disc_on_ground(tilted[:, 2], half)[:, None]
        if standing is None:
            return given
        walls = discs_on_walls(tilted, half) * luminous[:, None]
        return np.concatenate([given, WALLS_COUNT * walls], axis=1)

    wanted = ground[lit]
    if standing is not None:
        wanted = np.concatenate([wanted, WALLS_COUNT * standing])
    tilt = _tilt(np.arcsin(np.clip(to_light[:, 2], -1, 1)), half, part, each_gives, wanted)
    raised = _raised(to_light, tilt)
    return tuple(
        replace(sun, to_light=after) if angle else sun
        for sun, after, angle in zip(suns, raised, tilt, strict=True)
    )


def _tilt(
    elevation: Floats,
    half: Floats,
    part: Floats,
    each_gives: Callable[[Floats], Floats],
    wanted: Floats,
) -> Floats:
    """Radians upwards for each disc, (n,).

    half: of each disc's width, radians, (n,). part: of all light of each channel, (n, c).
    each_gives: what discs that are tilted so give, (n, k), whose sums are wanted, (k,).
    """
    # A tilted disc is wrong at shadows' edges by the square of its light and of its tilt, the less
    # the wider it is: what is least of that in all, for a given gain, is in proportion to this.
    ease = half / np.maximum(part.mean(axis=1), 1e-300) ** 2
    lowest = np.maximum(-MOST * half, -np.pi / 2 - elevation)
    highest = np.minimum(MOST * half, np.pi / 2 - elevation)
    step = STEP * np.maximum(half, 1e-9)
    tilt = np.zeros(len(half))
    for _ in range(TIMES):
        now = each_gives(tilt)
        gain = (each_gives(tilt + step) - now) / step[:, None]
        each = gain.T @ (gain * ease[:, None])
        tilt += ease * (gain @ np.linalg.lstsq(each, wanted - now.sum(axis=0), rcond=ALIKE)[0])
        tilt = np.clip(tilt, lowest, highest)
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
