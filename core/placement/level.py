"""Suns tilted up or down a little, so that level ground gets what the light gives it.

A disc across the horizon gives the ground more or less than the light in its place. That is wrong
all over a picture, and where the number of lights is chosen, half of them were for nothing else. A
tilt that no shadow tells is enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..suns import Sun, disc_on_ground

Floats = NDArray[np.float64]

STEP = 1e-4
"""Radians, to see what a tilt changes."""

MOST = 0.25
"""Of half a disc's width: so far it may be tilted."""

TIMES = 3
"""What the ground gets does not change evenly: by so many steps."""

ALIKE = 0.01
"""Channels that differ by less than this part are tilted for as one."""


def levelled(suns: Sequence[Sun], ground: Floats) -> tuple[Sun, ...]:
    """The same discs, tilted by the least that gives level ground what it shall get.

    ground: that, as a part of all light of each channel, nan for a channel without any, (3,); see
    `prediction.Prediction`. Points stay where they are: none of them lies across the horizon.
    """
    half = np.array([sun.angular_diameter / 2 for sun in suns])
    flux = np.array([sun.scalar_irradiance for sun in suns])
    lit = ~np.isnan(ground) & (flux.sum(axis=0) > 0)
    if not lit.any() or not half.any():
        return tuple(suns)
    to_light = np.array([sun.to_light for sun in suns])
    part = flux[:, lit] / flux[:, lit].sum(axis=0)
    tilt = _tilt(np.arcsin(np.clip(to_light[:, 2], -1, 1)), half, part, ground[lit])
    return tuple(
        replace(sun, to_light=_raised(sun.to_light, angle)) if angle else sun
        for sun, angle in zip(suns, tilt, strict=True)
    )


def _tilt(elevation: Floats, half: Floats, part: Floats, ground: Floats) -> Floats:
    """Radians upwards for each disc, (n,).

    half: of each disc's width, radians, (n,). part: of all light of each channel, (n, c).
    """
    # A tilted disc is wrong at shadows' edges by the square of its light and of its tilt, the less
    # the wider it is: what is least of that in all, for a given gain, is in proportion to this.
    ease = half / np.maximum(part.mean(axis=1), 1e-300) ** 2
    lowest = np.maximum(-MOST * half, -np.pi / 2 - elevation)
    highest = np.minimum(MOST * half, np.pi / 2 - elevation)
    tilt = np.zeros(len(half))
    for _ in range(TIMES):
        now = disc_on_ground(np.sin(elevation + tilt), half)
        slope = (disc_on_ground(np.sin(elevation + tilt + STEP), half) - now) / STEP
        gain = part * slope[:, None]
        each = gain.T @ (gain * ease[:, None])
        tilt += ease * (gain @ np.linalg.lstsq(each, ground - now @ part, rcond=ALIKE)[0])
        tilt = np.clip(tilt, lowest, highest)
    return tilt


def _raised(to_light: Floats, angle: float) -> Floats:
    """A direction tilted upwards by an angle in radians, at most to a pole."""
    ring = np.hypot(to_light[0], to_light[1])
    if ring == 0:
        return to_light
    sine, cosine = np.sin(angle), np.cos(angle)
    narrower = (ring * cosine - to_light[2] * sine) / ring
    return np.array([*(to_light[:2] * narrower), to_light[2] * cosine + ring * sine])
