"""OpenEXR files: maps in, residual maps out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..environment import scalar_irradiance
from ..errors import CannotWrite, UnusableInput
from ..tolerances import HALF_ENERGY, HALF_MAXIMUM

MAGIC = b"\x76\x2f\x31\x01"

PREFERRED_LAYERS = ("", "Combined", "ViewLayer.Combined", "rgb", "RGB", "rgba", "RGBA", "beauty")
"""Layers that hold the picture itself, by the habit of the programs that write them."""


def read(path: Path) -> tuple[NDArray[np.floating], list[str]]:
    """Pixels (height, width, 3) of the file's own type, and warnings for the user.

    Takes the first part and layer that has R, G and B; a single channel (Y) counts as grey;
    alpha and all other channels are ignored. Raises UnusableInput.
    """
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            parts = [
                ({n: c.pixels for n, c in part.channels.items()}, part.header)
                for part in file.parts
            ]
    except (RuntimeError, ValueError, TypeError, MemoryError, OSError) as error:
        raise UnusableInput(
            f"{path.name} cannot be read as OpenEXR; it is probably truncated or damaged "
            f"({_one_line(error)})."
        ) from error
    for channels, header in parts:
        planes = _colour_planes(channels)
        if planes:
            return np.stack(planes, axis=-1), _warnings(header)
    names = ", ".join(sorted({name for channels, _ in parts for name in channels})) or "none"
    raise UnusableInput(f"{path.name} has no colour channels (R, G, B or Y); it has: {names}.")


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _colour_planes(channels: dict[str, NDArray]) -> list[NDArray] | None:
    flat = {name: plane for name, plane in channels.items() if plane.ndim == 2}
    for layer in _layers(flat):
        prefix = f"{layer}." if layer else ""
        for names in ("RGB", "rgb", ("red", "green", "blue"), "YYY", "yyy"):
            wanted = [prefix + name for name in names]
            subsampled = names in ("YYY", "yyy") and {prefix + "RY", prefix + "BY"} & set(flat)
            if all(name in flat for name in wanted) and not subsampled:
                return [flat[name] for name in wanted]
    return None


def _layers(channels: dict[str, NDArray]) -> list[str]:
    found = dict.fromkeys(name.rpartition(".")[0] for name in channels)
    first = [layer for layer in PREFERRED_LAYERS if layer in found]
    return first + [layer for layer in found if layer not in first]


def _warnings(header: dict) -> list[str]:
    stated = header.get("chromaticities")
    rec709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    if stated is None or np.allclose(np.ravel(stated), rec709, atol=2e-3):
        return []
    return ["The file states primaries other than Rec.709; its numbers are taken as they are."]


def is_half_enough(radiance: NDArray[np.float32]) -> bool:
    """Whether half floats hold a map: nothing overflows and no channel loses its energy."""
    if radiance.max() > HALF_MAXIMUM:
        return False
    whole = scalar_irradiance(radiance)
    rounded = scalar_irradiance(radiance.astype(np.float16))
    return bool((np.abs(rounded - whole) <= HALF_ENERGY * whole).all())


def write(path: Path, radiance: NDArray[np.float32]) -> None:
    """Write a map as half floats where they are enough, else as float32; ZIP.

    radiance: (height, width, 3), linear Rec.709.
    """
    import OpenEXR

    stored = radiance.astype(np.float16) if is_half_enough(radiance) else radiance
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290),
    }
    try:
        with OpenEXR.File(header, {"RGB": np.ascontiguousarray(stored)}) as file:
            file.write(str(path))
    except RuntimeError as error:
        raise CannotWrite(
            f"Cannot write {path.parent}: {_one_line(error)}. Nothing was changed."
        ) from error
