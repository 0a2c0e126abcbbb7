"""RGBD, a colour and what it is to be divided by in 8 bits each, as Babylon.js unpacks it."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

HIGHEST = 255.0
"""What can be said at most."""

GAMMA = 2.2


def packed(colours: Floats) -> NDArray[np.uint8]:
    """Linear colours, (..., 3), from 0 to HIGHEST, as bytes (..., 4)."""
    divisor = np.clip(np.floor(HIGHEST / np.maximum(colours.max(axis=-1), 1.0)), 1, 255)
    colour = np.clip(colours * (divisor / 255)[..., None], 0, 1) ** (1 / GAMMA)
    parts = [np.round(255 * colour), divisor[..., None]]
    return np.concatenate(parts, axis=-1).astype(np.uint8)


def unpacked(pixels: NDArray[np.uint8]) -> Floats:
    """What those bytes mean, (..., 3)."""
    return (pixels[..., :3] / 255) ** GAMMA / (pixels[..., 3:] / 255)


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A picture, (height, width, 4), as a PNG file."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()
