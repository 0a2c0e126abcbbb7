from __future__ import annotations

import struct

import Imath
import numpy as np
import OpenEXR
import pytest

from sunsplit.core.errors import UnusableInput
from sunsplit.core.files.maps import load
from tests.files import noise, planes, window, write_exr, write_hdr, write_parts

PIXELS = noise()
OTHER = np.full(PIXELS.shape[:2], 9, np.float32)
"""A channel that must not be taken for the picture."""


def passes(layer):
    return {f"{layer}.{channel}": OTHER for channel in "RGB"}


@pytest.mark.parametrize(
    "names",
    [
        "RGB",
        "rgb",
        ["red", "green", "blue"],
        ["Combined.R", "Combined.G", "Combined.B"],
        ["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"],
        ["some.thing.r", "some.thing.g", "some.thing.b"],
    ],
)
def test_colour_channels_go_by_many_names(tmp_path, names):
    found = load(write_exr(tmp_path / "map.exr", planes(PIXELS, names)))
    assert (found.radiance == PIXELS).all()
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("names", "others"),
    [
        ("RGB", {"A": OTHER, "Z": OTHER}),
        ("RGB", {"A": OTHER, "Y": OTHER}),
        ("RGB", passes("Alpha") | passes("ViewLayer.Combined")),
        (["V.Combined.R", "V.Combined.G", "V.Combined.B"], passes("V.AO") | passes("V.Diffuse")),
        (["rgba.R", "rgba.G", "rgba.B"], passes("albedo") | {"Z": OTHER, "rgba.A": OTHER}),
        (["Combined.R", "Combined.G", "Combined.B"], {"Depth.Y": OTHER, "A.Y": OTHER}),
    ],
)
def test_the_picture_is_found_among_other_layers(tmp_path, names, others):
    found = load(write_exr(tmp_path / "map.exr", planes(PIXELS, names) | others))
    assert (found.radiance == PIXELS).all()
    assert found.warnings == ()


def test_the_choice_among_unknown_layers_is_said(tmp_path):
    names = ["diffuse.R", "diffuse.G", "diffuse.B"]
    found = load(write_exr(tmp_path / "map.exr", planes(PIXELS, names) | passes("glossy")))
    assert (found.radiance == PIXELS).all()
    assert found.warnings == ('Layer "diffuse" is taken as the map; the file also has: glossy.',)


def test_a_single_luminance_channel_is_grey(tmp_path):
    found = load(write_exr(tmp_path / "map.exr", {"Y": PIXELS[..., 1].copy(), "A": OTHER}))
    assert (found.radiance == PIXELS[..., [1, 1, 1]]).all()


def test_the_second_part_holds_the_colours(tmp_path):
    parts = [("depth", {"Z": OTHER}), ("mask", {"Y": OTHER}), ("any", planes(PIXELS))]
    found = load(write_parts(tmp_path / "map.exr", parts))
    assert (found.radiance == PIXELS).all()


def test_a_part_is_named_like_a_layer(tmp_path):
    normals = dict.fromkeys("RGB", OTHER)
    parts = [("ViewLayer.Normal", normals), ("ViewLayer.Combined", planes(PIXELS))]
    found = load(write_parts(tmp_path / "map.exr", parts))
    assert (found.radiance == PIXELS).all()
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("channels", "sentence"),
    [
        ({"Z": OTHER}, r"no colour channels \(R, G, B or Y\); it has: Z\."),
        ({"X": OTHER, "Y": OTHER, "Z": OTHER}, "it has: X, Y, Z"),
        ({"N.X": OTHER, "N.Y": OTHER, "N.Z": OTHER}, "it has: N.X, N.Y, N.Z"),
        ({"R": OTHER, "G": OTHER}, "it has: G, R"),
    ],
)
def test_a_file_without_colours_is_refused(tmp_path, channels, sentence):
    with pytest.raises(UnusableInput, match=sentence):
        load(write_exr(tmp_path / "map.exr", channels))


def test_luminance_and_chroma_are_not_taken_for_grey(tmp_path):
    path = tmp_path / "map.exr"
    kind = Imath.PixelType(Imath.PixelType.FLOAT)
    header = OpenEXR.Header(32, 16)
    header["channels"] = {
        "Y": Imath.Channel(kind),
        "RY": Imath.Channel(kind, 2, 2),
        "BY": Imath.Channel(kind, 2, 2),
    }
    file = OpenEXR.OutputFile(str(path), header)
    full, half = np.ones((16, 32), "f").tobytes(), np.zeros((8, 16), "f").tobytes()
    file.writePixels({"Y": full, "RY": half, "BY": half})
    file.close()
    with pytest.raises(UnusableInput, match=r"luminance and chroma \(Y, RY, BY\)"):
        load(path)


