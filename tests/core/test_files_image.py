from __future__ import annotations

import os
import struct
import zipfile
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from sunsplit.core.errors import UnusableInput
from sunsplit.core.files.maps import load
from tests.files import from_rgbe, new_runs, noise, old_runs, radiance_head, to_rgbe, write_hdr

STORED = to_rgbe(noise(12) * 50)
PIXELS = from_rgbe(STORED)
HEIGHT, WIDTH = PIXELS.shape[:2]
UPRIGHT = f"-Y {HEIGHT} +X {WIDTH}"


def flat(stored):
    return stored.tobytes()


def with_runs():
    """Pixels in which old runs are short, long enough for two marks, and at the ends of lines."""
    stored = to_rgbe(noise(400))
    stored[3, 4:20] = stored[3, 4]
    stored[5] = stored[5, 0]
    stored[6, 700:] = stored[6, 700]
    stored[7, :2] = stored[7, 0]
    return stored


@pytest.mark.parametrize("encode", [new_runs, old_runs, flat])
def test_every_encoding_of_radiance(tmp_path, encode):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(UPRIGHT) + encode(STORED))
    assert (load(path).radiance == PIXELS).all()
    stored = with_runs()
    path.write_bytes(radiance_head("-Y 400 +X 800") + encode(stored))
    assert (load(path).radiance == from_rgbe(stored)).all()


def test_a_radiance_file_of_another_program(tmp_path):
    path = tmp_path / "map.hdr"
    pixels = noise(64)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), oiio.ImageSpec(128, 64, 3, oiio.FLOAT))
    assert out.write_image(pixels)
    out.close()
    assert load(path).radiance == pytest.approx(pixels, rel=0.02, abs=0.01)


def test_a_map_too_narrow_for_runs(tmp_path):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head("-Y 2 +X 4") + flat(STORED[:2, :4]))
    assert (load(path).radiance == PIXELS[:2, :4]).all()


def test_black_is_black_in_both_readers(tmp_path):
    stored = STORED.copy()
    stored[2, 3] = stored[4, 5] = 0
    for encode in (new_runs, flat):
        path = tmp_path / "map.hdr"
        path.write_bytes(radiance_head(UPRIGHT) + encode(stored))
        assert not load(path).radiance[2, 3].any()


@pytest.mark.parametrize("encode", [new_runs, flat])
@pytest.mark.parametrize("right", "+-")
@pytest.mark.parametrize("down", "-+")
def test_every_scan_order_comes_out_upright(tmp_path, down, right, encode):
    lines = STORED[:: 1 if down == "-" else -1, :: 1 if right == "+" else -1]
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(f"{down}Y {HEIGHT} {right}X {WIDTH}") + encode(lines))
    assert (load(path).radiance == PIXELS).all()
    columns = np.ascontiguousarray(lines.swapaxes(0, 1))
    path.write_bytes(radiance_head(f"{right}X {WIDTH} {down}Y {HEIGHT}") + encode(columns))
    assert (load(path).radiance == PIXELS).all()


@pytest.mark.parametrize(
    "lines",
    [
        ["EXPOSURE=0", "PRIMARIES=0 0 0 0 0 0 0 0"],
        ["EXPOSURE=          0.0000000000000", "GAMMA=0", "PIXASPECT=0", "COLORCORR=0 0 0"],
        ["EXPOSURE=nan", "SOFTWARE=me", "# a comment", "VIEW= -vtv -vp 0 0 0"],
        ["COMMENT=" + "long " * 1000],
        ["pfilt -x 2048 -y 1024", "-Y 3 +X 3"],
    ],
)
@pytest.mark.parametrize("encode", [new_runs, flat])
def test_odd_header_lines_change_nothing(tmp_path, lines, encode):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(UPRIGHT, *lines) + encode(STORED))
    assert (load(path).radiance == PIXELS).all()


def test_xyz_colours_are_not_taken_for_rgb(tmp_path):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(UPRIGHT, form="32-bit_rle_xyze") + new_runs(STORED))
    with pytest.raises(UnusableInput, match="CIE XYZ"):
        load(path)


@pytest.mark.parametrize("name", ["map.png", "map.exr", "map", "map.jpg.hdr"])
def test_radiance_is_told_by_content(tmp_path, name):
    path = write_hdr(tmp_path / name, noise())
    assert (load(path).radiance == from_rgbe(to_rgbe(noise()))).all()


@pytest.mark.parametrize("encode", [new_runs, flat])
@pytest.mark.parametrize("part", [0, 0.00001, 0.25, 0.5, 0.99999])
def test_truncated_pixels_are_one_sentence(tmp_path, capfd, encode, part):
    body = encode(STORED)
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(UPRIGHT) + body[: int(part * len(body))])
    with pytest.raises(UnusableInput, match=r"^map\.hdr is truncated"):
        load(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("length", [2, 5, 11, 30, len(radiance_head(UPRIGHT)) - 1])
def test_a_truncated_header_is_one_sentence(tmp_path, length):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(UPRIGHT)[:length])
    with pytest.raises(UnusableInput, match="truncated or damaged"):
        load(path)


