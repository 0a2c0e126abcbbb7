"""The maps that Blender's images hold, and images for maps that a conversion has made."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.environment import EnvironmentMap, environment_from_strips
from ..core.errors import CannotWrite, UnusableInput
from ..core.files import exr
from ..core.files.maps import load
from ..core.pixels import HeldPixels, Pixels
from ..core.progress import Progress
from ..core.residual import LevelledPixels
from .known import known_file, known_map
from .steps import Apart, Steps
from .trace import TAG

UNCOMPRESSED, UNROUNDED = 1024, 512
"""Pixels of a map's width up to which it is packed uncompressed, as half floats where these are
enough, 6 MB at most; and up to which it is packed as float32, 1.5 MB."""

LINEAR_SPACES = ("Linear ", "Non-Color", "ACEScg", "ACES2065-1", "scene_linear")
"""How the names of colour spaces begin in which numbers are light."""

AS_IT_IS = "Linear Rec.709"
"""The colour space whose numbers are what a file holds, and what the core takes them for."""

EXR = b"\x76\x2f\x31\x01"
"""How an EXR file begins."""

READ = 0.3
"""Of the time of a conversion, about, for reading."""

Radiance = NDArray[np.float32] | LevelledPixels


def read_image(image: bpy.types.Image) -> Steps[EnvironmentMap]:
    """What a renderer sees of an image, whether it is a file, packed or generated.

    Raises UnusableInput.
    """
    _check_single(image)
    name, path = image.name, _file_of(image)
    if path is not None:
        found = yield Apart(lambda listen, _: _of_file(path, name, listen), 0.0, READ)
        if found is not None:
            return found
    pixels = _pixels_of(image)
    shape = image.size[1], image.size[0], image.channels
    return (
        yield Apart(
            lambda *_: known_map(pixels, name, lambda: _from_pixels(pixels, shape, name)), 0.0, READ
        )
    )


def _check_single(image: bpy.types.Image) -> None:
    if image.source in ("SEQUENCE", "MOVIE", "TILED"):
        raise UnusableInput(f'"{image.name}" is a {image.source.lower()}: use a single image.')


def unrepaired_pixels(image: bpy.types.Image, folder: Path) -> Pixels:
    """All pixels that a renderer sees of an image, as they are; Blender need not load those of an
    EXR file, packed or not. folder: for a file that the pixels may be read from as long as it is
    there. Raises UnusableInput, CannotWrite."""
    _check_single(image)
    path = _file_of(image) or _unpacked(image, folder)
    if path is not None and path.suffix.lower() == ".exr" and exr.is_plain(path):
        return exr.read(path)[0]
    pixels = _pixels_of(image)
    return HeldPixels.of(_colour_of(pixels, (image.size[1], image.size[0], image.channels)))


def _unpacked(image: bpy.types.Image, folder: Path) -> Path | None:
    """A packed EXR whose pixels are the image's as they are, as a file; None for all else."""
    if image.source != "FILE" or not image.packed_file or image.is_dirty:
        return None
    if image.colorspace_settings.name != working_space():
        return None
    data = image.packed_file.data
    if not data.startswith(EXR):
        return None
    path = folder / "unpacked.exr"
    try:
        path.write_bytes(data)
    except OSError as error:
        raise CannotWrite(
            f'Cannot write "{image.name}" into a temporary folder: {error.strerror}.'
        ) from error
    return path


def _of_file(path: Path, name: str, progress: Progress) -> EnvironmentMap | None:
    """The map of a file; None where Blender may read it in another way than the core does."""
    if path.suffix.lower() == ".exr" and not exr.is_plain(path):
        return None
    if path.suffix.lower() == ".hdr" and find_spec("OpenImageIO") is None:
        return None  # it is not to be had for all that Blender runs on

    def read() -> EnvironmentMap:
        return replace(load(path, progress=progress), name=Path(name).stem, file=name)

    return known_file(path, name, read)


