"""OpenEXR files: maps in, residual maps out."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..environment import scalar_irradiance
from ..errors import UnusableInput
from ..pixels import HeldPixels, MapSize, Pixels, Strip
from ..reduction import narrowed, rows_of, total_light
from ..tolerances import HALF_ENERGY, HALF_MAXIMUM
from . import image
from .cores_of_openexr import on_all_cores
from .exr_layers import Channel, Layer, choose_layer
from .limits import (
    MAXIMUM_PIXELS,
    damaged_exr,
    refuse_absurd_size,
    too_large_for_memory,
)
from .quiet import quiet_libraries
from .strips import ExrPixels

MAGIC = b"\x76\x2f\x31\x01"

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)

MOST_EMPTY = 256
"""How many times as many pixels as are stored a frame may have: a damaged one promises anything."""

LARGEST_TILE = 2**20
"""Pixels of the largest tile that a small map is believed to have."""

Header = dict[str, Any]
Window = tuple[NDArray[np.int64], NDArray[np.int64]]
"""First and last pixel, each (x, y)."""


def read(path: Path) -> tuple[Pixels, list[str]]:
    """A map's pixels, of the file's own type, read a few rows at a time where the file allows, and
    warnings for the user.

    `exr_layers` says which channels are taken. Raises UnusableInput.
    """
    headers = _read_headers(path)
    for part in headers:  # OpenEXR reads them all
        _refuse_absurd(part, path)
    layer, warnings = choose_layer(headers, path.name)
    header = headers[layer.part]
    _check_map(header, path.name)
    warnings += _colour_warnings(header)
    pixels = _strips(path, layer, header) if len(headers) == 1 else None
    if pixels is not None:
        return pixels, warnings
    planes, remarks = _in_display_window(_read_planes(path, layer, header), header)
    return HeldPixels(planes), [*warnings, *remarks]


def size_of(path: Path) -> MapSize:
    """By its header alone. Raises UnusableInput."""
    headers = _read_headers(path)
    layer, _ = choose_layer(headers, path.name)
    header = headers[layer.part]
    cropped = _is_cropped(header)
    width, height = _size(_window(header, "displayWindow" if cropped else "dataWindow"))
    return MapSize(width, height, held=cropped or len(headers) > 1)


def is_plain(path: Path) -> bool:
    """Whether a file is one picture, all of it, so that all programs read the same of it. Raises
    UnusableInput where the file is damaged."""
    headers = _read_headers(path)
    named = any("." in channel.name for channel in headers[0]["channels"])
    return len(headers) == 1 and not named and not _is_cropped(headers[0])


def _is_cropped(header: Header) -> bool:
    window = _window(header, "dataWindow")
    return "envmap" not in header and not np.array_equal(window, _window(header, "displayWindow"))


def _strips(path: Path, layer: Layer, header: Header) -> ExrPixels | None:
    """Pixels that lie where the picture does."""
    if _is_cropped(header):
        return None
    window = _window(header, "dataWindow")
    return ExrPixels.of(path, layer.channels, _size(window), int(window[0][1]))


def _read_headers(path: Path) -> list[Header]:
    """Before the pixels: OpenEXR reads them all, and says nothing of those that it cannot read."""
    import OpenEXR

    try:
        with (
            path.open("rb") as stream,
            quiet_libraries(),
            OpenEXR.File(stream, separate_channels=True, header_only=True) as file,
        ):
            # Copied, because closing the file empties its parts; and here, because OpenEXR
            # decodes names when they are asked for, and damaged ones are no text.
            headers = [_plain(part.header) for part in file.parts]
    except (RuntimeError, ValueError, TypeError, KeyError, MemoryError, OSError) as error:
        raise damaged_exr(path.name) from error
    if not headers:
        raise damaged_exr(path.name)
    return headers


def _plain(header: Header) -> Header:
    channels = [Channel(c.name, max(c.xSampling, c.ySampling) > 1) for c in header["channels"]]
    return header | {"channels": channels}


def _refuse_absurd(header: Header, path: Path) -> None:
    """Raise UnusableInput for what would cost OpenEXR time and memory without end."""
    width, height = _size(_window(header, "dataWindow"))
    refuse_absurd_size(path.name, width, height, path.stat().st_size)
    tiles = header.get("tiles")
    columns, rows = getattr(tiles, "xSize", 0), getattr(tiles, "ySize", 0)
    # One tile may hold a whole map, with its sides rounded up to powers of two.
    if columns * rows > max(LARGEST_TILE, 4 * width * height):
        raise UnusableInput(
            f"{path.name} is damaged or no map: its header promises tiles of {columns} x {rows} "
            "pixels."
        )


def _check_map(header: Header, name: str) -> None:
    import OpenEXR

    if header.get("envmap") == OpenEXR.ENVMAP_CUBE:
        raise UnusableInput(
            f"{name} states that it is a cube map: "
            "convert it to an equirectangular (latitude-longitude) map first."
        )


def _read_planes(path: Path, layer: Layer, header: Header) -> Strip:
    import OpenEXR

    size = _size(_window(header, "dataWindow"))
    try:
        with (
            # A stream, because OpenEXR takes no name that is not Unicode.
            path.open("rb") as stream,
            quiet_libraries() as remarks,
            OpenEXR.File(stream, separate_channels=True) as file,
        ):
            found = {
                name: channel.pixels
                for part in file.parts
                if part.part_index == layer.part
                for name, channel in part.channels.items()
            }
    except MemoryError as error:
        raise too_large_for_memory(path.name, *size) from error
    except (RuntimeError, ValueError, TypeError, OSError) as error:
        raise damaged_exr(path.name) from error
    # OpenEXR leaves out what it could not read and says why in passing.
    if "MemoryError" in remarks.getvalue():
        raise too_large_for_memory(path.name, *size)
    # OpenJPH guesses what is missing of a damaged block, and says so in passing as well.
    if "ojph" in remarks.getvalue():
        raise damaged_exr(path.name)
    planes = tuple(found.get(name) for name in layer.channels)
    if any(plane is None or plane.shape != (size[1], size[0]) for plane in planes):
        raise damaged_exr(path.name)
    return planes


def _window(header: Header, name: str) -> Window:
    first, last = header[name]
    return np.asarray(first, dtype=np.int64), np.asarray(last, dtype=np.int64)


def _size(window: Window) -> tuple[int, int]:
    width, height = window[1] - window[0] + 1
    return int(width), int(height)


def _in_display_window(planes: Strip, header: Header) -> tuple[Strip, list[str]]:
    """Pixels of the whole picture: the display window is the frame, the data window may be a crop.

    Except where the header says `envmap` (then the data window is the map, by OpenEXR's rules) or
    where the display window can be no map.
    """
    data, display = _window(header, "dataWindow"), _window(header, "displayWindow")
    if "envmap" in header or all(np.array_equal(a, b) for a, b in zip(data, display, strict=True)):
        return planes, []
    width, height = _size(display)
    most = min(MAXIMUM_PIXELS, MOST_EMPTY * planes[0].size)
    if width != 2 * height or not 0 < width * height <= most:
        return planes, ["The display window is no map: the data window is taken as the whole map."]
    whole = tuple(np.zeros((height, width), plane.dtype) for plane in planes)
    first, last = np.maximum(data[0], display[0]), np.minimum(data[1], display[1])
    if (first <= last).all():
        columns, rows = (slice(a, b + 1) for a, b in zip(first, last, strict=True))
        into = _moved(rows, display[0][1]), _moved(columns, display[0][0])
        for plane, out in zip(planes, whole, strict=True):
            out[into] = plane[_moved(rows, data[0][1]), _moved(columns, data[0][0])]
    own_width, own_height = _size(data)
    return whole, [
        f"The file's {own_width} x {own_height} pixels do not lie where its {width} x {height} "
        "display window does: what is missing is black, what is outside is left out."
    ]


def _moved(part: slice, origin: int) -> slice:
    return slice(int(part.start - origin), int(part.stop - origin))


def _colour_warnings(header: Header) -> list[str]:
    stated = header.get("chromaticities")
    # Of another type than the format's, it states nothing that anyone would read.
    if not isinstance(stated, tuple) or np.allclose(np.ravel(stated), REC709, atol=2e-3):
        return []
    return ["The file states primaries other than Rec.709; its numbers are taken as they are."]


def halved(radiance: NDArray[np.float32]) -> NDArray[np.float16] | None:
    """A map as half floats, if they hold it: nothing overflows and no channel loses its energy."""
    if radiance.max() > HALF_MAXIMUM:
        return None
    half = radiance.astype(np.float16)
    whole = scalar_irradiance(radiance)
    lost = np.abs(scalar_irradiance(half) - whole)
    return half if (lost <= HALF_ENERGY * whole).all() else None


def write(
    path: Path, radiance: NDArray[np.float32], compressed: bool = True, rounded: bool = True
) -> None:
    """Write a map as half floats where they are enough, if it may be rounded, else as float32.

    radiance: (height, width, 3), linear Rec.709. compressed: without loss, which takes most of the
    time; halfs by PIZ, which takes half as long as ZIP for the same size.
    Raises OSError.
    """
    import OpenEXR

    half = halved(radiance) if rounded else None
    compression = OpenEXR.NO_COMPRESSION
    if compressed:
        compression = OpenEXR.ZIP_COMPRESSION if half is None else OpenEXR.PIZ_COMPRESSION
    header = {
        "compression": compression,
        "type": OpenEXR.scanlineimage,
        "chromaticities": REC709,
    }
    stored = np.ascontiguousarray(radiance) if half is None else half
    try:
        # Python's own stream says what is wrong, a full disk above all, and takes every name.
        with (
            path.open("wb") as stream,
            quiet_libraries(),
            on_all_cores(),
            OpenEXR.File(header, {"RGB": stored}) as file,
        ):
            file.write(stream)
    except RuntimeError as error:
        raise OSError(None, " ".join(str(error).split())) from error


def write_strips(path: Path, pixels: Pixels, half: bool) -> NDArray[np.float64]:
    """Write a map a few rows at a time, as half floats if these hold it: its scalar irradiance, of
    each channel, (3,), before it was rounded. Raises OSError."""
    if find_spec("OpenImageIO") is None:  # there is no wheel for Windows on ARM
        whole = narrowed(pixels, pixels.width)
        write(path, whole)
        return scalar_irradiance(whole)
    solid = sphere.row_solid_angles(pixels.width, pixels.height)
    total, top = np.zeros(3), 0
    with image.created(path, pixels.width, half, REC709) as file:
        for strip in pixels.strips(rows_of(pixels)):
            if half and max(plane.max() for plane in strip) > HALF_MAXIMUM:
                break
            image.write_rows(file, top, np.stack(strip, axis=-1))
            bottom = top + len(strip[0])
            total += total_light(strip, solid[top:bottom])
            top = bottom
    return total if top == pixels.height else write_strips(path, pixels, half=False)


def light_of(path: Path) -> NDArray[np.float64]:
    """Scalar irradiance of a map, of each channel, (3,). Raises UnusableInput."""
    pixels = read(path)[0]
    solid = sphere.row_solid_angles(pixels.width, pixels.height)
    total, top = np.zeros(3), 0
    for strip in pixels.strips(rows_of(pixels)):
        total += total_light(strip, solid[top : top + len(strip[0])])
        top += len(strip[0])
    return total
