"""Damaged files by seed, and each kind of file that `tools.fuzz` has found wanting."""

from __future__ import annotations

import ctypes
import os
import resource
import struct
import zlib
from collections import Counter

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest
import tifffile

from sunsplit.core.errors import UnusableInput
from sunsplit.core.files.maps import load
from tests.dying_worker import CRASHES, HANGS, LEAVES
from tests.files import noise, radiance_head, sunny, sunsplit, window, write_exr, write_hdr
from tools.fuzz import fuzz
from tools.fuzz_corpus import valid_files
from tools.fuzz_mutations import attributes, mutated

PIXELS = noise()


def test_damaged_files_are_read_or_refused_with_a_sentence():
    results = list(fuzz(seed=11, first=0, end=700))
    assert [result.number for result in results] == list(range(700))
    assert [result for result in results if result.is_failure] == []
    outcomes = Counter(result.outcome for result in results)
    assert outcomes["read"] > 100
    assert outcomes["refused"] > 300


def test_a_crash_a_hang_and_an_exit_are_seen():
    results = list(fuzz(1, 0, 8, worker="tests.dying_worker", seconds=3))
    assert [result.number for result in results] == list(range(8))
    failures = {result.number: result.outcome for result in results if result.is_failure}
    assert failures == {
        CRASHES: "FAILURE: SIGSEGV",
        HANGS: "FAILURE: too long",
        LEAVES: "FAILURE: exit status 3",
    }


def test_a_seed_makes_the_same_files(tmp_path):
    corpus = valid_files(tmp_path)
    assert len(corpus) > 90
    files = [mutated(corpus, 5, number) for number in range(300)]
    again = valid_files(tmp_path)
    assert files == [mutated(again, 5, number) for number in range(300)]
    assert len(set(files)) > 290
    assert sum(file in corpus for file in files) < 10


def retyped(path, name, kind):
    """Give an attribute of an EXR file another type of the same length."""
    content = bytearray(path.read_bytes())
    (found,) = (each for each in attributes(content) if each.name == name)
    start = found.start + len(name) + 1
    content[start : start + len(found.kind)] = kind.ljust(len(found.kind), b"x")
    path.write_bytes(content)


def test_primaries_of_another_type_are_none(tmp_path):
    wide = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    path = write_exr(tmp_path / "map.exr", PIXELS, chromaticities=wide)
    assert "primaries" in load(path).warnings[0]
    retyped(path, b"chromaticities", b"nonsense")
    found = load(path)
    assert (found.radiance == PIXELS).all()
    assert found.warnings == ()


@pytest.mark.parametrize("width", [1024, 16_384, 65_536])
def test_a_frame_full_of_nothing_is_not_believed(tmp_path, width):
    frame = window(0, 0, width, width // 2)
    found = load(write_exr(tmp_path / "map.exr", PIXELS, displayWindow=frame))
    assert (found.radiance == PIXELS).all()
    assert "display window" in found.warnings[0]


def test_a_frame_that_is_mostly_empty_is_filled_up(tmp_path):
    frame = window(0, 0, 512, 256)
    found = load(write_exr(tmp_path / "map.exr", PIXELS, displayWindow=frame))
    assert found.radiance.shape == (256, 512, 3)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["a\nb.Z", "\x07"], r"it has: \ufffd, a\ufffdb\.Z\."),
        ([f"{'n' * 200}.{c}" for c in "XZ"], r"it has: n{32}…, n{32}…\."),
        ([f"{n:03}.Z" for n in range(50)], r"it has: 000\.Z, 001\.Z, .* 007\.Z, and 42 more\."),
    ],
)
def test_names_of_channels_make_a_sentence(tmp_path, names, sentence):
    channels = {name: PIXELS[..., 0].copy() for name in names}
    with pytest.raises(UnusableInput, match=sentence):
        load(write_exr(tmp_path / "map.exr", channels))


def test_names_of_layers_make_a_sentence(tmp_path):
    names = ["\x1b[2J", "b" * 200]
    channels = {f"{name}.{c}": PIXELS[..., 0].copy() for name in names for c in "RGB"}
    (warning,) = load(write_exr(tmp_path / "map.exr", channels)).warnings
    assert warning == (
        f'Layer "\N{REPLACEMENT CHARACTER}[2J" is taken as the map; the file also has: {"b" * 32}….'
    )


@pytest.mark.parametrize("size", [(8, 2**24), (2**24, 8), (2**16, 2**16)])
def test_absurd_tiles_are_refused_before_openexr_fills_memory(tmp_path, size):
    tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    path = write_exr(tmp_path / "map.exr", PIXELS, **tiles)
    assert (load(path).radiance == PIXELS).all()
    content = bytearray(path.read_bytes())
    (found,) = (each for each in attributes(content) if each.name == b"tiles")
    struct.pack_into("<2I", content, found.value_at, *size)
    path.write_bytes(content)
    with pytest.raises(UnusableInput, match=f"promises tiles of {size[0]} x {size[1]} pixels"):
        load(path)


