from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from sunsplit.core import (
    ConversionSettings,
    LibraryOptions,
    account_of_files,
    convert,
    convert_library,
    load,
    save,
)
from sunsplit.core.errors import CannotWrite, UnusableInput
from sunsplit.core.files import lock
from sunsplit.core.files.exr import light_of
from sunsplit.core.library.state import STATE, record_path
from sunsplit.core.settings import BadSetting
from sunsplit.core.tolerances import ACCOUNT_HALF
from tests.files import noise, sunny, write_exr, write_hdr
from tests.libraries import contents, documents, write_maps

COUNT = 7

BAD_RECORDS = ("", "{", "[]", '{"version": 1}', '{"version": 7, "request": ""}')


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    write_maps(folder, COUNT)
    return folder


@pytest.fixture
def own(tmp_path):
    """A library that a test may change."""
    folder = tmp_path / "library"
    folder.mkdir()
    write_maps(folder, 3)
    return folder


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def run(library, out, **options):
    return convert_library(library, out, LibraryOptions(**options), workers=1)


def times(out):
    return {path: path.stat().st_mtime_ns for path in out.rglob("*.exr")}


# What is written


def test_each_map_is_what_convert_makes_of_it_in_the_same_tree(library, out, tmp_path):
    result = convert_library(library, out, LibraryOptions(preview=True), workers=2)
    assert result.is_well
    assert result.known == 0
    alone = tmp_path / "alone"
    for row in result.rows:
        conversion = convert(load(library / row.source))
        save(conversion, alone / Path(row.source).parent, preview=True)
        assert (row.width, row.height, row.lights) == (64, 32, len(conversion.suns))
        assert row.share == conversion.account.share
        assert all((out / file).is_file() for file in row.files)
    made = contents(alone)
    assert len(made) == 3 * COUNT
    assert {path: data for path, data in contents(out).items() if path in made} == made


def test_rows_are_in_the_order_of_names_whatever_takes_longest(own, out):
    write_exr(own / "a.exr", noise(8))
    write_exr(own / "z.exr", sunny(256))
    rows = convert_library(own, out, workers=2).rows
    assert [row.source for row in rows] == sorted(row.source for row in rows)


def test_listener_hears_of_each_map_once(own, out):
    heard = []
    convert_library(own, out, workers=2, listen=heard.append)
    assert sorted(event.number for event in heard) == [1, 2, 3]
    assert {event.total for event in heard} == {3}
    assert heard[-1].fraction == pytest.approx(1)
    assert not any(event.known for event in heard)
    heard.clear()
    convert_library(own, out, workers=2, listen=heard.append)
    assert all(event.known for event in heard)


def test_what_a_listener_raises_ends_the_run_and_the_next_one_goes_on(own, out):
    class EnoughError(Exception):
        pass

    def stop(event):
        raise EnoughError

    with pytest.raises(EnoughError):
        convert_library(own, out, workers=1, listen=stop)
    result = convert_library(own, out, workers=1)
    assert result.is_well
    assert result.known == 1


def test_sizes_share_their_suns_and_each_closes_its_account(tmp_path, out):
    library = tmp_path / "library"
    library.mkdir()
    wide = sunny(2048) + noise(1024)
    write_exr(library / "sky_2k.exr", wide)
    write_hdr(library / "sky_1k.hdr", wide[::2, ::2])
    settings = ConversionSettings(lights=2)
    result = run(library, out, sizes=(2048, 1024, 256), settings=settings)
    assert [(row.source, row.variants) for row in result.rows] == [("sky_2k.exr", ("sky_1k.hdr",))]
    made = documents(out)
    assert {name: made[name]["residual"]["width"] for name in made} == {
        "sky_2k": 2048,
        "sky_1k": 1024,
        "sky_256": 256,
    }
    assert made["sky_1k"]["suns"] == made["sky_2k"]["suns"] == made["sky_256"]["suns"]
    assert made["sky_1k"]["source"]["file"] == "sky_2k.exr"
    for name in made:
        assert account_of_files(out / f"{name}.lights.json").relative_error.max() <= ACCOUNT_HALF
    lights = [light_of(out / f"{name}.residual.exr") for name in made]
    np.testing.assert_allclose(lights[1:], lights[:-1], rtol=ACCOUNT_HALF)
    # The settings hold all of them down.
    narrow = replace(settings, residual_width=256)
    run(library, out / "narrow", sizes=(2048, 1024), settings=narrow)
    assert {entry["residual"]["width"] for entry in documents(out / "narrow").values()} == {256}


def test_what_is_narrower_than_all_sizes_is_written_as_it_is(own, out):
    assert run(own, out, sizes=(4096,)).is_well
    assert {entry["residual"]["width"] for entry in documents(out).values()} == {64}


# What is not done again


def test_what_is_done_is_not_done_again(own, out):
    run(own, out)
    before, when = contents(out), times(out)
    result = run(own, out)
    assert result.known == 3
    assert result.is_well
    assert contents(out) == before
    assert times(out) == when


def test_a_map_that_was_touched_or_moved_with_all_its_library_is_known(own, out):
    run(own, out)
    when = times(out)
    for path in own.rglob("*.exr"):
        path.touch()
    assert run(own, out).known == 3
    moved = own.rename(own.with_name("elsewhere"))
    assert run(moved, out).known == 3
    assert times(out) == when


