"""What no honest file exceeds: damaged headers promise anything."""

from __future__ import annotations

from pathlib import Path

from ..errors import CannotWrite, UnusableInput

MAXIMUM_PIXELS = 2**31
"""65,536 x 32,768, twice as wide as the largest maps that are sold."""


def refuse_absurd_size(name: str, width: int, height: int) -> None:
    """Raise UnusableInput before anyone asks for memory for it."""
    if width < 1 or height < 1 or width * height > MAXIMUM_PIXELS:
        raise UnusableInput(
            f"{name} is damaged or no map: its header promises {width} x {height} pixels."
        )


def too_large_for_memory(name: str, width: int, height: int) -> UnusableInput:
    """The error for a size that may be honest, but not on this machine."""
    return UnusableInput(f"{name}, {width} x {height} pixels, does not fit into memory.")


def damaged_exr(name: str) -> UnusableInput:
    """The error for what OpenEXR stumbles over."""
    return UnusableInput(f"{name} is truncated or damaged: OpenEXR cannot read it.")


def cannot_write(folder: Path, error: Exception) -> CannotWrite:
    """The error for a folder that takes no file."""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())
    return CannotWrite(f"Cannot write into {folder}: {reason}. Nothing was changed.")