@pytest.mark.parametrize("size", [64, 128])
def test_a_tile_may_be_larger_than_the_map(tmp_path, size):
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = size
    path = write_exr(tmp_path / "map.exr", PIXELS, type=OpenEXR.tiledimage, tiles=tiles)
    assert (load(path).radiance == PIXELS).all()


def test_a_signalling_nan_says_nothing(tmp_path):
    pixels = PIXELS.copy()
    pixels.view(np.uint32)[3, 4] = 0x7F800001
    pixels[5, 6] = -1
    repairs = load(write_exr(tmp_path / "map.exr", pixels)).repairs
    assert (repairs.nan, repairs.negative) == (1, 1)
    assert repairs.negative_energy[0] > 0


def test_openjph_says_nothing_and_its_guesses_are_not_believed(tmp_path, capfd):
    path = write_exr(tmp_path / "map.exr", sunny(), compression=OpenEXR.HTJ2K256_COMPRESSION)
    assert (load(path).radiance == sunny()).all()
    content = bytearray(path.read_bytes())
    content[-1] ^= 0x40  # half of its end mark: "ojph info ... File terminated early", on stdout
    path.write_bytes(content)
    with pytest.raises(UnusableInput, match="truncated or damaged"):
        load(path)
    ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("", "")


def test_what_does_not_fit_into_memory_is_one_sentence(tmp_path):
    path = tmp_path / "map.hdr"
    # Runs of Radiance 1 that repeat one pixel 2^31 times, in 28 bytes and what a file must have.
    lines = bytes([9, 9, 9, 129]) + bytes([1, 1, 1, 255]) * 4
    path.write_bytes(radiance_head("-Y 32768 +X 65536") + lines + bytes(4 * 32768))

    def with_little_memory():
        resource.setrlimit(resource.RLIMIT_AS, (2**32, 2**32))

    ended = sunsplit("info", path, preexec_fn=with_little_memory)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == "sunsplit: map.hdr does not fit into memory.\n"


def write_tiff(path, packed, **spec):
    """A float TIFF of PIXELS, as OpenImageIO packs it."""
    kind = oiio.ImageSpec(32, 16, 3, oiio.FLOAT)
    kind.attribute("compression", packed)
    kind.tile_width = kind.tile_height = spec.get("tile", 0)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), kind)
    assert out.write_image(PIXELS)
    out.close()
    return path


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize("packed", ["zip", "lzw", "none"])
def test_tiffs_of_every_packing_are_read(tmp_path, packed, tile):
    assert (load(write_tiff(tmp_path / "map.tif", packed, tile=tile)).radiance == PIXELS).all()


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("big", [False, True])
def test_tiffs_of_another_program_are_read(tmp_path, order, big):
    path = tmp_path / "map.tif"
    options = {"bigtiff": big, "byteorder": order, "compression": "zlib", "rowsperstrip": 5}
    tifffile.imwrite(path, PIXELS, photometric="rgb", **options)
    assert (load(path).radiance == PIXELS).all()
    tifffile.imwrite(path, np.full((16, 32), 255, np.uint8), **options)
    assert load(path, allow_ldr=True).radiance.min() == 1


@pytest.mark.parametrize("tile", [0, 16])
def test_a_damaged_zip_in_a_tiff_is_not_passed_on_as_light(tmp_path, tile):
    path = write_tiff(tmp_path / "map.tif", "zip", tile=tile)
    content = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        content[file.pages[0].dataoffsets[0] + 40] ^= 0x10
    path.write_bytes(content)
    with pytest.raises(UnusableInput, match="truncated or damaged"):
        load(path)


def test_a_zip_in_a_tiff_that_is_too_short_is_not_passed_on_as_light(tmp_path):
    path = tmp_path / "map.tif"
    tifffile.imwrite(path, PIXELS, photometric="rgb", compression="zlib")
    assert (load(path).radiance == PIXELS).all()
    content = path.read_bytes()
    packed = zlib.compress(PIXELS.tobytes(), 6)
    start = content.index(packed[:2], 8)
    short = zlib.compress(PIXELS[:9].tobytes())
    assert len(short) < len(content) - start
    path.write_bytes(content[:start] + short.ljust(len(content) - start, b"\0"))
    with pytest.raises(UnusableInput, match="truncated or damaged"):
        load(path)


@pytest.mark.parametrize("closed", [(1,), (2,), (1, 2), (0, 1, 2)])
@pytest.mark.parametrize("kind", ["exr", "hdr"])
def test_a_map_is_read_where_nothing_can_be_printed(tmp_path, kind, closed):
    """The map's own file may then have the number of stdout or stderr."""
    path = tmp_path / f"map.{kind}"
    (write_exr if kind == "exr" else write_hdr)(path, sunny())

    def close():
        for descriptor in closed:
            os.close(descriptor)

    assert sunsplit("info", path, preexec_fn=close).returncode == 0
