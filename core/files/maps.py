"""A map from a file, whatever its format: the format is told by content, not by the name."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..environment import EnvironmentMap, environment_from_pixels
from ..errors import UnusableInput
from . import exr, image


def load(path: str | Path, allow_ldr: bool = False) -> EnvironmentMap:
    """Read, check and repair a map. Raises UnusableInput with one clear sentence."""
    path = Path(path)
    sha256 = _fingerprint(path)
    if path.open("rb").read(4) == exr.MAGIC:
        pixels, warnings = exr.read(path)
    else:
        pixels, warnings = image.read(path, allow_ldr), []
    return environment_from_pixels(pixels, path.stem, path.name, sha256, tuple(warnings))


def _fingerprint(path: Path) -> str:
    if path.is_dir():
        raise UnusableInput(f"{path} is a folder, not an image.")
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        raise UnusableInput(f"{path} does not exist.") from None
    except OSError as error:
        raise UnusableInput(f"{path} cannot be read: {error.strerror}.") from error
    if path.stat().st_size == 0:
        raise UnusableInput(f"{path} is empty.")
    return digest
