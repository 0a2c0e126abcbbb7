"""Images that OpenImageIO reads: Radiance's pixels, float TIFF, and LDR pictures if allowed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import UnusableInput
from ..pixels import MapSize
from .limits import refuse_absurd_size, too_large_for_memory
from .quiet import quiet_libraries
from .tiff import is_zip_whole

if TYPE_CHECKING:
    from OpenImageIO import ImageInput, ImageOutput


def read(path: Path, allow_ldr: bool, upright: bool = True) -> NDArray[np.float32]:
    """Pixels (height, width, 3), linear. Raises UnusableInput.

    allow_ldr: take images of 8 or 16 bits too, undoing the sRGB curve.
    upright: undo an Exif orientation; False: pixels as they are stored.
    """
    with quiet_libraries():
        source = _open(path)
        try:
            linear = _check(source, path, allow_ldr)
            pixels = _read_pixels(source, path)
            spec = source.spec()
        finally:
            source.close()
    if upright:
        pixels = _upright(pixels, spec.getattribute("Orientation") or 1)
    colour = pixels[..., [0, 0, 0]] if spec.nchannels < 3 else pixels[..., :3]
    return np.ascontiguousarray(colour if linear else _from_srgb(colour))


def size_of(path: Path, allow_ldr: bool) -> MapSize:
    """By its header alone. Raises UnusableInput."""
    with quiet_libraries():
        source = _open(path)
        try:
            _check(source, path, allow_ldr)
            spec = source.spec()
        finally:
            source.close()
    turned = (spec.getattribute("Orientation") or 1) >= 5
    width, height = (spec.height, spec.width) if turned else (spec.width, spec.height)
    return MapSize(width, height, held=True)


@contextmanager
def opened(path: Path) -> Iterator[ImageInput]:
    """A file of linear light for `read_rows`. Raises UnusableInput."""
    with quiet_libraries():
        source = _open(path)
    try:
        _check(source, path, allow_ldr=False)
        yield source
    finally:
        source.close()


def read_rows(source: ImageInput, name: str, top: int, bottom: int) -> NDArray[np.float32]:
    """Red, green and blue of some rows, (bottom - top, width, 3). Raises UnusableInput."""
    import OpenImageIO as oiio

    spec = source.spec()
    try:
        with quiet_libraries():
            pixels = source.read_scanlines(top, bottom, 0, 0, 3, oiio.FLOAT)
    except MemoryError as error:
        raise too_large_for_memory(name, spec.width, spec.height) from error
    _raise_if_damaged(pixels, source, name)
    return pixels


@contextmanager
def created(
    path: Path, width: int, half: bool, primaries: tuple[float, ...]
) -> Iterator[ImageOutput]:
    """An .exr file of a map for `write_rows`. Raises OSError."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(width, width // 2, 3, "half" if half else "float")
    spec["compression"] = "piz" if half else "zip"
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), primaries)
    try:
        with quiet_libraries():
            file = oiio.ImageOutput.create(str(path))
            _raise_if_unwritten(file is not None and file.open(str(path), spec), file)
    except TypeError as error:
        raise OSError(None, "its name is not Unicode") from error
    try:
        yield file
    finally:
        with quiet_libraries():
            file.close()


def write_rows(file: ImageOutput, top: int, pixels: NDArray[np.float32]) -> None:
    """Rows that begin with this one, (rows, width, 3). Raises OSError."""
    with quiet_libraries():
        done = file.write_scanlines(top, top + len(pixels), 0, pixels)
    _raise_if_unwritten(done, file)


def _raise_if_unwritten(done: bool, file: ImageOutput | None) -> None:
    import OpenImageIO as oiio

    if not done:
        reason = file.geterror() if file else oiio.geterror()
        raise OSError(None, " ".join(reason.split()) or "there is no room for it")


def _open(path: Path) -> ImageInput:
    try:
        import OpenImageIO as oiio
    except ImportError as error:  # there is no wheel for Windows on ARM
        raise UnusableInput(
            f"{path.name} needs OpenImageIO, which is not installed here: give an .exr map."
        ) from error

    try:
        source = oiio.ImageInput.open(str(path))
    except TypeError as error:
        raise UnusableInput(f"{path.name} has a name that is not Unicode: rename it.") from error
    if source is None:
        oiio.geterror()  # else OpenImageIO prints it when the program ends
        raise UnusableInput(
            f"{path.name} is not an image that can be read here, or its header is damaged: "
            "give an .exr or .hdr map."
        )
    return source


def _check(source: ImageInput, path: Path, allow_ldr: bool) -> bool:
    """Whether an image holds linear light. Raises UnusableInput for one that must not be read."""
    import OpenImageIO as oiio

    spec = source.spec()
    refuse_absurd_size(path.name, spec.width, spec.height, path.stat().st_size)
    linear = spec.format.basetype in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE)
    if not linear and not allow_ldr:
        raise UnusableInput(
            f"{path.name} is an LDR image ({spec.format} values, no linear light): use the "
            "HDR version of the map, or --allow-ldr to take it as sRGB."
        )
    return linear


def _read_pixels(source: ImageInput, path: Path) -> NDArray[np.float32]:
    import OpenImageIO as oiio

    spec = source.spec()
    try:
        pixels = source.read_image(oiio.FLOAT)
    except MemoryError as error:
        raise too_large_for_memory(path.name, spec.width, spec.height) from error
    if _is_zip(source) and not is_zip_whole(path):
        pixels = None
    _raise_if_damaged(pixels, source, path.name)
    return pixels


def _raise_if_damaged(pixels: NDArray[np.float32] | None, source: ImageInput, name: str) -> None:
    problem = source.geterror()
    if pixels is None or problem:
        reason = (problem.splitlines() or ["its pixels end too early"])[0].strip()
        raise UnusableInput(f"{name} is truncated or damaged ({reason}).")


def _is_zip(source: ImageInput) -> bool:
    is_tiff = source.format_name() == "tiff"
    return is_tiff and "zip" in (source.spec().getattribute("compression") or "")


def _upright(pixels: NDArray[np.float32], orientation: int) -> NDArray[np.float32]:
    """Undo an Exif orientation."""
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
    # Stored rows and columns run, as seen: 2 and 3 leftwards, 3 and 4 upwards; 6 and 7 leftwards,
    # 7 and 8 upwards once their rows and columns have changed places.
    leftwards, upwards = {2: (1, 0), 3: (1, 1), 4: (0, 1), 6: (1, 0), 7: (1, 1), 8: (0, 1)}.get(
        orientation, (0, 0)
    )
    return pixels[:: -1 if upwards else 1, :: -1 if leftwards else 1]


def _from_srgb(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """IEC 61966-2-1, display-referred 0 to 1 to linear 0 to 1."""
    low = values / 12.92
    high = ((np.maximum(values, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, low, high).astype(np.float32)
