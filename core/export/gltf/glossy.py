"""What a surface of some roughness mirrors of a map, as real-time renderers look it up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ... import sphere

Floats = NDArray[np.float64]


def blurred(radiance: NDArray[np.floating], alpha: float) -> Floats:
    """A map, (height, 2 height, 3), as a surface mirrors it that is looked at along its normal.

    alpha: of the GGX distribution of its facets, above 0. What lies in a direction is weighted by
    the density of the facets half way to it, and by its cosine (Karis 2013, "Real Shading in
    Unreal Engine 4"). The weight depends on the angle alone, so along rows it is a convolution.
    """
    height, width = radiance.shape[:2]
    polar = (np.arange(height) + 0.5) * np.pi / height
    turn = np.cos(np.arange(width) * 2 * np.pi / width)
    solid = sphere.row_solid_angles(width, height)
    spectrum = np.fft.rfft(radiance.astype(np.float64) * solid[:, None, None], axis=1)
    out = np.empty((height, width, 3))
    for row, angle in enumerate(polar):
        along = np.cos(angle) * np.cos(polar)[:, None]
        weights = facets(along + np.sin(angle) * np.sin(polar)[:, None] * turn, alpha)
        # They are even, so their spectrum is real.
        of_weights = np.fft.rfft(weights, axis=1).real
        found = np.fft.irfft(np.einsum("rm,rmc->mc", of_weights, spectrum), width, axis=0)
        out[row] = found / (weights.sum(axis=1) @ solid)
    return np.maximum(out, 0)  # rounding around zero


def facets(cosine: Floats, alpha: float) -> Floats:
    """The weight of light, by the cosine of its angle with the direction that is looked up."""
    half = (1 - cosine) / 2
    return np.maximum(cosine, 0) / (half + alpha**2 * (1 - half)) ** 2
