"""A map from a file, whatever its format: the format is told by content, not by the name."""

from __future__ import annotations

import hashlib
import stat
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from ..environment import EnvironmentMap, environment_from_strips
from ..errors import UnusableInput
from ..pixels import HeldPixels, MapSize, Pixels
from ..progress import Progress, silent
from . import exr, image, radiance


def load(path: str | Path, allow_ldr: bool = False, progress: Progress = silent) -> EnvironmentMap:
    """Read, check and repair a map. Raises UnusableInput with one clear sentence."""
    progress("reading", 0.0)
    path = Path(path)
    magic = _first_bytes(path)
    with ThreadPoolExecutor(1) as pool:
        digest = pool.submit(_sha256, path)
        try:
            pixels, warnings = _open(path, magic, allow_ldr)
            environment = environment_from_strips(pixels, path.stem, path.name, progress)
        except MemoryError as error:
            raise UnusableInput(f"{path.name} does not fit into memory.") from error
        return replace(environment, sha256=digest.result(), warnings=tuple(warnings))


def size_of(path: Path, allow_ldr: bool = False) -> MapSize:
    """What a file's header says of its map; nothing else is read. Raises UnusableInput."""
    magic = _first_bytes(path)
    if magic == exr.MAGIC:
        return exr.size_of(path)
    if magic.startswith(radiance.MAGIC):
        return radiance.size_of(path)
    return image.size_of(path, allow_ldr)


def _open(path: Path, magic: bytes, allow_ldr: bool) -> tuple[Pixels, list[str]]:
    if magic == exr.MAGIC:
        return exr.read(path)
    if magic.startswith(radiance.MAGIC):
        return radiance.read(path), []
    return HeldPixels.of(image.read(path, allow_ldr)), []


def _first_bytes(path: Path) -> bytes:
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise UnusableInput(f"{path} is a folder, not an image.")
        if not stat.S_ISREG(mode):  # a pipe would block, a device may never end
            raise UnusableInput(f"{path} is a pipe or a device: give a file.")
        with path.open("rb") as file:
            magic = file.read(4)
    except FileNotFoundError:
        raise UnusableInput(f"{path} does not exist.") from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if not magic:
        raise UnusableInput(f"{path} is empty.")
    return magic


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> UnusableInput:
    reason = getattr(error, "strerror", None) or str(error)
    return UnusableInput(f"{path} cannot be read: {reason}.")
