"""Whether a TIFF's pixels are whole where OpenImageIO does not say so.

OpenImageIO unpacks "zip" strips and tiles itself and passes on what was in memory where one is
damaged or too short. They carry a checksum, so they can be unpacked once more.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

WIDTH, HEIGHT, BITS, COLOURS = 256, 257, 258, 262
PIECES = ((273, 279), (324, 325))
"""Tags of a TIFF: offsets and lengths of its packed strips, or of its tiles."""

SUBSAMPLED = 6
"""Colours, YCbCr, that have fewer bytes than pixels."""

PART = 1 << 20
"""Bytes that are unpacked at a time: a damaged piece may promise any number."""


def is_zip_whole(path: Path) -> bool:
    """Whether a zip-packed TIFF's first image can be unpacked to all its bytes. Raises OSError.

    Pillow, which finds the pieces, does not know the large TIFFs that begin with the highest byte:
    those are taken for whole.
    """
    try:
        tags = _tags(path)
        if not tags:
            return True
        bits = 0 if tags.get(COLOURS) == SUBSAMPLED else sum(tags.get(BITS, (1,)))
        return 8 * _unpacked(path, tags) >= tags[WIDTH] * tags[HEIGHT] * bits
    except (zlib.error, struct.error, SyntaxError, ValueError, TypeError, KeyError, EOFError):
        return False


def _tags(path: Path) -> dict[int, Any]:
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    with path.open("rb") as file, warnings.catch_warnings(action="ignore"):
        head = file.read(8)
        if head[:4] == b"MM\0+":
            return {}
        tags = ImageFileDirectory_v2(head + file.read(8) if head[2] == 43 else head)
        file.seek(tags.next)
        tags.load(file)
        return dict(tags)


def _unpacked(path: Path, tags: dict[int, Any]) -> int:
    """Bytes that all pieces hold, once each has been unpacked. Raises zlib.error, EOFError."""
    total = 0
    with path.open("rb") as file:
        for offsets, lengths in PIECES:
            for offset, length in zip(tags.get(offsets, ()), tags.get(lengths, ()), strict=True):
                file.seek(offset)
                total += _length(file.read(length))
    return total


def _length(packed: bytes) -> int:
    unpacker, total = zlib.decompressobj(), 0
    while not unpacker.eof:
        part = unpacker.decompress(packed, PART)
        packed = unpacker.unconsumed_tail
        total += len(part)
        if not part and not packed and not unpacker.eof:
            raise EOFError("the piece ends too early")
    return total
