from __future__ import annotations

from uuid import UUID

import pytest

from sunsplit.core.errors import CannotWrite
from sunsplit.core.library.catalogues import (
    FILE,
    catalogue_id,
    catalogue_path,
    read_catalogues,
    write_catalogues,
)

THEIRS = "11111111-2222-3333-4444-555555555555"


def lines(folder):
    text = (folder / FILE).read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line.strip() and not line.startswith("#")]


def test_catalogues_follow_the_folders_with_those_that_they_lie_in(tmp_path):
    ids = write_catalogues(tmp_path, ["outdoor/morning", "studio"])
    assert set(ids) == {"outdoor", "outdoor/morning", "studio"}
    assert lines(tmp_path) == [
        "VERSION 1",
        f"{ids['outdoor']}:outdoor:outdoor",
        f"{ids['outdoor/morning']}:outdoor/morning:outdoor-morning",
        f"{ids['studio']}:studio:studio",
    ]
    assert all(UUID(one) for one in ids.values())
    assert read_catalogues(tmp_path) == ids


def test_ids_are_the_same_everywhere_and_another_for_each_path(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    assert write_catalogues(tmp_path / "a", ["x/y"]) == write_catalogues(tmp_path / "b", ["x/y"])
    assert catalogue_id("x/y") == read_catalogues(tmp_path / "a")["x/y"]
    assert catalogue_id("x/y") != catalogue_id("x/z")


def test_a_second_run_adds_what_is_new_and_writes_nothing_else(tmp_path):
    write_catalogues(tmp_path, ["a"])
    before = (tmp_path / FILE).read_bytes()
    write_catalogues(tmp_path, ["a", ""])
    assert (tmp_path / FILE).read_bytes() == before
    write_catalogues(tmp_path, ["b"])
    assert (tmp_path / FILE).read_bytes().startswith(before)
    assert len(lines(tmp_path)) == 3


def test_what_others_have_written_stays(tmp_path):
    text = f"# mine\nVERSION 1\n\n{THEIRS}:outdoor:Outdoor\n  \n# end"  # without a last line feed
    (tmp_path / FILE).write_text(text, encoding="utf-8")
    ids = write_catalogues(tmp_path, ["outdoor/night"])
    assert (tmp_path / FILE).read_text(encoding="utf-8").startswith(text + "\n")
    assert ids["outdoor"] == THEIRS
    assert catalogue_id("outdoor", ids) == THEIRS
    assert len(lines(tmp_path)) == 3


def test_a_catalogue_that_was_moved_in_blender_stays_where_it_is(tmp_path):
    moved = f"VERSION 1\n{catalogue_id('sky')}:my/heavens:heavens\n"
    (tmp_path / FILE).write_text(moved, encoding="utf-8")
    write_catalogues(tmp_path, ["sky"])
    assert (tmp_path / FILE).read_text(encoding="utf-8") == moved


@pytest.mark.parametrize("content", [b"VERSION 2\n", b"\xff\xfe\x00"])
def test_a_file_of_another_kind_is_left_alone(tmp_path, content):
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(CannotWrite, match=FILE):
        write_catalogues(tmp_path, ["a"])
    assert (tmp_path / FILE).read_bytes() == content
    assert [path.name for path in tmp_path.iterdir()] == [FILE]


@pytest.mark.parametrize(
    ("folder", "path"),
    [
        ("a/b", "a/b"),
        ("", ""),
        (".", ""),
        ("a: b/c\\d", "a- b/c-d"),
        ("/a// b /", "a/b"),
        ("Himmel/früh\n", "Himmel/früh-"),
    ],
)
def test_paths_hold_only_what_blender_can_write(folder, path):
    assert catalogue_path(folder) == path


def test_a_long_path_has_a_short_simple_name(tmp_path):
    path = "/".join(["früh" * 10] * 4)
    write_catalogues(tmp_path, [path])
    names = [line.split(":")[2] for line in lines(tmp_path)[1:]]
    assert max(len(name.encode()) for name in names) <= 63
    assert path in read_catalogues(tmp_path)