@pytest.mark.parametrize("kind", [OpenEXR.deepscanline, OpenEXR.deeptile])
def test_a_deep_image_is_refused(tmp_path, kind):
    samples = np.empty((4, 8), dtype=object)
    for place in np.ndindex(samples.shape):
        samples[place] = np.ones(1 + sum(place) % 2, np.float32)
    tiles = {"tiles": OpenEXR.TileDescription()} if kind == OpenEXR.deeptile else {}
    path = write_exr(
        tmp_path / "map.exr",
        {channel: samples.copy() for channel in "RGB"},
        type=kind,
        compression=OpenEXR.ZIPS_COMPRESSION,
        **tiles,
    )
    with pytest.raises(UnusableInput, match="deep image"):
        load(path)


@pytest.mark.parametrize(("kind", "factor"), [(np.float16, 1), (np.float32, 1), (np.uint32, 1000)])
def test_every_pixel_type(tmp_path, kind, factor):
    stored = (PIXELS * factor).astype(kind)
    found = load(write_exr(tmp_path / "map.exr", stored))
    assert found.radiance.dtype == np.float32
    assert (found.radiance == stored.astype(np.float32)).all()


def test_channels_of_different_types(tmp_path):
    channels = planes(PIXELS)
    channels["G"] = channels["G"].astype(np.float16)
    found = load(write_exr(tmp_path / "map.exr", channels))
    assert (found.radiance[..., 1] == channels["G"].astype(np.float32)).all()
    assert (found.radiance[..., 2] == channels["B"]).all()


LOSSLESS = ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "HTJ2K256", "HTJ2K32", "ZSTD"]
LOSSY = ["PXR24", "B44", "B44A", "DWAA", "DWAB"]


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("name", LOSSLESS + LOSSY)
def test_every_compression(tmp_path, name, kind):
    compression = getattr(OpenEXR, f"{name}_COMPRESSION")
    stored = noise(40).astype(kind)
    found = load(write_exr(tmp_path / "map.exr", stored, compression=compression))
    loss = np.abs(found.radiance - stored.astype(np.float32)).max()
    assert loss <= (0.1 if name in LOSSY else 0)


def test_tiles_and_rows_from_below(tmp_path):
    tiled = write_exr(
        tmp_path / "tiled.exr",
        PIXELS,
        type=OpenEXR.tiledimage,
        tiles=OpenEXR.TileDescription(),
    )
    from_below = write_exr(tmp_path / "below.exr", PIXELS, lineOrder=OpenEXR.DECREASING_Y)
    assert (load(tiled).radiance == PIXELS).all()
    assert (load(from_below).radiance == PIXELS).all()


def test_a_frame_may_lie_anywhere(tmp_path):
    frame = window(-7, 20, 32, 16)
    found = load(write_exr(tmp_path / "map.exr", PIXELS, dataWindow=frame, displayWindow=frame))
    assert (found.radiance == PIXELS).all()
    assert found.warnings == ()


def test_a_crop_lies_where_it_was_cut_out(tmp_path):
    path = write_exr(
        tmp_path / "map.exr",
        PIXELS,
        dataWindow=window(14, 3, 32, 16),
        displayWindow=window(10, 0, 64, 32),
    )
    found = load(path)
    expected = np.zeros((32, 64, 3), np.float32)
    expected[3:19, 4:36] = PIXELS
    assert (found.radiance == expected).all()
    assert len(found.warnings) == 1
    assert "32 x 16" in found.warnings[0]


def test_a_border_outside_of_the_frame_is_cut_off(tmp_path):
    path = write_exr(
        tmp_path / "map.exr",
        noise(20),
        dataWindow=window(-4, -2, 40, 20),
        displayWindow=window(0, 0, 32, 16),
    )
    found = load(path)
    assert (found.radiance == noise(20)[2:18, 4:36]).all()
    assert len(found.warnings) == 1


def test_an_environment_map_is_its_data_window(tmp_path):
    # ImfEnvmap.h: the pixel dataWindow.min has latitude +pi/2 and longitude +pi.
    path = write_exr(
        tmp_path / "map.exr",
        PIXELS,
        dataWindow=window(4, 3, 32, 16),
        displayWindow=window(0, 0, 64, 32),
        envmap=OpenEXR.ENVMAP_LATLONG,
    )
    assert (load(path).radiance == PIXELS).all()


def test_a_display_window_that_is_no_map_is_not_believed(tmp_path):
    path = write_exr(tmp_path / "map.exr", PIXELS, displayWindow=window(0, 0, 64, 64))
    found = load(path)
    assert (found.radiance == PIXELS).all()
    assert "display window" in found.warnings[0]


