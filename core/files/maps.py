"""A map from a file, whatever its format: the format is told by content, not by the name."""

from __future__ import annotations

import hashlib
import stat
from pathlib import Path

from ..environment import EnvironmentMap, environment_from_pixels
from ..errors import UnusableInput
from . import exr, image, radiance


def load(path: str | Path, allow_ldr: bool = False) -> EnvironmentMap:
    """Read, check and repair a map. Raises UnusableInput with one clear sentence."""
    path = Path(path)
    magic, sha256 = _identify(path)
    warnings: list[str] = []
    try:
        if magic == exr.MAGIC:
            pixels, warnings = exr.read(path)
        elif magic.startswith(radiance.MAGIC):
            pixels = radiance.read(path)
        else:
            pixels = image.read(path, allow_ldr)
        return environment_from_pixels(pixels, path.stem, path.name, sha256, tuple(warnings))
    except MemoryError as error:
        raise UnusableInput(f"{path.name} does not fit into memory.") from error


def _identify(path: Path) -> tuple[bytes, str]:
    """The file's first four bytes and the SHA-256 of all of them."""
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise UnusableInput(f"{path} is a folder, not an image.")
        if not stat.S_ISREG(mode):  # a pipe would block, a device may never end
            raise UnusableInput(f"{path} is a pipe or a device: give a file.")
        with path.open("rb") as file:
            magic = file.read(4)
            file.seek(0)
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        raise UnusableInput(f"{path} does not exist.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UnusableInput(f"{path} cannot be read: {reason}.") from error
    if not magic:
        raise UnusableInput(f"{path} is empty.")
    return magic, digest
