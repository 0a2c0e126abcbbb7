"""What a user may choose about a whole library."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ..settings import BadSetting, ConversionSettings

HDR, LDR = ("*.exr", "*.hdr"), ("*.png", "*.jpg", "*.jpeg", "*.tif", "*.tiff")
"""Names that maps have; the second ones are taken where LDR images are allowed."""

LARGEST = 16384
"""Pixels of width: the light of a map is known well enough by then."""

Assets = Literal["each", "one"]


@dataclass(frozen=True)
class LibraryOptions:
    """How to convert a library.

    settings: of each conversion. preview: write `<stem>.preview.png` too. allow_ldr: take 8 and 16
        bit images as sRGB.
    include, exclude: patterns of names, or where they have a slash of paths in the library; case
        does not matter. Without any, `*.exr` and `*.hdr` are included.
    sizes: widths in pixels in which each map is written, with a residual of that width ("own" and a
        number in `settings` hold it down to that), "all" those that there are files of, or () for
        one conversion as `settings` say. A map narrower than all of them is written as it is.
    largest: of several sizes of a map the largest that is at most so wide is the one that is
        looked at.
    assets: a .blend file for "each" map, or "one" for all, or None. pack: images go into these.
    """

    settings: ConversionSettings = field(default_factory=ConversionSettings)
    preview: bool = False
    allow_ldr: bool = False
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    sizes: tuple[int, ...] | Literal["all"] = ()
    largest: int = LARGEST
    assets: Assets | None = None
    pack: bool = False

    def __post_init__(self) -> None:
        if self.sizes != "all" and any(width < 2 or width % 2 for width in self.sizes):
            raise BadSetting("sizes must be even numbers from 2 up.")
        if self.largest < 2:
            raise BadSetting(f"largest must be at least 2, not {self.largest}.")

    @property
    def included(self) -> tuple[str, ...]:
        """Patterns of what is taken for a map."""
        return self.include or (HDR + LDR if self.allow_ldr else HDR)