@pytest.mark.parametrize(
    ("resolution", "sentence"),
    [
        ("-Y 1000000000 +X 2000000000", "2000000000 x 1000000000"),
        ("-Y 100000 +X 200000", "200000 x 100000"),
        ("-Y 32768 +X 65536", "truncated"),
        ("-Y 16384 +X 32768", "truncated"),
        ("-Y 0 +X 0", "0 x 0"),
        ("-Y -16 +X -32", "no size"),
        ("-Y 16 +Y 32", "no size"),
        ("-Y 99999999999999999999 +X 1", "no size"),
    ],
)
def test_absurd_sizes_are_refused(tmp_path, capfd, resolution, sentence):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head(resolution) + new_runs(STORED))
    with pytest.raises(UnusableInput, match=sentence):
        load(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("encode", [new_runs, old_runs, flat])
def test_random_bytes_never_raise_anything_else(tmp_path, capfd, encode):
    random = np.random.default_rng(4)
    body = encode(with_runs()[:24, :48])
    head = radiance_head("-Y 24 +X 48")
    path = tmp_path / "map.hdr"
    for _ in range(100):
        spoilt = bytearray(head + body)
        for place in random.integers(2, len(spoilt), 5):
            spoilt[place] = int(random.integers(256))
        path.write_bytes(spoilt)
        try:
            shape = load(path).radiance.shape
        except UnusableInput:
            continue
        assert shape == (24, 48, 3)
    assert capfd.readouterr() == ("", "")


def test_repetition_of_nothing_is_refused(tmp_path):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head("-Y 2 +X 4") + bytes([1, 1, 1, 200]) * 4)
    with pytest.raises(UnusableInput, match="repetition of nothing"):
        load(path)


def write_zip(path):
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("map.hdr", "light" * 100)


@pytest.mark.parametrize(
    "fill",
    [
        lambda path: path.write_text("no picture\n" * 50),
        lambda path: path.write_bytes(np.random.default_rng(5).bytes(5000)),
        lambda path: path.write_bytes(b"x"),
        write_zip,
    ],
)
@pytest.mark.parametrize("name", ["map.hdr", "map.exr", "map.txt", "map"])
def test_what_is_no_image_is_one_sentence(tmp_path, capfd, name, fill):
    fill(tmp_path / name)
    with pytest.raises(UnusableInput, match="not an image that can be read here"):
        load(tmp_path / name)
    assert capfd.readouterr() == ("", "")


def test_empty_missing_folder_pipe_and_unreadable(tmp_path):
    empty, pipe = tmp_path / "empty.hdr", tmp_path / "pipe.hdr"
    empty.touch()
    os.mkfifo(pipe)
    for path, sentence in [
        (empty, "is empty"),
        (tmp_path / "missing.hdr", "does not exist"),
        (tmp_path, "is a folder"),
        (pipe, "a pipe or a device"),
        (empty / "map.hdr", "cannot be read: Not a directory"),
        (tmp_path / ("long" * 100), "cannot be read: File name too long"),
        # Readable by its mode, but not to be read: also for root, whom no mode stops.
        ("/proc/self/mem", "cannot be read: Input/output error"),
        ("a\0b.hdr", "cannot be read"),
    ]:
        with pytest.raises(UnusableInput, match=sentence):
            load(path)


def write_picture(path, kind="RGB", size=(64, 32), **options):
    random = np.random.default_rng(6)
    shape = (size[1], size[0], len(kind)) if len(kind) > 1 else (size[1], size[0])
    values = random.integers(1, 255, shape, dtype=np.uint8)
    image = Image.fromarray(values)
    image.save(path, **options)
    return values


@pytest.mark.parametrize("name", ["map.png", "map.jpg", "map.tif", "map.webp", "map.bmp"])
def test_ldr_only_when_allowed(tmp_path, name):
    write_picture(tmp_path / name)
    with pytest.raises(UnusableInput, match=r"LDR image \(uint8 .*--allow-ldr"):
        load(tmp_path / name)
    assert load(tmp_path / name, allow_ldr=True).width == 64


def test_sixteen_bits_are_still_ldr(tmp_path):
    Image.fromarray(np.full((16, 32), 40_000, np.uint16)).save(tmp_path / "map.png")
    with pytest.raises(UnusableInput, match="LDR image"):
        load(tmp_path / "map.png")
    grey = load(tmp_path / "map.png", allow_ldr=True).radiance
    assert grey == pytest.approx(((40_000 / 65_535 + 0.055) / 1.055) ** 2.4, rel=1e-5)


