"""Small valid files of every kind that we can write: what `tools.fuzz` damages.

They are written anew each time and are alike each time; nothing of them is kept in the repository.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path

import Imath
import numpy as np
import OpenEXR
import OpenImageIO as oiio
from PIL import Image

from tests.files import (
    new_runs,
    noise,
    old_runs,
    planes,
    radiance_head,
    to_rgbe,
    window,
    write_exr,
    write_parts,
)


def smooth(height: int) -> np.ndarray:
    """A map that every compression can make smaller: of noise they keep the plain bytes."""
    steps = np.round(np.linspace(1, 8, 2 * height)) / 4
    rows = np.linspace(0.5, 2, height).round(1)
    pixels = rows[:, None, None] * steps[None, :, None] * np.array([1, 0.5, 2])
    return (pixels + (noise(height) > 1)).astype(np.float32)


PIXELS = smooth(16)
PLANE = PIXELS[..., 0].copy()

COMPRESSIONS = (
    *("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"),
    *("HTJ2K256", "HTJ2K32", "ZSTD"),
)

DATE = "2000:01:01 00:00:00"
"""Else it is now, and no two runs are alike."""

Writer = Callable[[Path], object]


def valid_files(folder: Path) -> list[bytes]:
    """The bytes of all files; written into a folder that is there."""
    found = []
    with chdir(folder):  # some files say how they were called
        for name, write in writers():
            path = Path(name)
            write(path)
            if path.exists():
                found.append(path.read_bytes())
                path.unlink()
    return found


def writers() -> Iterator[tuple[str, Writer]]:
    """Names of files, no two alike, and what writes each."""
    yield from _scanlines()
    yield from _tiles()
    yield from _parts_and_deep()
    yield from _windows_and_names()
    yield from _radiance()
    yield from _others()


def _exr(channels: dict[str, np.ndarray] | np.ndarray, **header: object) -> Writer:
    return lambda path: write_exr(path, channels, **header)


def _scanlines() -> Iterator[tuple[str, Writer]]:
    for name in COMPRESSIONS:
        compression = getattr(OpenEXR, f"{name}_COMPRESSION")
        for kind in (np.float16, np.float32):
            pixels = smooth(40 if name in ("PIZ", "DWAA", "DWAB") else 16).astype(kind)
            yield f"{name}.{kind.__name__}.exr", _exr(pixels, compression=compression)
    for name in ("ZIP", "PIZ", "PXR24", "RLE"):
        compression = getattr(OpenEXR, f"{name}_COMPRESSION")
        whole = (PIXELS * 1000).astype(np.uint32)
        yield f"{name}.uint.exr", _exr(whole, compression=compression)
    mixed = planes(PIXELS) | {"G": PIXELS[..., 1].astype(np.float16), "A": PLANE}
    yield "mixed.exr", _exr(mixed)
    yield "below.exr", _exr(PIXELS, lineOrder=OpenEXR.DECREASING_Y)


def _tiles() -> Iterator[tuple[str, Writer]]:
    for name in ("NO", "ZIP", "PIZ", "B44", "DWAA"):
        compression = getattr(OpenEXR, f"{name}_COMPRESSION")
        tiles = OpenEXR.TileDescription()
        tiles.xSize = tiles.ySize = 8
        header = {"type": OpenEXR.tiledimage, "tiles": tiles, "compression": compression}
        yield f"tiles.{name}.exr", _exr(PIXELS.astype(np.float16), **header)
    for mode in (OpenEXR.LevelMode.MIPMAP_LEVELS, OpenEXR.LevelMode.RIPMAP_LEVELS):
        tiles = OpenEXR.TileDescription()
        tiles.xSize, tiles.ySize, tiles.mode = 8, 4, mode
        header = {"type": OpenEXR.tiledimage, "tiles": tiles}
        # Only the first level is in it: the others' offsets are 0.
        yield f"{mode.name}.exr", _exr(PIXELS, **header)
    for rounding in (0, 1):
        yield f"mip.{rounding}.exr", lambda path, r=rounding: _write_mip_levels(path, r)


def _write_mip_levels(path: Path, rounding: int) -> None:
    """A tiled file with all of its mip levels, whose sizes are rounded down (0) or up (1)."""
    spec = oiio.ImageSpec(32, 16, 3, oiio.HALF)
    spec.tile_width = spec.tile_height = 8
    spec.attribute("textureformat", "Plain Texture")
    spec.attribute("DateTime", DATE)
    spec.attribute("openexr:roundingmode", rounding)
    out = oiio.ImageOutput.create(str(path))
    out.open(str(path), spec)
    out.write_image(PIXELS)
    width, height = 32, 16
    while max(width, height) > 1:
        width, height = max(width // 2, 1), max(height // 2, 1)
        spec.width, spec.height = width, height
        spec.full_width, spec.full_height = width, height
        out.open(str(path), spec, "AppendMIPLevel")
        out.write_image(np.ascontiguousarray(PIXELS[:height, :width]))
    out.close()


def _parts_and_deep() -> Iterator[tuple[str, Writer]]:
    parts = [("depth", {"Z": PLANE}), ("any", planes(PIXELS))]
    yield "parts.exr", lambda path: write_parts(path, parts)
    many = [(f"ViewLayer.{n}", planes(PIXELS)) for n in ("Normal", "Combined", "Noisy")]
    yield "many parts.exr", lambda path: write_parts(path, many)
    yield "stereo.exr", _exr(PIXELS, multiView=["left", "right"], view="left")
    for kind in (OpenEXR.deepscanline, OpenEXR.deeptile):
        yield f"{kind.name}.exr", _exr(*_deep(kind)[:1], **_deep(kind)[1])
    yield "luminance and chroma.exr", _write_chroma
    yield "grey.exr", _exr({"Y": PLANE, "A": PLANE})


def _deep(kind: OpenEXR.Storage) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    samples = np.empty((8, 16), dtype=object)
    for place in np.ndindex(samples.shape):
        samples[place] = np.ones(1 + sum(place) % 2, np.float32)
    header = {"type": kind, "compression": OpenEXR.ZIPS_COMPRESSION}
    if kind == OpenEXR.deeptile:
        header["tiles"] = OpenEXR.TileDescription()
    return {channel: samples.copy() for channel in "RGB"}, header


def _write_chroma(path: Path) -> None:
    kind = Imath.PixelType(Imath.PixelType.FLOAT)
    header = OpenEXR.Header(32, 16)
    header["compression"] = Imath.Compression(Imath.Compression.NO_COMPRESSION)
    header["channels"] = {
        "Y": Imath.Channel(kind),
        "RY": Imath.Channel(kind, 2, 2),
        "BY": Imath.Channel(kind, 2, 2),
    }
    file = OpenEXR.OutputFile(str(path), header)
    chroma = np.zeros((8, 16), np.float32).tobytes()
    file.writePixels({"Y": PLANE.tobytes(), "RY": chroma, "BY": chroma})
    file.close()
    # It reads on behind these bytes, and writes what happens to lie there.
    content = path.read_bytes()
    path.write_bytes(content[:-2048] + bytes(2048))


def _windows_and_names() -> Iterator[tuple[str, Writer]]:
    yield (
        "crop.exr",
        _exr(PIXELS, dataWindow=window(14, 3, 32, 16), displayWindow=window(10, 0, 64, 32)),
    )
    yield "far.exr", _exr(PIXELS, dataWindow=window(-(2**29), 2**29, 32, 16))
    yield "envmap.exr", _exr(PIXELS, envmap=OpenEXR.ENVMAP_LATLONG)
    yield "primaries.exr", _exr(PIXELS, chromaticities=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    names = {"dots": "..", "paths": "../../x", "unicode": "ü空", "long": "n" * 200, "ends": "a\nb"}
    for name, layer in names.items():
        channels = planes(PIXELS, [f"{layer}.{c}" for c in "RGB"]) | {f"{layer}.A": PLANE}
        yield f"{name}.exr", _exr(channels)
    text = {"comments": "x" * 300, "owner": "..\\..\\ü", "capDate": "9999:99:99 99:99:99"}
    yield "texts.exr", _exr(PIXELS, pixelAspectRatio=1.0, screenWindowWidth=0.0, **text)


def _radiance() -> Iterator[tuple[str, Writer]]:
    stored = to_rgbe(PIXELS * 50)
    stored[3, 4:20] = stored[3, 4]
    upright = "-Y 16 +X 32"
    encodings = {"new": new_runs, "old": old_runs, "flat": lambda lines: lines.tobytes()}
    for name, encode in encodings.items():
        yield f"{name}.hdr", _bytes(radiance_head(upright) + encode(stored))
        columns = np.ascontiguousarray(stored.swapaxes(0, 1))
        for down in "-+":
            head = radiance_head(f"{down}X 32 -Y 16")
            yield f"{name}.columns{down}.hdr", _bytes(head + encode(columns))
        odd = ("EXPOSURE=0", "PRIMARIES=0 0 0 0 nan inf -1 1e999", "GAMMA=0", "COLORCORR=0 0 0")
        yield f"{name}.odd.hdr", _bytes(radiance_head(upright, *odd) + encode(stored))
        wide = np.tile(stored[:2], (8, 25, 1))
        yield f"{name}.wide.hdr", _bytes(radiance_head("-Y 16 +X 800") + encode(wide))
    small = stored[:2, :4]
    yield "small.hdr", _bytes(radiance_head("-Y 2 +X 4") + small.tobytes())
    xyz = radiance_head(upright, form="32-bit_rle_xyze")
    yield "xyz.hdr", _bytes(xyz + new_runs(stored))


def _bytes(content: bytes) -> Writer:
    return lambda path: path.write_bytes(content)


def _others() -> Iterator[tuple[str, Writer]]:
    """Formats that OpenImageIO tells by content, whatever they are called."""
    for compression in ("none", "zip", "lzw"):
        yield f"{compression}.tif", lambda path, c=compression: _write_other(path, oiio.FLOAT, c)
    yield "half.tif", lambda path: _write_other(path, oiio.HALF, "zip")
    for ending in ("pfm", "sgi", "dpx", "rla", "fits", "jxl", "jp2", "iff"):
        yield f"other.{ending}", lambda path: _write_other(path, oiio.FLOAT, "")
    values = (PIXELS * 50).astype(np.uint8)
    for ending in ("png", "jpg", "tif", "webp", "bmp", "tga", "gif", "ppm"):
        yield f"ldr.{ending}", lambda path: Image.fromarray(values).save(path)
    # What nothing here can write: a head that is believed, and numbers that are not.
    small = bytes(np.random.default_rng(7).integers(0, 9, 600, dtype=np.uint8))
    for name, head in HEADS.items():
        yield f"head.{name}", _bytes(head + small)


HEADS = {
    "psd": b"8BPS\0\1\0\0\0\0\0\0\0\3\0\0\0\x10\0\0\0\x20\0\x20\0\3",
    "cin": b"\x80\x2a\x5f\xd7\0\0\4\0",
    "pic": b"\x53\x80\xf6\x34",
    "dds": b"DDS \x7c\0\0\0\7\x10\0\0\x10\0\0\0\x20\0\0\0",
    "ico": b"\0\0\1\0\1\0\x20\x10",
    "zfile": b"\x2f\x08\x67\xab\0\x20\0\x10",
}


def _write_other(path: Path, kind: object, compression: str) -> None:
    out = oiio.ImageOutput.create(str(path))
    if out is None:  # a format that this version of it does not know
        oiio.geterror()
        return
    spec = oiio.ImageSpec(32, 16, 3, kind)
    spec.attribute("DateTime", DATE)
    if compression:
        spec.attribute("compression", compression)
    out.open(str(path), spec)
    out.write_image(PIXELS)
    out.close()