def test_a_map_with_other_content_is_converted_again(own, out):
    run(own, out)
    before = contents(out)
    path = own / "noon" / "map 0001.exr"
    # As long as before, and as old: only what the file system itself notes tells.
    write_exr(path, sunny(64) + noise(32, seed=9), compression=OpenEXR.NO_COMPRESSION)
    run(own, out)
    old = path.stat()
    write_exr(path, sunny(64) + noise(32, seed=8), compression=OpenEXR.NO_COMPRESSION)
    os.utime(path, ns=(old.st_atime_ns, old.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (old.st_size, old.st_mtime_ns)
    assert run(own, out).known == 2
    changed = {name for name, data in contents(out).items() if before.get(name) != data}
    assert changed == {"noon/map 0001.lights.json", "noon/map 0001.residual.exr"}


def test_other_settings_are_other_conversions(own, out):
    run(own, out)
    assert run(own, out, settings=ConversionSettings(lights=2)).known == 0
    assert run(own, out, settings=ConversionSettings(lights=2)).known == 3
    assert run(own, out, settings=ConversionSettings(lights=2), preview=True).known == 0


def test_what_was_damaged_is_made_again(library, out):
    run(library, out)
    before = contents(out)
    residuals, lights = (sorted(out.rglob(f"*.{end}")) for end in ("residual.exr", "lights.json"))
    for k, paths in enumerate((residuals, lights)):
        gone, cut_off, changed = paths[3 * k : 3 * k + 3]
        gone.unlink()
        cut_off.write_bytes(cut_off.read_bytes()[:-1])
        changed.write_bytes(changed.read_bytes()[::-1])
    assert run(library, out).known == COUNT - 6
    assert contents(out) == before


def test_a_damaged_record_is_none(library, out):
    result = run(library, out)
    before = contents(out)
    for row, text in zip(result.rows, BAD_RECORDS, strict=False):
        stem = Path(row.source).with_suffix("").as_posix()
        record_path(out, stem).write_text(text)
    assert run(library, out).known == COUNT - len(BAD_RECORDS)
    assert contents(out) == before


def test_a_copy_of_the_output_is_known(own, out):
    run(own, out)
    copy = out.with_name("copy")
    for path in sorted(out.rglob("*")):
        target = copy / path.relative_to(out)
        if path.is_dir():
            target.mkdir(parents=True)
        else:
            target.write_bytes(path.read_bytes())
    when = times(copy)
    assert run(own, copy).known == 3
    assert times(copy) == when


# What goes wrong


def test_a_broken_map_is_reported_and_stops_nothing(own, out):
    (own / "broken.exr").write_bytes(b"\x76\x2f\x31\x01 broken")
    write_exr(own / "square.exr", noise(16)[:, :16])
    (own / "empty.hdr").touch()
    result = run(own, out)
    assert not result.is_well
    assert {row.source: row.sentence for row in result.failed} == {
        "broken.exr": "broken.exr is truncated or damaged: OpenEXR cannot read it.",
        "empty.hdr": f"{own / 'empty.hdr'} is empty.",
        "square.exr": "square is 16 x 16, not 2:1. A square map is probably an angular map (light "
        "probe): convert it to an equirectangular (latitude-longitude) map first.",
    }
    assert len(documents(out)) == 3
    # It is tried again each time: what was wrong may be gone.
    write_exr(own / "square.exr", noise(8))
    again = run(own, out)
    assert again.known == 3
    assert [row.source for row in again.failed] == ["broken.exr", "empty.hdr"]


def test_a_map_that_breaks_later_keeps_its_conversion(own, out):
    run(own, out)
    before = contents(out)
    (own / "noon" / "map 0001.exr").write_bytes(b"\x76\x2f\x31\x01 broken")
    assert [row.source for row in run(own, out).failed] == ["noon/map 0001.exr"]
    assert contents(out) == before


def test_a_library_without_maps_is_a_sentence_and_writes_nothing(tmp_path, out):
    (tmp_path / "library").mkdir()
    with pytest.raises(UnusableInput, match="no maps in"):
        run(tmp_path / "library", out)
    assert not out.exists()


def test_an_output_that_is_a_file_is_a_sentence(own, out):
    out.write_text("mine")
    with pytest.raises(CannotWrite, match="is a file"):
        run(own, out)
    assert out.read_text() == "mine"


def test_two_runs_do_not_write_the_same_output(own, out):
    run(own, out)
    held = lock.take(out / STATE / "lock")
    with held, pytest.raises(CannotWrite, match="Another run"):
        run(own, out)
    assert run(own, out).known == 3


def test_a_name_that_is_a_folder_in_the_output_is_a_row(own, out):
    (out / "map 0000.lights.json" / "in the way").mkdir(parents=True)
    result = run(own, out)
    assert [row.source for row in result.failed] == ["map 0000.hdr"]
    assert "is a folder" in result.failed[0].sentence
    assert len(result.rows) == 3


@pytest.mark.parametrize("wrong", [{"workers": 0}, {"memory": 1 << 20}])
def test_settings_that_cannot_be_are_refused(own, out, wrong):
    with pytest.raises(BadSetting, match="at least"):
        convert_library(own, out, **wrong)
    assert not out.exists()
