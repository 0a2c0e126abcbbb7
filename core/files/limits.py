"""What no honest file exceeds: damaged headers promise anything."""

from __future__ import annotations

from ..errors import UnusableInput

MAXIMUM_PIXELS = 2**31
"""65,536 x 32,768, twice as wide as the largest maps that are sold."""


MOST_PIXELS_PER_BYTE = 2**14
"""No compression makes maps so small, not even black ones."""


def refuse_absurd_size(name: str, width: int, height: int, file_size: int | None = None) -> None:
    """Raise UnusableInput before anyone asks for memory for it. file_size: bytes, if they count."""
    promise = f"{name} is damaged or no map: its header promises {width} x {height} pixels"
    if width < 1 or height < 1 or width * height > MAXIMUM_PIXELS:
        raise UnusableInput(f"{promise}.")
    if file_size is not None and width * height > MOST_PIXELS_PER_BYTE * file_size:
        raise UnusableInput(f"{promise} in {file_size} bytes.")


def too_large_for_memory(name: str, width: int, height: int) -> UnusableInput:
    """The error for a size that may be honest, but not on this machine."""
    return UnusableInput(f"{name}, {width} x {height} pixels, does not fit into memory.")


def damaged_exr(name: str) -> UnusableInput:
    """The error for what OpenEXR stumbles over."""
    return UnusableInput(f"{name} is truncated or damaged: OpenEXR cannot read it.")