def test_ldr_is_taken_as_srgb(tmp_path):
    values = write_picture(tmp_path / "map.png") / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    found = load(tmp_path / "map.png", allow_ldr=True)
    assert found.radiance == pytest.approx(linear, rel=1e-5)


def test_an_opaque_alpha_changes_nothing(tmp_path):
    values = write_picture(tmp_path / "rgb.png")
    opaque = np.dstack([values, np.full(values.shape[:2], 255, np.uint8)])
    Image.fromarray(opaque).save(tmp_path / "rgba.png")
    rgb, rgba = (load(tmp_path / name, allow_ldr=True) for name in ("rgb.png", "rgba.png"))
    assert (rgb.radiance == rgba.radiance).all()


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientations_come_out_upright(tmp_path, orientation):
    # As seen: red above, blue below, the left third darker.
    seen = np.zeros((32, 64, 3), np.uint8)
    seen[:16, :, 0] = seen[16:, :, 2] = 200
    seen[:, :20] //= 2
    undone = {
        1: [],
        2: [Image.Transpose.FLIP_LEFT_RIGHT],
        3: [Image.Transpose.ROTATE_180],
        4: [Image.Transpose.FLIP_TOP_BOTTOM],
        5: [Image.Transpose.TRANSPOSE],
        6: [Image.Transpose.ROTATE_90],
        7: [Image.Transpose.TRANSVERSE],
        8: [Image.Transpose.ROTATE_270],
    }
    stored = Image.fromarray(seen)
    for step in undone[orientation]:
        stored = stored.transpose(step)
    exif = Image.Exif()
    exif[0x0112] = orientation
    stored.save(tmp_path / "map.jpg", exif=exif, quality=95)
    found = load(tmp_path / "map.jpg", allow_ldr=True).radiance
    assert found.shape == seen.shape
    assert found[2, 40, 0] > 10 * found[2, 40, 2]
    assert found[29, 40, 2] > 10 * found[29, 40, 0]
    assert found[2, 40, 0] > 2 * found[2, 5, 0]


@pytest.mark.parametrize("keep", [20, 0.5, 0.98])
@pytest.mark.parametrize("name", ["map.png", "map.jpg", "map.tif"])
def test_damaged_pictures_are_one_sentence(tmp_path, capfd, name, keep):
    path = tmp_path / name
    write_picture(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: keep if keep > 1 else int(keep * len(whole))])
    with pytest.raises(UnusableInput) as caught:
        load(path, allow_ldr=True)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_an_absurd_png_is_one_sentence(tmp_path, capfd):
    path = tmp_path / "map.png"
    write_picture(path)
    data = bytearray(path.read_bytes())
    data[16:24] = struct.pack(">II", 900_000, 450_000)
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    path.write_bytes(data)
    with pytest.raises(UnusableInput):
        load(path, allow_ldr=True)
    assert capfd.readouterr() == ("", "")


def test_float_tiff_is_linear(tmp_path):
    pixels = noise()[..., 0] * 1000
    Image.fromarray(pixels).save(tmp_path / "map.tif")
    assert (load(tmp_path / "map.tif").radiance == pixels[..., None]).all()


@pytest.mark.parametrize(
    ("size", "hint"),
    [((64, 64), "64 x 64, not 2:1. A square map is probably an angular map"), ((64, 20), "2:1")],
)
def test_other_proportions_are_refused(tmp_path, size, hint):
    write_hdr(tmp_path / "map.hdr", np.ones((size[1], size[0], 3)))
    with pytest.raises(UnusableInput, match=hint):
        load(tmp_path / "map.hdr")


def test_a_black_map_is_refused(tmp_path):
    path = tmp_path / "map.hdr"
    path.write_bytes(radiance_head("-Y 8 +X 16") + bytes(8 * 16 * 4))
    with pytest.raises(UnusableInput, match="no light"):
        load(path)


def test_names_that_are_no_text(tmp_path):
    for encode in (flat, new_runs):
        path = tmp_path / "map\udcff.hdr"
        path.write_bytes(radiance_head(UPRIGHT) + encode(STORED))
        if encode is flat:
            assert load(path).width == WIDTH
        else:
            with pytest.raises(UnusableInput, match="not Unicode: rename it"):
                load(path)


def test_where_a_map_comes_from_is_kept(tmp_path):
    path = write_hdr(tmp_path / "a map.v2 ü.hdr", noise())
    found = load(str(path))
    assert (found.name, found.file) == ("a map.v2 ü", "a map.v2 ü.hdr")
    assert len(found.sha256) == 64
    path.write_bytes(path.read_bytes() + b"x")
    assert load(path).sha256 != found.sha256


def test_the_shipped_map_is_what_openimageio_reads(sunrise):
    pixels = oiio.ImageBuf(str(sunrise)).get_pixels(oiio.FLOAT)
    assert (load(sunrise).radiance == pixels).all()
