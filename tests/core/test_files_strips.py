"""Wide files are read a few rows at a time, and are the same as if read at once."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from sunsplit.core.conversion import convert
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.errors import UnusableInput
from sunsplit.core.files import exr, strips
from sunsplit.core.files.conversion import account_of_files, save
from sunsplit.core.files.maps import load
from sunsplit.core.pixels import whole
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.tolerances import ACCOUNT, ACCOUNT_FLOAT32, ACCOUNT_HALF
from tests.files import noise
from tools.fuzz_mutations import attributes

WIDTH = 2048


@pytest.fixture(scope="module")
def pixels() -> np.ndarray:
    return noise(WIDTH // 2) * np.float32(50)


def write_exr(path: Path, pixels: np.ndarray, compression: str) -> None:
    header = {
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
        "type": OpenEXR.scanlineimage,
    }
    with OpenEXR.File(header, {"RGB": pixels}) as file:
        file.write(str(path))


def write_image(path: Path, pixels: np.ndarray, tile: int = 0, levels: bool = False) -> None:
    """By OpenImageIO: .hdr, or a tiled .exr."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "half")
    spec.tile_width = spec.tile_height = tile
    if levels:
        image = oiio.ImageBuf(pixels)
        config = oiio.ImageSpec()
        config.attribute("maketx:filtername", "box")
        config.tile_width = config.tile_height = tile
        config.set_format("half")
        assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, image, str(path), config)
        return
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(pixels), out.geterror()
    out.close()


def stored(path: Path) -> np.ndarray:
    """All pixels at once, by OpenImageIO."""
    source = oiio.ImageInput.open(str(path))
    found = source.read_image(oiio.FLOAT)
    source.close()
    return found[..., :3]


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "DWAA", "DWAB"])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_rows_of_an_exr_are_those_of_the_whole(tmp_path, pixels, compression, kind):
    path = tmp_path / "map.exr"
    write_exr(path, pixels.astype(kind), compression)
    found, warnings = exr.read(path)
    assert isinstance(found, strips.ExrPixels)
    assert found.pixel == kind
    assert warnings == []
    rows = [np.stack(strip, axis=-1) for strip in found.strips(100)]
    assert (np.concatenate(rows) == stored(path)).all()


