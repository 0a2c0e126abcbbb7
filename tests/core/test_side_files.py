from __future__ import annotations

import json

import pytest

from sunsplit.core.library.side_files import LARGEST, SideFacts, facts_beside


@pytest.fixture
def folder(tmp_path):
    inner = tmp_path / "outdoor" / "morning"
    inner.mkdir(parents=True)
    return inner


def state(path, **facts):
    path.write_text(json.dumps(facts), encoding="utf-8")


def test_nothing_is_said(folder, tmp_path):
    assert facts_beside(folder / "sky_4k.hdr", tmp_path, 4096) == SideFacts()


@pytest.mark.parametrize("name", ["sky_4k.hdr.json", "sky_4k.json", "sky.json"])
def test_a_file_beside_the_map(folder, tmp_path, name):
    state(
        folder / name,
        author="Ada",
        licence="CC0-1.0",
        copyright="2024 Ada",
        tags=["sun", "Field"],
        description="A field.",
    )
    assert facts_beside(folder / "sky_4k.hdr", tmp_path, 4096) == SideFacts(
        "Ada", "CC0-1.0", "2024 Ada", ("sun", "Field"), "A field."
    )


@pytest.mark.parametrize(
    ("stated", "author"),
    [
        ({"author": " Ada "}, "Ada"),
        ({"authors": ["Ada", "Bob"]}, "Ada, Bob"),
        ({"authors": {"Ada": "All"}}, "Ada"),
        ({"authors": {"Ada": "Photography", "Bob": "Processing"}}, "Ada (Photography), Bob (Pr"),
        ({"author": "", "authors": "Bob"}, "Bob"),
        ({"author": None}, ""),
    ],
)
def test_authors_in_every_form(folder, tmp_path, stated, author):
    state(folder / "sky.json", **stated)
    found = facts_beside(folder / "sky.exr", tmp_path, 1024)
    assert found.author.startswith(author)
    assert bool(found.author) == bool(author)
    assert found.warnings == ()


def test_tags_and_categories_come_together_once_each(folder, tmp_path):
    state(folder / "sky.json", tags="sun, Field,, sun", categories=["field", "outdoor"])
    assert facts_beside(folder / "sky.exr", tmp_path, 1024).tags == ("sun", "Field", "outdoor")


def test_each_fact_is_from_the_nearest_file_that_states_it(folder, tmp_path):
    state(folder / "sky_2K.json", description="nearest")
    state(folder / "sky.json", description="near", tags=["a"])
    state(folder / "library.json", author="folder's", tags=["b"])
    state(folder.parent / "library.json", author="outer", license="CC-BY-4.0")
    state(tmp_path / "library.json", copyright="root's", license="root's")
    state(tmp_path.parent / "library.json", description="outside", author="outside")
    try:
        found = facts_beside(folder / "sky_2K.exr", tmp_path, 2048)
    finally:
        (tmp_path.parent / "library.json").unlink()
    assert found == SideFacts("folder's", "CC-BY-4.0", "root's", ("a",), "nearest")


def test_files_of_a_conversion_are_no_side_files(folder, tmp_path):
    state(folder / "sky.lights.json", format="sunsplit.lights", author="nobody")
    assert facts_beside(folder / "sky.lights.hdr", tmp_path, 1024) == SideFacts()


DAMAGED = {
    "not JSON": b"{",
    "no object": b"[1]",
    "no text": b"\xff\xfe{",
    "too deep": b"[" * 100_000,
    "too long": b" " * (LARGEST + 1),
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_file_gives_a_sentence_and_the_others_count(folder, tmp_path, content):
    (folder / "sky.json").write_bytes(content)
    state(folder / "library.json", author="Ada")
    found = facts_beside(folder / "sky.exr", tmp_path, 1024)
    assert found.author == "Ada"
    (warning,) = found.warnings
    assert warning.startswith("outdoor/morning/sky.json ")
    assert warning.endswith(".")


def test_facts_that_are_none_give_a_sentence_each(folder, tmp_path):
    state(folder / "sky.json", author=3, licence=[{"a": 1}], tags={"a": 1}, description="fine")
    found = facts_beside(folder / "sky.exr", tmp_path, 1024)
    assert (found.author, found.licence, found.tags, found.description) == ("", "", (), "fine")
    assert len(found.warnings) == 3


def test_odd_characters_go_and_a_byte_order_mark_does_no_harm(folder, tmp_path):
    text = '{"author": "A\\u0000d\\ud800a\\u0007"}'
    (folder / "sky.json").write_text(text, encoding="utf-8-sig")
    assert facts_beside(folder / "sky.exr", tmp_path, 1024).author == "Ada"


def test_a_map_outside_the_library_has_its_own_folder_only(folder, tmp_path):
    state(tmp_path / "library.json", author="Ada")
    state(folder / "library.json", licence="CC0")
    found = facts_beside(folder / "sky.exr", tmp_path / "elsewhere", 1024)
    assert (found.author, found.licence) == ("", "CC0")


def test_a_number_that_is_not_the_maps_width_is_a_part_of_its_name(tmp_path):
    (tmp_path / "sky.json").write_text('{"author": "Ada"}')
    assert facts_beside(tmp_path / "sky_2k.exr", tmp_path, 2048).author == "Ada"
    assert facts_beside(tmp_path / "sky (2048x1024).exr", tmp_path, 2048).author == "Ada"
    assert facts_beside(tmp_path / "sky_2k.exr", tmp_path, 4096).author == ""
    assert facts_beside(tmp_path / "sky_2k.exr", tmp_path, 0).author == ""