def test_a_cube_map_is_named(tmp_path):
    path = write_exr(
        tmp_path / "map.exr", np.ones((48, 8, 3), np.float32), envmap=OpenEXR.ENVMAP_CUBE
    )
    with pytest.raises(UnusableInput, match="cube map"):
        load(path)


def test_other_primaries_are_said(tmp_path):
    wide = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    found = load(write_exr(tmp_path / "map.exr", PIXELS, chromaticities=wide))
    assert "primaries" in found.warnings[0]


def test_broken_pixels_are_counted(tmp_path):
    pixels = PIXELS.copy()
    pixels[2, 3, 0] = np.nan
    pixels[4, 5] = np.inf
    pixels[6, 7, 2] = -1
    pixels[6, 8, 2] = -np.inf
    repairs = load(write_exr(tmp_path / "map.exr", pixels)).repairs
    assert (repairs.nan, repairs.infinite, repairs.negative) == (1, 1, 2)
    assert str(repairs) == "1 NaN, 1 infinite, 2 negative"


def test_halves_that_overflowed_are_counted(tmp_path):
    pixels = PIXELS.astype(np.float16)
    pixels[4, 5] = np.inf
    found = load(write_exr(tmp_path / "map.exr", pixels))
    assert found.repairs.infinite == 1
    assert (found.radiance[4, 5] == 65504).all()


def test_the_format_is_told_by_content(tmp_path):
    assert (load(write_exr(tmp_path / "map.hdr", PIXELS)).radiance == PIXELS).all()
    hdr = load(write_hdr(tmp_path / "map.exr", PIXELS)).radiance
    assert hdr == pytest.approx(PIXELS, abs=0.01)


@pytest.fixture
def whole_file(tmp_path):
    return write_exr(tmp_path / "whole.exr", noise(64)).read_bytes()


@pytest.mark.parametrize("part", [0.0, 0.0001, 0.001, 0.003, 0.01, 0.5, 0.9, 0.99999])
def test_a_truncated_file_is_one_sentence(tmp_path, capfd, whole_file, part):
    path = tmp_path / "map.exr"
    path.write_bytes(whole_file[: max(4, int(part * len(whole_file)))])
    with pytest.raises(UnusableInput, match=r"^map\.exr is truncated or damaged"):
        load(path)
    # Neither OpenEXR's C library nor its Python binding may add anything.
    assert capfd.readouterr() == ("", "")


def test_a_truncated_second_part_does_not_matter(tmp_path, capfd):
    parts = [("Combined", planes(noise(64))), ("depth", {"Z": noise(64)[..., 0].copy()})]
    path = write_parts(tmp_path / "map.exr", parts)
    path.write_bytes(path.read_bytes()[:-100])
    assert (load(path).radiance == noise(64)).all()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("box", "sentence"),
    [
        ((0, 0, 199_999, 99_999), "200000 x 100000"),
        ((0, 0, 2**20 - 1, 2**19 - 1), "1048576 x 524288"),
        ((0, 0, 65_535, 32_767), r"promises 65536 x 32768 pixels in \d+ bytes"),
        ((0, 0, 2**31 - 2, 2**31 - 2), "damaged"),
        ((-(2**31), -(2**31), 2**31 - 1, 2**31 - 1), "damaged"),
        ((0, 0, -5, -5), "damaged"),
    ],
)
def test_absurd_sizes_are_refused(tmp_path, capfd, whole_file, box, sentence):
    mark = b"dataWindow\0box2i\0" + struct.pack("<i", 16)
    start = whole_file.index(mark) + len(mark)
    path = tmp_path / "map.exr"
    path.write_bytes(whole_file[:start] + struct.pack("<4i", *box) + whole_file[start + 16 :])
    with pytest.raises(UnusableInput, match=sentence):
        load(path)
    assert capfd.readouterr() == ("", "")


def test_an_absurd_display_window_is_not_believed(tmp_path):
    frame = window(0, 0, 2**20, 2**19)
    found = load(write_exr(tmp_path / "map.exr", PIXELS, displayWindow=frame))
    assert (found.radiance == PIXELS).all()


def test_random_bytes_never_raise_anything_else(tmp_path, capfd, whole_file):
    random = np.random.default_rng(3)
    path = tmp_path / "map.exr"
    said = []
    for _ in range(150):
        spoilt = bytearray(whole_file[:20_000])
        for place in random.integers(4, 400, 3):
            spoilt[place] = int(random.integers(256))
        path.write_bytes(spoilt)
        try:
            load(path)
        except UnusableInput as error:
            said.append(str(error))
    assert len(said) > 100
    assert not any("\n" in sentence for sentence in said)
    assert capfd.readouterr() == ("", "")


def test_names_that_are_no_text(tmp_path):
    path = tmp_path / "map\udcff.exr"
    write_exr(tmp_path / "map.exr", PIXELS).rename(path)
    assert (load(path).radiance == PIXELS).all()
