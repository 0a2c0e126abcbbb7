"""Radiance .hdr files: the header is read here, the pixels by OpenImageIO where it can.

OpenImageIO reads today's runs. Flat pixels and the runs of Radiance 1 are decoded here: it takes
their run marks for pixels. The scan order is read here too: it swaps two of the eight.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..environment import working_width
from ..errors import UnusableInput
from ..pixels import HeldPixels, MapSize, Pixels
from . import image
from .limits import refuse_absurd_size
from .strips import HdrPixels

MAGIC = b"#?"

LONGEST_HEADER = 1 << 16

NEW_RUNS = range(8, 32768)
"""Lengths of scanlines that may be stored in today's runs."""

EXPONENT_OFFSET = 136
"""Mantissas are bytes (2^8) and exponents are stored with 128 added."""

_RESOLUTION = re.compile(rb"([-+])([XY])\s+(\d{1,10})\s+([-+])([XY])\s+(\d{1,10})\s*")


@dataclass(frozen=True)
class _Header:
    """scanlines, length: how the pixels are stored. start: offset of the first scanline."""

    scanlines: int
    length: int
    by_columns: bool
    upwards: bool
    leftwards: bool
    start: int

    @property
    def is_upright(self) -> bool:
        return not (self.by_columns or self.upwards or self.leftwards)

    @property
    def width(self) -> int:
        return self.scanlines if self.by_columns else self.length

    @property
    def height(self) -> int:
        return self.length if self.by_columns else self.scanlines


def read(path: Path) -> Pixels:
    """Linear pixels, upright; a wide map's are read a few rows at a time. Raises UnusableInput.

    EXPOSURE, PRIMARIES and the like are left alone, as Blender does: many programs write nonsense
    there, and a constant factor changes no split.
    """
    head, header = _head_of(path)
    if path.stat().st_size - header.start < _least_bytes(header):
        raise _truncated(path.name)
    if _has_new_runs(head, header):
        if _is_read_in_strips(head, header):
            return HdrPixels(path, header.width, header.height)
        stored = image.read(path, allow_ldr=False, upright=False)
    else:
        stored = _from_rgbe(_read_old(path, header))
    if stored.shape != (header.scanlines, header.length, 3):
        raise UnusableInput(f"{path.name} is damaged: its pixels do not fill its frame.")
    return HeldPixels.of(_upright(stored, header))


def size_of(path: Path) -> MapSize:
    """By its header alone. Raises UnusableInput."""
    head, header = _head_of(path)
    return MapSize(header.width, header.height, held=not _is_read_in_strips(head, header))


def _head_of(path: Path) -> tuple[bytes, _Header]:
    """A file's first bytes and its header in them."""
    with path.open("rb") as file:
        head = file.read(LONGEST_HEADER + 4)
    header = _read_header(head, path.name)
    refuse_absurd_size(path.name, header.width, header.height)
    return head, header


def _is_read_in_strips(head: bytes, header: _Header) -> bool:
    wide = working_width(header.width) < header.width
    return wide and header.is_upright and _has_new_runs(head, header)


def _read_header(head: bytes, name: str) -> _Header:
    lines, blank, rest = _until_blank_line(head)
    found = _RESOLUTION.match(rest.partition(b"\n")[0] + b"\n") if blank else None
    if found is None or found[2] == found[5]:
        raise UnusableInput(f"{name} is truncated or damaged: its Radiance header has no size.")
    stated = next((line[7:].strip() for line in lines if line.startswith(b"FORMAT=")), b"")
    if b"xyze" in stated:
        raise UnusableInput(
            f"{name} stores CIE XYZ colours (32-bit_rle_xyze): convert it to RGB first, "
            "for instance with Radiance's ra_xyze -r."
        )
    signs = {found[2]: found[1], found[5]: found[4]}
    return _Header(
        scanlines=int(found[3]),
        length=int(found[6]),
        by_columns=found[2] == b"X",
        upwards=signs[b"Y"] == b"+",
        leftwards=signs[b"X"] == b"-",
        start=len(head) - len(rest) + rest.index(b"\n") + 1,
    )


def _until_blank_line(head: bytes) -> tuple[list[bytes], bool, bytes]:
    """The header's lines, whether a blank line ended them and another followed, and the rest."""
    lines, rest = [], head
    while b"\n" in rest:
        line, _, rest = rest.partition(b"\n")
        if not line.strip():
            return lines, b"\n" in rest, rest
        lines.append(line)
    return lines, False, b""


def _has_new_runs(head: bytes, header: _Header) -> bool:
    first, length = head[header.start : header.start + 4], header.length
    return length in NEW_RUNS and first[:2] == b"\2\2" and first[2:] == length.to_bytes(2, "big")


def _least_bytes(header: _Header) -> int:
    """What the shortest file of this size has: runs of 127 today, of 2^32 formerly."""
    return 4 * header.scanlines


def _truncated(name: str) -> UnusableInput:
    return UnusableInput(f"{name} is truncated: its pixels end too early.")


def _read_old(path: Path, header: _Header) -> NDArray[np.uint8]:
    """RGBE of flat pixels or the first Radiance's runs, (scanlines, length, 4).

    A record of 1, 1, 1, n repeats the pixel before it n times; a second such record in a row
    counts 256 times as much, and so on.
    """
    records = np.fromfile(path, np.uint8, offset=header.start)
    records = records[: len(records) // 4 * 4].reshape(-1, 4)
    marks = (records[:, :3] == 1).all(axis=1)
    index = np.arange(len(records))
    source = np.maximum.accumulate(np.where(marks, -1, index))
    place = np.minimum(index - source - 1, 3) * marks
    repeats = np.where(marks, records[:, 3].astype(np.int64) << 8 * place, 1)
    total = np.cumsum(repeats)
    wanted = header.scanlines * header.length
    if not len(records) or total[-1] < wanted:
        raise _truncated(path.name)
    if source[0] < 0:
        raise UnusableInput(f"{path.name} is damaged: it begins with the repetition of nothing.")
    end = int(np.searchsorted(total, wanted))
    repeats[end] -= total[end] - wanted
    pixels = records[np.repeat(source[: end + 1], repeats[: end + 1])]
    return pixels.reshape(header.scanlines, header.length, 4)


def _from_rgbe(stored: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Shared exponent to float, with no half added to the mantissas: as OpenImageIO and Blender."""
    exponent = stored[..., 3:].astype(np.int32)
    value = np.ldexp(stored[..., :3].astype(np.float32), exponent - EXPONENT_OFFSET)
    return np.where(exponent > 0, value, np.float32(0))


def _upright(stored: NDArray[np.float32], header: _Header) -> NDArray[np.float32]:
    pixels = stored.swapaxes(0, 1) if header.by_columns else stored
    rows = slice(None, None, -1 if header.upwards else 1)
    columns = slice(None, None, -1 if header.leftwards else 1)
    return pixels[rows, columns]
