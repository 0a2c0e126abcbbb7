"""Old or new, whole, whatever is killed, full, forbidden or written twice at a time."""

from __future__ import annotations

import copy
import errno
import itertools
import json
import os
import shutil
import signal
import subprocess
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest

from sunsplit.core.errors import UnusableInput
from sunsplit.core.files import atomic, journal, lights_json, lock
from sunsplit.core.files.conversion import account_of_files
from sunsplit.core.files.samples_json import read_samples
from tests.saver import Saver

NOBODY = 65534


@pytest.fixture(scope="module")
def saver():
    saver = Saver()
    yield saver
    saver.close()


def files(folder):
    """Names and bytes of what one sees in a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def saved(saver, folder, variant, **order):
    folder.mkdir()
    assert saver.save(folder, variant, **order) == (0, "")
    assert not (folder / journal.HIDDEN).exists()
    return files(folder)


@pytest.mark.parametrize("order", [{}, {"no_links": True}], ids=["links", "no links"])
@pytest.mark.parametrize(
    ("older", "newer"), [("map", "voronoi"), ("voronoi", "none"), ("none", "map")]
)
def test_killed_at_any_moment_leaves_old_or_new(tmp_path, saver, older, newer, order):
    old = saved(saver, tmp_path / "old", older, preview=True)
    new = saved(saver, tmp_path / "new", newer)
    states, torn, status = [], 0, -signal.SIGKILL
    while status == -signal.SIGKILL:
        folder = tmp_path / f"killed at {len(states)}"
        shutil.copytree(tmp_path / "old", folder)
        status, error = saver.save(folder, newer, kill_at=len(states), **order)
        seen = files(folder)
        assert all(content in (old.get(n), new.get(n)) for n, content in seen.items())
        # Where an older file keeps its name until the new one has it, none is ever missing.
        assert "no_links" in order or set(seen) >= set(old) & set(new)
        torn += seen not in (old, new)
        states.append(mended(folder))
        assert states[-1] in (old, new)
        assert saver.save(folder, newer) == (0, "")
        assert files(folder) == new
    assert (status, error) == (0, "")
    assert states[0] == old
    assert states[-1] == new
    assert states == sorted(states, key=lambda state: state == new)
    assert torn > 0  # else nothing had to be mended


def mended(folder):
    """Names and bytes in a folder once its conversion has been read."""
    account_of_files(folder / "map.lights.json")
    assert not (folder / journal.HIDDEN).exists()
    return files(folder)


def test_killed_while_giving_names_back_leaves_old_or_new(tmp_path, saver):
    old = saved(saver, tmp_path / "old", "map")
    new = saved(saver, tmp_path / "new", "voronoi")
    undone, status = 0, -signal.SIGKILL
    for event in itertools.count():
        folder = tmp_path / f"killed at {event}"
        shutil.copytree(tmp_path / "old", folder)
        with unchangeable(folder / "map.lights.json"):
            status, error = saver.save(folder, "voronoi", kill_at=event)
        undone += any((folder / journal.HIDDEN).glob(f"*/{journal.BACK}"))
        assert mended(folder) in (old, new)
        if status != -signal.SIGKILL:
            break
    assert (status, files(folder)) == (1, old)
    assert error.endswith("Operation not permitted. Nothing was changed.")
    assert undone > 2


def test_the_next_writer_finishes_too(tmp_path, saver):
    old = saved(saver, tmp_path / "old", "map")
    new = saved(saver, tmp_path / "new", "voronoi")
    folder = torn_folder(tmp_path, saver, old, new)
    with journal.alone(folder):
        journal.finish_others(folder)
    assert files(folder) == new
    assert not (folder / journal.HIDDEN).exists()


def torn_folder(tmp_path, saver, old, new):
    """A folder in which a process was killed when some names were taken and some not."""
    for event in range(1000):
        folder = tmp_path / f"torn at {event}"
        shutil.copytree(tmp_path / "old", folder)
        assert saver.save(folder, "voronoi", kill_at=event)[0] == -signal.SIGKILL
        if files(folder) not in (old, new):
            return folder
    raise AssertionError("no such moment")


def test_a_mixture_that_cannot_be_mended_is_one_sentence(tmp_path, saver):
    old = saved(saver, tmp_path / "old", "map")
    new = saved(saver, tmp_path / "new", "voronoi")
    folder = torn_folder(tmp_path, saver, old, new)
    shutil.rmtree(folder / journal.HIDDEN)  # as where only what is seen was copied
    with pytest.raises(UnusableInput, match=r"map\.residual\.exr was changed or is of another"):
        account_of_files(folder / "map.lights.json")


def test_a_changed_map_of_samples_is_one_sentence(tmp_path, saver):
    saved(saver, tmp_path / "a", "voronoi")
    saved(saver, tmp_path / "b", "map")
    assert len(read_samples(tmp_path / "a" / "map.samples.json").sites) == 20
    shutil.copy(tmp_path / "b" / "map.residual.exr", tmp_path / "a")
    with pytest.raises(UnusableInput, match=r"of another conversion than map\.samples\.json"):
        read_samples(tmp_path / "a" / "map.samples.json")


def test_older_documents_state_no_sums_and_are_read(tmp_path, saver):
    saved(saver, tmp_path / "a", "voronoi")
    for name, part in (("lights", "residual"), ("samples", "map")):
        path = tmp_path / "a" / f"map.{name}.json"
        document = json.loads(path.read_text())
        del document[part]["sha256"]
        path.write_text(json.dumps(document))
    assert account_of_files(tmp_path / "a" / "map.lights.json").relative_error.max() < 1e-3
    assert len(read_samples(tmp_path / "a" / "map.samples.json").sites) == 20


def test_what_an_older_conversion_had_goes_with_it(tmp_path, saver):
    saved(saver, tmp_path / "a", "voronoi", preview=True)
    assert saver.save(tmp_path / "a", "none") == (0, "")
    assert set(files(tmp_path / "a")) == {"map.lights.json"}
    assert account_of_files(tmp_path / "a" / "map.lights.json").residual.sum() == 0


def test_others_files_of_such_names_stay(tmp_path, saver):
    (tmp_path / "map.residual.exr").write_text("mine")
    assert saver.save(tmp_path, "none") == (0, "")
    assert (tmp_path / "map.residual.exr").read_text() == "mine"
    (tmp_path / "map.preview.png").mkdir()
    (tmp_path / "map2.residual.exr").write_text("of another map")
    assert saver.save(tmp_path, "map") == (0, "")
    assert (tmp_path / "map.preview.png").is_dir()
    assert (tmp_path / "map2.residual.exr").read_text() == "of another map"


def test_writers_at_once_and_a_reader_see_whole_conversions(tmp_path):
    savers = {"map": Saver(), "voronoi": Saver(), "none": Saver()}
    whole = [saved(other, tmp_path / name, name) for name, other in savers.items()]
    folder = tmp_path / "out"
    folder.mkdir()
    assert savers["none"].save(folder, "none") == (0, "")
    for name, other in savers.items():
        other.start(folder, name, times=25)
    seen = set()
    while not all(other.is_done() for other in savers.values()):
        account = account_of_files(folder / "map.lights.json")
        assert account.relative_error.max() < 1e-3 or not account.residual.any()
        seen.add(account.source[0])
    assert len(seen) > 1
    answers = [other.answer() for other in savers.values()]
    for other in savers.values():
        other.close()
    assert answers == [(0, "")] * len(savers)
    assert files(folder) in whole
    assert not (folder / journal.HIDDEN).exists()


def test_a_writer_that_lives_is_left_alone(tmp_path, saver):
    with journal.alone(tmp_path):
        writer = journal.begin(tmp_path)
    (writer.own / "0.exr").write_text("half of it")
    saved(saver, tmp_path / "other", "map")
    assert saver.save(tmp_path, "map") == (0, "")
    assert (writer.own / "0.exr").read_text() == "half of it"
    writer.alive.close()  # as the system does for the dead
    assert saver.save(tmp_path, "map") == (0, "")
    assert not (tmp_path / journal.HIDDEN).exists()


def test_a_lock_that_is_kept_is_one_sentence(tmp_path):
    with (
        journal.alone(tmp_path),
        pytest.raises(TimeoutError, match="does not come to an end"),
        journal.alone(tmp_path, patience=0.1),
    ):
        pass
    with journal.alone(tmp_path, patience=0.1):
        assert (tmp_path / journal.HIDDEN).is_dir()


def test_where_there_are_no_locks_one_writes_all_the_same(tmp_path, monkeypatch):
    # No such file system can be had here: flock(2) says this on them.
    def refuse(file):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock, "_lock", refuse)
    dead = tmp_path / journal.HIDDEN / "0123"
    dead.mkdir(parents=True)
    with atomic.written_together(tmp_path, ["a.txt"]) as (draft,):
        draft.write_text("new")
    assert files(tmp_path) == {"a.txt": b"new"}
    assert dead.is_dir()  # nobody can tell whether it lives


@pytest.mark.parametrize(
    "text",
    [
        '[{"name": "../../victim", "draft": "0.exr", "had_older": false}]',
        '[{"name": "/victim", "draft": null, "had_older": true}]',
        '[{"name": "victim", "draft": "../../../victim2", "had_older": false}]',
        "[1]",
        '[{"nam',
    ],
)
def test_a_journal_that_is_none_of_ours_is_not_obeyed(tmp_path, saver, text):
    folder = tmp_path / "a" / "b"
    own = folder / journal.HIDDEN / "0123"
    own.mkdir(parents=True)
    (own / "0.exr").write_text("evil")
    (own / journal.ONWARDS).write_text(text)
    (tmp_path / "victim2").write_text("mine")
    assert saver.save(folder, "none") == (0, "")
    assert set(files(folder)) == {"map.lights.json"}
    assert files(tmp_path) == {"victim2": b"mine"}
    assert not (folder / journal.HIDDEN).exists()


@contextmanager
def unchangeable(path):
    """A file that not even root can replace."""
    change = ["chattr", "+i", str(path)]
    if shutil.which("chattr") is None or subprocess.run(change, capture_output=True).returncode:
        pytest.skip("needs root and a file system with chattr +i")
    try:
        yield
    finally:
        subprocess.run(["chattr", "-i", str(path)], check=True)


@pytest.mark.parametrize("name", ["map.residual.exr", "map.preview.png", "map.lights.json"])
def test_a_name_that_cannot_be_taken_leaves_the_old(tmp_path, saver, name):
    old = saved(saver, tmp_path / "out", "map", preview=True)
    with unchangeable(tmp_path / "out" / name):
        status, error = saver.save(tmp_path / "out", "voronoi", preview=True)
    assert (status, files(tmp_path / "out")) == (1, old)
    assert error.startswith("CannotWrite: Cannot write into")
    assert error.endswith("Operation not permitted. Nothing was changed.")
    assert not (tmp_path / "out" / journal.HIDDEN).exists()


@pytest.mark.parametrize("size", [1, 500, 3000, 6000, 20_000])
def test_a_limit_to_the_size_of_files_leaves_the_old(tmp_path, saver, size):
    old = saved(saver, tmp_path / "out", "map", preview=True)
    status, error = saver.save(tmp_path / "out", "map", preview=True, file_size=size)
    assert (status, files(tmp_path / "out")) == (1, old)
    assert error.endswith("File too large. Nothing was changed.")
    assert not (tmp_path / "out" / journal.HIDDEN).exists()


def test_a_full_disk_leaves_old_or_new(tmp_path, saver):
    old = saved(saver, tmp_path / "old", "map", preview=True)
    new = saved(saver, tmp_path / "new", "voronoi", preview=True)
    page = os.sysconf("SC_PAGE_SIZE")
    needed = sum(-(-len(content) // page) for content in old.values())
    disk = tmp_path / "disk"
    disk.mkdir()
    failed, status = 0, 1
    while status == 1:
        mount = ["mount", "-t", "tmpfs", "-o", f"size={(needed + failed) * page}", "tmpfs", disk]
        if subprocess.run(mount, capture_output=True).returncode:
            pytest.skip("needs the right to mount a small disk")
        try:
            shutil.copytree(tmp_path / "old", disk / "out")
            status, error = saver.save(disk / "out", "voronoi", preview=True)
            assert files(disk / "out") == (old if status else new)
            assert not (disk / "out" / journal.HIDDEN).exists()
        finally:
            subprocess.run(["umount", disk], check=True)
        if status:
            assert error.endswith("No space left on device. Nothing was changed.")
            failed += 1
    assert failed > 5


def test_a_folder_that_one_may_not_write_into(saver):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "out"
        old = saved(saver, folder, "map")
        Path(name).chmod(0o755)
        folder.chmod(0o555)
        user = NOBODY if os.geteuid() == 0 else None
        status, error = saver.save(folder, "voronoi", user=user)
        folder.chmod(0o755)
        assert (status, files(folder)) == (1, old)
        assert error == f"CannotWrite: Cannot write into {folder}: Permission denied. " + (
            "Nothing was changed."
        )
        assert lights_json.read(folder / "map.lights.json")[0]["residual"]["sha256"]


def spoilt(document, value):
    """Copies of a document, each with another of its parts replaced by a value."""
    for key in document if isinstance(document, dict) else range(len(document)):
        other = copy.copy(document)
        other[key] = value
        yield other
        if isinstance(document[key], (dict, list)):
            for part in spoilt(document[key], value):
                other = copy.copy(document)
                other[key] = part
                yield other


@pytest.mark.parametrize(
    "value", [None, [], {}, "", "a\0b", "..", "../x", -1, float("inf"), float("nan"), 10**400]
)
@pytest.mark.parametrize("name", ["lights", "samples"])
def test_spoilt_documents_are_read_or_one_sentence(tmp_path, saver, name, value):
    saved(saver, tmp_path / "a", "voronoi")
    path = tmp_path / "a" / f"map.{name}.json"
    read = account_of_files if name == "lights" else read_samples
    document = json.loads(path.read_text())
    if name == "samples":
        document["samples"] = document["samples"][:2]
    said = []
    for other in spoilt(document, value):
        path.write_text(json.dumps(other))
        try:
            read(path)
        except UnusableInput as error:
            said.append(str(error))
    assert len(said) > 10
    assert not any("\n" in sentence for sentence in said)


def test_a_residual_that_is_a_folder_is_one_sentence(tmp_path, saver):
    saved(saver, tmp_path / "a", "map")
    (tmp_path / "a" / "map.residual.exr").unlink()
    (tmp_path / "a" / "map.residual.exr").mkdir()
    with pytest.raises(UnusableInput, match=r"map\.residual\.exr cannot be read: Is a directory"):
        account_of_files(tmp_path / "a" / "map.lights.json")


def test_a_document_nested_without_end_is_one_sentence(tmp_path):
    path = tmp_path / "map.lights.json"
    path.write_text("[" * 100_000)
    with pytest.raises(UnusableInput, match="not readable JSON"):
        lights_json.read(path)


def test_a_lock_whose_folder_comes_and_goes(tmp_path):
    """The folder goes with each holder: others meet it at every moment of that."""
    path, held, errors = tmp_path / "hidden" / "lock", [], []

    def work() -> None:
        try:
            for _ in range(500):
                with lock.locked(path):
                    held.append(1)
                    assert len(held) == 1
                    held.pop()
        except BaseException as error:
            errors.append(error)

    workers = [threading.Thread(target=work) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert errors == []
    assert not path.parent.exists()