def _from_pixels(
    pixels: NDArray[np.float32], shape: tuple[int, int, int], name: str
) -> EnvironmentMap:
    held = HeldPixels.of(_colour_of(pixels, shape))
    return environment_from_strips(held, Path(name).stem, name)


def _colour_of(pixels: NDArray[np.float32], shape: tuple[int, int, int]) -> NDArray[np.float32]:
    """Rows downwards, three channels, of numbers in Blender's order."""
    pixels = pixels.reshape(shape)[::-1]
    return pixels[..., :3] if shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)


def _file_of(image: bpy.types.Image) -> Path | None:
    """The file whose pixels are the image's as they are: then Blender need not hold them."""
    if image.source != "FILE" or image.packed_file or image.is_dirty:
        return None
    if image.has_data and not (image.is_float and image.type == "IMAGE"):
        return None
    if image.colorspace_settings.name != AS_IT_IS or working_space() != AS_IT_IS:
        return None
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    if path.suffix.lower() not in (".exr", ".hdr") or not path.is_file():
        return None
    return path


def _pixels_of(image: bpy.types.Image) -> NDArray[np.float32]:
    """All numbers of an image, in Blender's order."""
    width, height = image.size  # which loads it, and only then is its type known
    if image.type == "MULTILAYER":
        raise UnusableInput(
            f'"{image.name}" is a multilayer EXR: save its combined pass as a plain EXR first.'
        )
    if not image.has_data and not width * height:
        raise UnusableInput(
            f'The image "{image.name}" cannot be loaded from {image.filepath or "anywhere"}: '
            "find the missing file first (File > External Data)."
        )
    if not image.is_float:
        raise UnusableInput(
            f'"{image.name}" is an LDR image without linear light: use the HDR version of the map.'
        )
    space = image.colorspace_settings.name
    if not space.startswith(LINEAR_SPACES):
        raise UnusableInput(
            f'"{image.name}" is read as {space}, in which numbers are not light: '
            "set its colour space to Linear Rec.709 (or what the file was made in)."
        )
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels


@contextmanager
def folder_for_maps() -> Iterator[Path]:
    """A folder for `write_map`, which goes away afterwards. Raises CannotWrite."""
    try:
        made = tempfile.TemporaryDirectory(prefix="sunsplit-")
    except OSError as error:
        raise CannotWrite(f"Cannot make a temporary folder: {error.strerror}.") from error
    with made as name:
        yield Path(name)


def write_map(folder: Path, kind: str, radiance: Radiance) -> Path:
    """A map as a file for `packed_image`; needs no Blender. Raises CannotWrite.

    kind: what it is; the image's name in a conversion.
    """
    path = folder / f"{kind}.exr"
    try:
        if isinstance(radiance, LevelledPixels):
            half = exr.halved(radiance.residual) is not None
            exr.write_strips(path, radiance, half)
        else:  # small maps are written often, and as fast as may be
            width = radiance.shape[1]
            exr.write(path, radiance, width > UNCOMPRESSED, width > UNROUNDED)
    except OSError as error:
        raise CannotWrite(
            f"Cannot write the {kind} map into a temporary folder: {error.strerror}."
        ) from error
    return path


def packed_image(path: Path) -> bpy.types.Image:
    """A file of `write_map` as an image that travels inside the .blend file."""
    # Our own writer and Blender's packing keep the values; Image.save() would encode them.
    image = bpy.data.images.load(str(path))
    image.pack()
    image.filepath_raw = ""
    image.colorspace_settings.name = working_space()
    image[TAG] = path.stem
    return image


def remove_images(images: Mapping[str, bpy.types.Image]) -> None:
    """Take images away that nothing uses."""
    for image in images.values():
        if not image.users:
            bpy.data.images.remove(image)


def working_space() -> str:
    """What `Image.pixels` are in: scene linear, which Blender 5 lets the user choose."""
    settings = getattr(bpy.data, "colorspace", None)
    return settings.working_space if settings else "Linear Rec.709"
