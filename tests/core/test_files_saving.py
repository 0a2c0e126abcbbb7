from __future__ import annotations

import hashlib
import json
import os
import signal
import threading

import numpy as np
import OpenEXR
import pytest

from sunsplit.core.conversion import convert
from sunsplit.core.errors import CannotWrite, UnusableInput
from sunsplit.core.files import atomic, exr, journal, lights_json
from sunsplit.core.files.conversion import account_of_files, save
from sunsplit.core.files.maps import load
from sunsplit.core.settings import ConversionSettings
from sunsplit.core.tolerances import ACCOUNT_FLOAT32, ACCOUNT_HALF
from tests.files import noise, sunny, write_exr
from tests.maps import environment, sky

RESULT = ["map.lights.json", "map.preview.png", "map.residual.exr"]


def converted(pixels=None, name="map", **settings):
    pixels = sunny() if pixels is None else pixels
    return convert(environment(pixels, name), ConversionSettings(**settings))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def type_of_pixels(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {channel.pixels.dtype.name for channel in file.parts[0].channels.values()}


def test_what_is_written(tmp_path):
    files = save(converted(), tmp_path, preview=True)
    assert names(tmp_path) == RESULT
    assert files.lights == tmp_path / "map.lights.json"
    assert files.residual == tmp_path / "map.residual.exr"
    assert files.preview == tmp_path / "map.preview.png"


def test_what_is_not_asked_for_is_not_written(tmp_path):
    files = save(converted(residual="none"), tmp_path)
    assert names(tmp_path) == ["map.lights.json"]
    assert (files.residual, files.preview) == (None, None)


def test_the_document_has_the_fields_that_others_read(tmp_path):
    source = write_exr(tmp_path / "map.exr", sunny())
    conversion = convert(load(source))
    files = save(conversion, tmp_path)
    document = json.loads(files.lights.read_text())
    assert document["format"] == "sunsplit.lights"
    assert document["version"] == 1
    assert document["axes"] == "right-handed, Z up, image centre +X, u = 0.25 is +Y"
    assert document["source"] == {
        "file": "map.exr",
        "width": 128,
        "height": 64,
        "sha256": load(source).sha256,
        "repaired_pixels": 0,
    }
    assert document["settings"]["share"] == pytest.approx(conversion.strata.share)
    assert document["settings"]["threshold"] > 0
    assert document["residual"] == {
        "file": "map.residual.exr",
        "kind": "map",
        "width": 128,
        "height": 64,
        "sha256": hashlib.sha256(files.residual.read_bytes()).hexdigest(),
    }
    (sun,) = document["suns"]
    assert set(sun) == {
        "to_light",
        "irradiance",
        "scalar_irradiance",
        "angular_diameter",
        "stratum",
    }
    assert np.linalg.norm(sun["to_light"]) == pytest.approx(1)
    account = document["account"]
    total = np.add(account["suns"], account["residual"])
    assert total == pytest.approx(account["source"], rel=1e-9)


def test_warnings_about_the_file_reach_the_document(tmp_path):
    wide = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    pixels = sunny()
    pixels[3, 4] = np.nan
    conversion = convert(load(write_exr(tmp_path / "map.exr", pixels, chromaticities=wide)))
    document = json.loads(save(conversion, tmp_path).lights.read_text())
    assert any("primaries" in note for note in document["notes"])
    assert document["source"]["repaired_pixels"] == 1


def test_suns_come_back_as_they_went(tmp_path):
    conversion = converted()
    _, suns, account = lights_json.read(save(conversion, tmp_path).lights)
    assert len(suns) == len(conversion.suns) == 1
    for field in ("to_light", "irradiance", "scalar_irradiance", "angular_diameter", "stratum"):
        assert np.array_equal(getattr(suns[0], field), getattr(conversion.suns[0], field))
    assert np.array_equal(account.residual, conversion.account.residual)


def faint_sky():
    return sunny() * np.float32(1e-7)


def clipped_peak():
    """A sun so large that no lamp is made of it: it stays in the residual, past the halves."""
    pixels = sky(128).astype(np.float32)
    pixels[:20] = 70_000
    return pixels


@pytest.mark.parametrize(
    ("pixels", "kind", "tolerance"),
    [
        (sunny() + noise(64), "float16", ACCOUNT_HALF),
        (noise(64), "float16", ACCOUNT_HALF),
        (clipped_peak(), "float32", ACCOUNT_FLOAT32),
        (faint_sky(), "float32", ACCOUNT_FLOAT32),
    ],
    ids=["suns", "no sun", "beyond half", "below half"],
)
def test_half_only_where_it_is_enough(tmp_path, pixels, kind, tolerance):
    conversion = converted(pixels)
    files = save(conversion, tmp_path)
    assert type_of_pixels(files.residual) == {kind}
    read = account_of_files(files.lights)
    assert read.relative_error.max() < tolerance
    assert read.source == pytest.approx(conversion.account.source)
    if kind == "float32":
        assert (load(files.residual).radiance == conversion.residual).all()


@pytest.mark.parametrize(("brightest", "kind"), [(65_504, "float16"), (65_504.1, "float32")])
def test_the_limit_of_halves(tmp_path, brightest, kind):
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[1, 2] = brightest
    exr.write(tmp_path / "map.exr", pixels)
    assert type_of_pixels(tmp_path / "map.exr") == {kind}
    assert np.isfinite(load(tmp_path / "map.exr").radiance).all()


def test_one_faint_channel_is_enough_for_float(tmp_path):
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[..., 2] = 2e-8
    exr.write(tmp_path / "map.exr", pixels)
    assert type_of_pixels(tmp_path / "map.exr") == {"float32"}


def test_written_maps_state_their_primaries(tmp_path):
    exr.write(tmp_path / "map.exr", noise())
    with OpenEXR.File(str(tmp_path / "map.exr"), separate_channels=True) as file:
        header = file.parts[0].header
        assert np.ravel(header["chromaticities"]) == pytest.approx(exr.REC709)
        assert header["compression"] == OpenEXR.PIZ_COMPRESSION
    assert load(tmp_path / "map.exr").warnings == ()


@pytest.mark.parametrize("name", ["a.b", "with space", "ü 空", "..x", "map\udcff", "n" * 240])
def test_any_name_of_a_map(tmp_path, name):
    files = save(converted(name=name), tmp_path / "new" / "..." / "out.d", preview=True)
    assert files.lights.name == f"{name}.lights.json"
    assert len(names(files.lights.parent)) == 3
    assert account_of_files(files.lights).relative_error.max() < ACCOUNT_HALF


def test_older_files_are_replaced(tmp_path):
    save(converted(), tmp_path, preview=True)
    before = (tmp_path / "map.lights.json").read_bytes()
    files = save(converted(sunny(radiance=40_000)), tmp_path, preview=True)
    assert names(tmp_path) == RESULT
    assert files.lights.read_bytes() != before
    assert account_of_files(files.lights).relative_error.max() < ACCOUNT_HALF


@pytest.fixture
def older(tmp_path):
    """A folder that holds an older result, and what is in it."""
    folder = tmp_path / "out"
    folder.mkdir()
    for name in RESULT:
        (folder / name).write_text(f"old {name}")
    return folder, {name: f"old {name}" for name in RESULT}


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def write_and_fail(folder, failure):
    with atomic.written_together(folder, RESULT) as drafts:
        drafts[0].write_text("new")
        drafts[1].write_text("ne")
        raise failure


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_while_writing_changes_nothing(older, failure):
    folder, before = older
    with pytest.raises((CannotWrite, KeyboardInterrupt)):
        write_and_fail(folder, failure)
    assert contents(folder) == before


def test_a_target_that_is_a_folder_changes_nothing(older):
    folder, before = older
    (folder / "map.residual.exr").unlink()
    (folder / "map.residual.exr").mkdir()
    del before["map.residual.exr"]
    with pytest.raises(CannotWrite, match=r"map\.residual\.exr is a folder"):
        save(converted(), folder, preview=True)
    (folder / "map.residual.exr").rmdir()
    assert contents(folder) == before


def test_a_late_interrupt_says_so(tmp_path, monkeypatch):
    rename = journal.take_names

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        rename(*arguments)

    monkeypatch.setattr(journal, "take_names", interrupted)
    with pytest.raises(KeyboardInterrupt, match="the files are written"):
        save(converted(), tmp_path, preview=True)
    assert names(tmp_path) == RESULT
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_saving_in_a_thread(tmp_path):
    thread = threading.Thread(target=save, args=(converted(), tmp_path))
    thread.start()
    thread.join()
    assert len(names(tmp_path)) == 2


@pytest.mark.parametrize("parts", [["file"], ["file", "below"]])
def test_a_folder_that_cannot_be_is_one_sentence(tmp_path, parts):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(CannotWrite, match=r"^Cannot write into .*\. Nothing was changed\.$"):
        save(converted(), tmp_path.joinpath(*parts))
    assert contents(tmp_path) == {"file": "mine"}


def test_folders_made_in_vain_go_away(tmp_path):
    with (
        pytest.raises(CannotWrite),
        atomic.written_together(tmp_path / "a" / "b", ["map.txt"]),
    ):
        pass  # nothing is written, so there is nothing to give a name to
    assert names(tmp_path) == []


def test_a_folder_that_nobody_can_write():
    # Where no file can be made, not even by root.
    with pytest.raises(CannotWrite, match="Cannot write into /proc"):
        save(converted(), "/proc/self/fdinfo")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "not readable JSON"),
        ("[]", "not written by Sunsplit"),
        ('{"format": "sunsplit.lights", "version": 2}', "has version 2"),
        ('{"format": "sunsplit.lights", "version": 1}', "damaged"),
    ],
)
def test_foreign_documents_are_refused(tmp_path, text, sentence):
    path = tmp_path / "map.lights.json"
    path.write_text(text)
    with pytest.raises(UnusableInput, match=sentence):
        lights_json.read(path)


def test_a_lost_residual_is_named(tmp_path):
    files = save(converted(), tmp_path)
    files.residual.unlink()
    with pytest.raises(UnusableInput, match=r"map\.residual\.exr is missing"):
        account_of_files(files.lights)
    files.lights.unlink()
    with pytest.raises(UnusableInput, match="does not exist"):
        account_of_files(files.lights)