@pytest.mark.parametrize(
    "compression",
    [
        "NO",
        "RLE",
        "ZIPS",
        "ZIP",
        "PIZ",
        "PXR24",
        "B44",
        "DWAA",
        "DWAB",
        "HTJ2K32",
        "HTJ2K256",
        "ZSTD",
    ],
)
def test_no_file_packs_more_rows_together_than_are_expected(tmp_path, pixels, compression):
    path = tmp_path / "map.exr"
    write_exr(path, pixels, compression)
    expected = exr.read(path)[0].packed_rows
    found = packs(path)
    assert -(-(WIDTH // 2) // expected) <= found
    assert expected <= 32 or -(-(WIDTH // 2) // expected) == found


def packs(path: Path) -> int:
    """In an OpenEXR file of scan lines: a table of where each begins follows the attributes."""
    content = path.read_bytes()
    table = 1 + next(
        one.value_at + one.size
        for one in attributes(content)
        if content[one.value_at + one.size] == 0
    )
    (first,) = struct.unpack_from("<Q", content, table)
    return (first - table) // 8


@pytest.mark.parametrize("levels", [False, True])
def test_tiles_are_read_by_rows_too(tmp_path, pixels, levels):
    path = tmp_path / "map.exr"
    write_image(path, pixels, tile=64, levels=levels)
    assert exr.read(path)[0].packed_rows == 64
    assert (whole(exr.read(path)[0]) == stored(path)).all()
    assert load(path).own_width == WIDTH


def test_rows_of_an_hdr_are_those_of_the_whole(tmp_path, pixels):
    path = tmp_path / "map.hdr"
    write_image(path, pixels)
    environment = load(path)
    assert isinstance(environment.reduction.pixels.raw, strips.HdrPixels)
    rows = [np.stack(strip, axis=-1) for strip in environment.pixels.strips(100)]
    assert (np.concatenate(rows) == stored(path)).all()


def test_rows_of_a_grey_map(tmp_path, pixels):
    path = tmp_path / "map.exr"
    grey = pixels[..., 0].copy()
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": grey}) as file:
        file.write(str(path))
    found, _ = exr.read(path)
    assert isinstance(found, strips.ExrPixels)
    assert (whole(found) == grey[..., None]).all()


def test_a_window_that_does_not_begin_at_0(tmp_path, pixels):
    """Of a map that says it is one, the data window is the map wherever it lies."""
    path = tmp_path / "map.exr"
    first = np.array([-7, 1000], np.int32)
    window = first, first + np.array([WIDTH - 1, WIDTH // 2 - 1], np.int32)
    header = {"dataWindow": window, "displayWindow": window, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": pixels}) as file:
        file.write(str(path))
    assert (whole(exr.read(path)[0]) == pixels).all()


@pytest.mark.parametrize("kind", ["exr", "hdr"])
@pytest.mark.parametrize("part", [0.3, 0.9, 0.999])
def test_a_wide_file_that_ends_too_early_is_one_sentence(tmp_path, pixels, kind, part):
    path = tmp_path / f"map.{kind}"
    if kind == "exr":
        write_exr(path, pixels.astype(np.float16), "ZIP")
    else:
        write_image(path, pixels)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    with pytest.raises(UnusableInput, match="truncated or damaged") as caught:
        load(path)
    assert "\n" not in str(caught.value)


def test_a_name_that_is_not_unicode_is_read_at_once(tmp_path, pixels):
    path = tmp_path / "map\udcff.exr"
    write_exr(tmp_path / "map.exr", pixels.astype(np.float16), "ZIP")
    (tmp_path / "map.exr").rename(path)
    assert load(path).own_width == WIDTH


@pytest.mark.parametrize(("factor", "kind"), [(1, "half"), (10_000, "float")])
def test_a_residual_of_all_pixels_closes_on_disk(tmp_path, pixels, factor, kind):
    """It is half float where that holds it; 500,000 is more than that."""
    path = tmp_path / "map.exr"
    bright = pixels * np.float32(factor)
    bright[300, 700] *= 1000
    write_exr(path, bright, "ZIP")
    conversion = convert(load(path), ConversionSettings(residual_width="own", lights=2))
    files = save(conversion, tmp_path / "out")
    source = oiio.ImageInput.open(str(files.residual))
    assert (source.spec().width, str(source.spec().format)) == (WIDTH, kind)
    source.close()
    document = json.loads(files.lights.read_text())
    assert document["residual"]["width"] == WIDTH
    assert max(document["account"]["relative_error"]) <= ACCOUNT
    again = account_of_files(files.lights)
    assert again.source == pytest.approx(scalar_irradiance(bright), rel=1e-12)
    allowed = ACCOUNT_HALF if kind == "half" else ACCOUNT_FLOAT32
    assert again.relative_error.max() <= allowed


CHILD = """
import sys
from pathlib import Path
from sunsplit.core.cli import main
assert main(["convert", sys.argv[1], "-o", sys.argv[2], *sys.argv[3:]]) == 0
status = Path("/proc/self/status").read_text()  # getrusage counts what the parent had
print("peak", int(status.partition("VmHWM:")[2].split()[0]) // 1024)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the peak is asked of Linux")
@pytest.mark.parametrize("more", [[], ["--residual-width", "own"]])
def test_a_large_map_is_never_held_whole(tmp_path, more):
    """Its pixels as float32 are 402 MB; those of the program, its libraries and 1024 x 512 pixels
    take about 200."""
    path = tmp_path / "map.exr"
    rows = np.linspace(1, 2, 4096, dtype=np.float16)
    sky = np.broadcast_to(rows[:, None, None], (4096, 8192, 3)).copy()
    sky[1000:1008, 3000:3008] = 30000
    write_exr(path, sky, "RLE")
    del sky
    command = [sys.executable, "-c", CHILD, str(path), str(tmp_path / "out"), *more]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert int(done.stdout.rpartition("peak ")[2]) < 350
