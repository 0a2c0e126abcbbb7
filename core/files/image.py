"""Every image that is not OpenEXR, Radiance .hdr first, read by OpenImageIO."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import UnusableInput


def read(path: Path, allow_ldr: bool) -> NDArray[np.float32]:
    """Pixels (height, width, 3), linear. Raises UnusableInput.

    allow_ldr: take images of 8 or 16 bits too, undoing the sRGB curve.
    """
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(path))
    if source is None:
        oiio.geterror()
        raise UnusableInput(
            f"{path.name} is not an image that can be read here: give an .exr or .hdr map."
        )
    try:
        spec = source.spec()
        linear = spec.format.basetype in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE)
        if not linear and not allow_ldr:
            raise UnusableInput(
                f"{path.name} is an LDR image ({spec.format} values, no linear light): use the "
                "HDR version of the map, or --allow-ldr to take it as sRGB."
            )
        pixels = source.read_image(oiio.FLOAT)
        problem = source.geterror()
    finally:
        source.close()
    if pixels is None or problem:
        reason = " ".join(problem.split()) or "its pixels end too early"
        raise UnusableInput(f"{path.name} is truncated or damaged ({reason}).")
    colour = _upright(pixels, spec.getattribute("Orientation") or 1)
    colour = colour[..., [0, 0, 0]] if spec.nchannels < 3 else colour[..., :3]
    return np.ascontiguousarray(colour if linear else _from_srgb(colour))


def _upright(pixels: NDArray[np.float32], orientation: int) -> NDArray[np.float32]:
    """Undo an Exif orientation, which is how OpenImageIO reports a .hdr file's scan order."""
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
    # 2 and 3 run leftwards, 3 and 4 upwards; 5 to 8 are those, transposed.
    leftwards, upwards = {2: (1, 0), 3: (1, 1), 4: (0, 1), 6: (1, 0), 7: (1, 1), 8: (0, 1)}.get(
        orientation, (0, 0)
    )
    return pixels[:: -1 if upwards else 1, :: -1 if leftwards else 1]


def _from_srgb(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """IEC 61966-2-1, display-referred 0 to 1 to linear 0 to 1."""
    low = values / 12.92
    high = ((np.maximum(values, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, low, high).astype(np.float32)
