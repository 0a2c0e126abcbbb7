"""What EEVEE shows otherwise than it is: its world gives surfaces light of two orders of spherical
harmonics, from everywhere at once, whatever stands in the way; shadows of very wide lamps are not
to be relied on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .environment import LUMINANCE_WEIGHTS
from .patches import Patches

Floats = NDArray[np.float64]

STEEPEST = np.sqrt(3) / 2
"""The most that a surface's irradiance may differ from the mean, as a part of it: EEVEE lessens a
stronger first order, so that surfaces turned away are not darker than black. Measured with one sun
in a black sky, from any side: 0.867."""

FADING = np.radians([45, 180])
"""Widths of lamps from which on EEVEE loses some of their shadows, and at which it loses all: it
holds a part of the lamp that is below a surface's horizon against it, or traces less than all of
the lamp. Pictures of a torus, a sphere and slabs are .75 to 1 times as wrong as predicted so, for
five conversions of Blender's city, interior and sunset, and 2.1 times for two of its studio; with
shadows for all of each lamp it was 1.4 to 2.8 and 3.5 times."""


def part_shadowed(width: Floats | float) -> Floats:
    """How much of lamps of these widths, radians, has shadows."""
    narrow, wide = FADING
    return np.clip((wide - width) / (wide - narrow), 0, 1)


def irradiance_of_two_orders(patches: Patches, normals: Floats) -> Floats:
    """Luminance of the irradiance of surfaces with these normals, (s, 3): (s,).

    A cosine lobe has a quarter of all light in order 0, and half of it, times the cosine, in
    order 1 (Ramamoorthi and Hanrahan, 2001).
    """
    flux = patches.flux @ LUMINANCE_WEIGHTS
    mean = float(flux.sum()) / 4
    # Patches spread too, so that their light is not all where it has its mean.
    first = (flux * (1 - patches.spread)) @ patches.directions / 2
    steep = float(np.linalg.norm(first))
    if steep > STEEPEST * mean:
        first *= STEEPEST * mean / steep
    return mean + normals @ first
