"""Wide maps from files, a few rows at a time: what is not held needs no memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..pixels import Strip
from . import image
from .cores_of_openexr import on_all_cores
from .limits import damaged_exr, too_large_for_memory
from .quiet import quiet_libraries

if TYPE_CHECKING:
    from OpenEXR import InputFile

UNREADABLE = (RuntimeError, ValueError, TypeError, KeyError, OSError)
"""What OpenEXR raises for files that it cannot read."""


FEW_PACKED = 32
"""Rows, at most, that a compression packs together unless it is one of these."""

MANY_PACKED = {"DWAB_COMPRESSION": 256, "HTJ2K256_COMPRESSION": 256}
"""The same of those that pack more, by OpenEXR's names."""

_NUMPY = {"HALF": np.dtype(np.float16), "FLOAT": np.dtype(np.float32)}


@dataclass(frozen=True)
class ExrPixels:
    """The pixels of an OpenEXR file of one part; see `pixels.Pixels`.

    channels: names of red, green and blue. first: row of the data window. pixel: the type that all
    three are stored in. packed_rows: see `pixels.Pixels`.
    """

    path: Path
    channels: tuple[str, str, str]
    width: int
    height: int
    first: int
    pixel: np.dtype
    packed_rows: int

    @classmethod
    def of(
        cls, path: Path, channels: tuple[str, str, str], size: tuple[int, int], first: int
    ) -> ExrPixels | None:
        """None where they can only be read as a whole. Raises UnusableInput."""
        import OpenEXR

        # OpenEXR calls this reader deprecated, and it takes no name that is not Unicode.
        if not hasattr(OpenEXR, "InputFile") or not _is_unicode(path):
            return None
        with _opened(path) as file:
            header = file.header()
        types = {str(header["channels"][name].type) for name in channels}
        pixel = _NUMPY.get(types.pop()) if len(types) == 1 else None
        packed = _packed_rows(header)
        return cls(path, channels, *size, first, pixel, packed) if pixel else None

    @property
    def least_rows(self) -> int:
        return 1

    def strips(self, rows: int) -> Iterator[Strip]:
        """See `Pixels`. Raises UnusableInput."""
        with _opened(self.path) as file:
            for top in range(0, self.height, rows):
                yield self._read(file, top, min(top + rows, self.height))

    def _read(self, file: InputFile, top: int, bottom: int) -> Strip:
        try:
            with quiet_libraries() as remarks:
                # Each once: a channel that is asked for again, as that of a grey map, is garbage.
                names = sorted(set(self.channels))
                stored = file.channels(
                    names, scanLine1=self.first + top, scanLine2=self.first + bottom - 1
                )
        except MemoryError as error:
            raise too_large_for_memory(self.path.name, self.width, self.height) from error
        except UNREADABLE as error:
            raise damaged_exr(self.path.name) from error
        shape = bottom - top, self.width
        # OpenJPH guesses what is missing of a damaged block, and says so in passing.
        guessed = "ojph" in remarks.getvalue()
        if guessed or any(len(one) != shape[0] * shape[1] * self.pixel.itemsize for one in stored):
            raise damaged_exr(self.path.name)
        planes = {
            name: np.frombuffer(one, self.pixel).reshape(shape)
            for name, one in zip(names, stored, strict=True)
        }
        return tuple(planes[name] for name in self.channels)


def _packed_rows(header: dict[str, Any]) -> int:
    """Of a file with such a header; tiles may have any height."""
    import OpenEXR

    tiles = header.get("tiles")
    if tiles is not None:
        return tiles.ySize
    # By number, as the header's own words are fewer than there are compressions.
    number = header["compression"].v
    found = (rows for name, rows in MANY_PACKED.items() if int(getattr(OpenEXR, name)) == number)
    return next(found, FEW_PACKED)


def _is_unicode(path: Path) -> bool:
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


@contextmanager
def _opened(path: Path) -> Iterator[InputFile]:
    import OpenEXR

    with ExitStack() as stack:
        stack.enter_context(on_all_cores())
        try:
            # By its name: many threads cannot read from one stream of Python's.
            with quiet_libraries():
                file = OpenEXR.InputFile(str(path))
        except UNREADABLE as error:
            raise damaged_exr(path.name) from error
        stack.callback(file.close)
        yield file


@dataclass(frozen=True)
class HdrPixels:
    """The pixels of a Radiance file with today's runs, upright; see `pixels.Pixels`."""

    path: Path
    width: int
    height: int

    @property
    def least_rows(self) -> int:
        return 1

    @property
    def packed_rows(self) -> int:
        return 1

    def strips(self, rows: int) -> Iterator[Strip]:
        """See `Pixels`. Raises UnusableInput."""
        with image.opened(self.path) as source:
            for top in range(0, self.height, rows):
                bottom = min(top + rows, self.height)
                pixels = image.read_rows(source, self.path.name, top, bottom)
                yield tuple(np.moveaxis(pixels, -1, 0))
