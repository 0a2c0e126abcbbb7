"""Large maps made of small real ones, with detail of their own: what a benchmark of size reads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sunsplit.core.files.maps import load

ROWS = 64
"""Of a large map, made and written at a time."""

GRAIN = 0.1
"""Standard deviation of the detail, as a part of the radiance: about a photograph's grain and
leaves."""

BRIGHTEST = 30_000.0
"""Brighter maps are dimmed to this, so that no grain on it is more than a half float holds."""


@dataclass(frozen=True)
class Kind:
    """How a file stores its pixels. pixel: "half" or "float"; an .hdr has its own."""

    ending: str
    pixel: str = ""
    compression: str = ""

    @property
    def name(self) -> str:
        return " ".join(part for part in (self.ending, self.pixel, self.compression) if part)


KINDS = (
    Kind("hdr"),
    Kind("exr", "half", "zip"),
    Kind("exr", "half", "piz"),
    Kind("exr", "half", "dwab"),
    Kind("exr", "float", "zip"),
)


def enlarged(
    source: Path, width: int, brightest: float = np.inf, grain: float = GRAIN
) -> Iterator[NDArray[np.float32]]:
    """A map at another width, ROWS rows at a time (fewer at the end): bilinear between the small
    map's pixels, times grain. A map that is brighter is dimmed."""
    small = load(source).radiance
    small = small * np.float32(min(brightest / small.max(), 1))
    random = np.random.default_rng(width)
    height, factor = width // 2, width / small.shape[1]
    column = (np.arange(width) + 0.5) / factor - 0.5
    left = np.floor(column).astype(int)
    across = (column - left).astype(np.float32)[:, None]
    for top in range(0, height, ROWS):
        row = (np.arange(top, min(top + ROWS, height)) + 0.5) / factor - 0.5
        above = np.floor(row).astype(int)
        down = (row - above).astype(np.float32)[:, None, None]
        last = small.shape[0] - 1
        lines = small[np.clip(above, 0, last)] * (1 - down)
        lines += small[np.clip(above + 1, 0, last)] * down
        strip = lines[:, left % small.shape[1]] * (1 - across)
        strip += lines[:, (left + 1) % small.shape[1]] * across
        if grain:
            noise = random.standard_normal((*strip.shape[:2], 1), dtype=np.float32)
            strip *= np.exp(np.float32(grain) * noise - np.float32(grain**2 / 2))
        yield strip


def make(source: Path, width: int, kind: Kind, path: Path, grain: float = GRAIN) -> None:
    """Write an enlarged map."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(width, width // 2, 3, kind.pixel or "float")
    if kind.compression:
        spec["compression"] = kind.compression
    out = oiio.ImageOutput.create(str(path))
    if not out or not out.open(str(path), spec):
        raise OSError(oiio.geterror())
    top = 0
    brightest = BRIGHTEST if kind.pixel == "half" else np.inf
    for strip in enlarged(source, width, brightest, grain):
        out.write_scanlines(top, top + len(strip), 0, strip)
        top += len(strip)
    out.close()
