"""A library with `--assets`: .blend files by Blenders in processes of their own."""

from __future__ import annotations

import json
import os
import sys

import bpy
import pytest

from sunsplit.core import LibraryOptions, cli, convert_library
from sunsplit.core.library.assets import blender_command
from sunsplit.core.library.events import AssetSettled
from sunsplit.core.settings import BadSetting
from tests.files import sunny, write_exr, write_hdr


@pytest.fixture
def library(tmp_path):
    folder = tmp_path / "library"
    (folder / "morning" / "early").mkdir(parents=True)
    write_hdr(folder / "morning" / "early" / "sky.hdr", sunny(64))
    write_exr(folder / "plain.exr", sunny(128))
    about = {"author": "A. Painter", "license": "CC0", "tags": ["clear"]}
    (folder / "library.json").write_text(json.dumps(about))
    return folder


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def run(library, out, **options):
    return convert_library(library, out, LibraryOptions(**options), workers=1)


def assets_in(blend):
    with bpy.data.libraries.load(str(blend), assets_only=True) as (inside, _):
        return sorted(inside.worlds), sorted(inside.collections)


def test_each_map_becomes_a_file_beside_its_conversion_and_is_not_made_again(library, out):
    heard = []
    result = convert_library(
        library, out, LibraryOptions(assets="each"), workers=1, listen=heard.append
    )
    assert result.is_well
    assert {(one.blend, one.sources, one.known) for one in result.assets} == {
        ("plain.blend", ("plain.exr",), False),
        ("morning/early/sky.blend", ("morning/early/sky.hdr",), False),
    }
    assert [event for event in heard if isinstance(event, AssetSettled)] == list(result.assets)
    assert assets_in(out / "plain.blend")[0]
    assert assets_in(out / "morning" / "early" / "sky.blend")[1]
    catalogues = (out / "blender_assets.cats.txt").read_text()
    assert ":morning/early:" in catalogues
    assert {(row.author, row.licence) for row in result.rows} == {("A. Painter", "CC0")}
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.blend")}
    again = run(library, out, assets="each")
    assert all(one.known for one in again.assets)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.blend")} == before
    # What they are made of has changed, or they have gone: of one, then of the other.
    (out / "plain.blend").unlink()
    (library / "morning" / "early" / "sky.json").write_text('{"description": "at six"}')
    assert not any(one.known for one in run(library, out, assets="each").assets)
    assert (out / "plain.blend").is_file()


def test_one_file_for_all_holds_the_assets_of_all(library, out, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("library", "out", assets="one", pack=True)
    assert result.is_well
    assert [one.blend for one in result.assets] == ["out.blend"]
    worlds, collections = assets_in(out / "out.blend")
    assert len(worlds) == len(collections) == 2
    assert run(library, out, assets="one", pack=True).assets[0].known
    assert not run(library, out, assets="one", pack=False).assets[0].known


def test_a_file_that_cannot_be_written_is_said_and_makes_the_exit_status(library, out, capfd):
    (out / "plain.blend" / "in the way").mkdir(parents=True)
    arguments = ["library", library, "-o", out, "--assets", "each", "--json", "--workers", "1"]
    assert cli.main([os.fspath(argument) for argument in arguments]) == 1
    lines = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assets = {line["blend"]: line["sentence"] for line in lines if line["event"] == "asset"}
    assert assets["morning/early/sky.blend"] == ""
    assert "is a folder" in assets["plain.blend"]
    assert (lines[-1]["assets"], lines[-1]["assets_failed"], lines[-1]["failed"]) == (2, 1, 0)


def test_blender_is_this_one_or_the_one_that_is_named(tmp_path):
    assert blender_command(None)[0] == sys.executable
    program = tmp_path / "my blender"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    command = blender_command(os.fspath(program))
    assert command[0] == os.fspath(program)
    assert "--background" in command
    with pytest.raises(BadSetting, match="there is no program"):
        blender_command(os.fspath(tmp_path / "none"))


def test_without_blender_nothing_is_begun(library, out):
    with pytest.raises(BadSetting, match="needs Blender"):
        convert_library(library, out, LibraryOptions(assets="each"), blender="no such program")
    assert not out.exists()
