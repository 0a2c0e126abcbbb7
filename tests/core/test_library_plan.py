from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sunsplit.core import ExportSettings, convert, export_conversion, load, save
from sunsplit.core.errors import UnusableInput
from sunsplit.core.library.options import LibraryOptions
from sunsplit.core.library.plan import plan
from sunsplit.core.library.scan import MapFile, Scan, scan
from sunsplit.core.library.sizes import is_size, name_without_size, size_name, width_of
from sunsplit.core.settings import BadSetting
from tests.files import noise, sunny, write_exr, write_hdr

# Sizes in names


@pytest.mark.parametrize(
    ("stem", "width", "name"),
    [
        ("sky_4k", 4096, "sky"),
        ("sky_4K", 4096, "sky"),
        ("sky-16k", 16384, "sky"),
        ("sky 2k", 2048, "sky"),
        ("sky (2k)", 2048, "sky"),
        ("sky.8k", 8192, "sky"),
        ("DayEnvironmentHDRI001_1K-HDR", 1024, "DayEnvironmentHDRI001-HDR"),
        ("sky_4096x2048", 4096, "sky"),
        ("sky_4096", 4096, "sky"),
        ("4k_sky", 4096, "sky"),
        ("sky_4k", 4000, "sky"),
        # Not the size of the map, and so part of its name.
        ("sky_4k", 2048, "sky_4k"),
        ("kloppenheim_05", 1024, "kloppenheim_05"),
        ("sky_2048", 4096, "sky_2048"),
        ("sky4k", 4096, "sky4k"),
        ("4k", 4096, "4k"),
        ("walk_2k_to_8k", 8192, "walk_2k_to"),
        ("sky", 0, "sky"),
    ],
)
def test_name_without_size(stem, width, name):
    assert name_without_size(stem, width) == name


@given(st.text(), st.integers(0, 1 << 17))
def test_any_name_keeps_something(stem, width):
    name = name_without_size(stem, width)
    assert name or not stem
    assert len(name) <= len(stem)


def test_folders_of_one_size():
    assert is_size("4k", 4096)
    assert is_size("4096", 4096)
    assert not is_size("4k", 2048)
    assert not is_size("4k maps", 4096)


@pytest.mark.parametrize("width", [2, 512, 1000, 1024, 4096, 16384])
def test_names_of_sizes_mean_their_widths(width):
    # 1 to 2 digits have no number of pixels: nobody writes a map so small.
    assert width_of(size_name(width)) == (width if width > 99 else None)


# Finding maps


@pytest.fixture
def library(tmp_path):
    folder = tmp_path / "library"
    (folder / "inner" / "most").mkdir(parents=True)
    return folder


def found(library, output=None, **options):
    result = scan(library, output or library.parent / "out", LibraryOptions(**options))
    assert result.unread == ()
    return [file.path for file in result.files]


def test_maps_are_found_in_all_folders(library):
    write_exr(library / "b.exr", noise())
    write_hdr(library / "inner" / "a.HDR", noise())
    write_hdr(library / "inner" / "most" / "c.hdr", noise(8))
    (library / "readme.txt").write_text("no map")
    result = scan(library, library.parent / "out", LibraryOptions())
    assert [file.path for file in result.files] == ["b.exr", "inner/a.HDR", "inner/most/c.hdr"]
    assert [(file.width, file.height) for file in result.files] == [(32, 16), (32, 16), (16, 8)]
    assert all(file.size > 0 for file in result.files)


def test_what_is_hidden_or_ours_is_no_map(library):
    write_exr(library / "a.exr", noise())
    write_exr(library / "._a.exr", noise())
    (library / ".trash").mkdir()
    write_exr(library / ".trash" / "b.exr", noise())
    write_exr(library / "inner" / "a.residual.exr", noise())
    assert found(library) == ["a.exr", "inner/a.residual.exr"]
    (library / "inner" / "a.lights.json").write_text("{}")
    assert found(library) == ["a.exr"]


def test_what_was_exported_is_no_map(library):
    """Into the library's folder itself, as one does with one map."""
    write_exr(library / "a.exr", sunny())
    lights = save(convert(load(library / "a.exr")), library).lights
    for kind in ("pbrt", "mitsuba"):
        export_conversion(lights, library, ExportSettings(kind))
        assert (library / f"a.{kind}.exr").is_file()
    assert found(library) == ["a.exr"]
    (library / "a.lights.xml").unlink()
    assert found(library) == ["a.exr", "a.mitsuba.exr"]


def test_output_inside_of_the_library_is_not_searched(library):
    write_exr(library / "a.exr", noise())
    write_exr(library / "inner" / "b.exr", noise())
    assert found(library, library / "inner") == ["a.exr"]
    assert found(library, library) == ["a.exr", "inner/b.exr"]


def test_patterns(library):
    for path in ("a.exr", "b.hdr", "inner/a.exr", "inner/most/c.exr"):
        write = write_exr if path.endswith("exr") else write_hdr
        write(library / path, noise())
    assert found(library, include=("*.EXR",)) == ["a.exr", "inner/a.exr", "inner/most/c.exr"]
    assert found(library, include=("inner/*",)) == ["inner/a.exr", "inner/most/c.exr"]
    assert found(library, exclude=("a.*",)) == ["b.hdr", "inner/most/c.exr"]
    assert found(library, exclude=("inner/most/*", "b*")) == ["a.exr", "inner/a.exr"]


def test_ldr_images_are_found_only_if_allowed(library):
    (library / "a.png").write_bytes(b"")
    assert found(library) == []
    assert found(library, allow_ldr=True) == ["a.png"]


def test_linked_folders_are_searched_once(library):
    write_exr(library / "inner" / "a.exr", noise())
    elsewhere = library.parent / "elsewhere"
    elsewhere.mkdir()
    write_exr(elsewhere / "b.exr", noise())
    (library / "inner" / "round").symlink_to(library, target_is_directory=True)
    (library / "linked").symlink_to(elsewhere, target_is_directory=True)
    (library / "linked again").symlink_to(elsewhere, target_is_directory=True)
    assert found(library) == ["inner/a.exr", "linked/b.exr"]


def test_damaged_map_is_found_without_a_size(library):
    (library / "a.exr").write_bytes(b"\x76\x2f\x31\x01 and nothing more")
    result = scan(library, library.parent / "out", LibraryOptions())
    assert [(file.path, file.width) for file in result.files] == [("a.exr", 0)]


def test_no_such_folder_is_a_sentence(tmp_path):
    with pytest.raises(UnusableInput, match="is not a folder"):
        scan(tmp_path / "none", tmp_path / "out", LibraryOptions())


AS_NOBODY = """
import os, sys
from pathlib import Path
from sunsplit.core.library.options import LibraryOptions
from sunsplit.core.library.scan import scan
from sunsplit.core.files import exr
import OpenEXR
if os.geteuid() == 0:
    os.setuid(65534)
found = scan(Path(sys.argv[1]), Path(sys.argv[1], "out"), LibraryOptions())
print([file.path for file in found.files], *found.unread)
"""


def test_folder_that_cannot_be_read_is_said():
    # Not in pytest's folder, which is closed to all others: root can read everything.
    with tempfile.TemporaryDirectory() as name:
        library = Path(name)
        library.chmod(0o755)
        (library / "closed").mkdir()
        write_exr(library / "a.exr", noise())
        (library / "closed").chmod(0)
        command = [sys.executable, "-c", AS_NOBODY, name]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith("['a.exr'] The folder")
    assert "closed cannot be read: Permission denied." in done.stdout


# What is to be made of them


def files(*entries):
    """A scan of "path@width"."""
    made = []
    for entry in entries:
        path, _, width = entry.partition("@")
        made.append(MapFile(path, int(width), int(width) // 2, False, 1))
    return Scan(tuple(made), ())


def planned(*entries, **options):
    """What is looked at, with names of other files and of outputs."""
    return [
        (
            each.file.path,
            [file.path for file in each.others],
            [(f"{out.folder}/{out.stem}", out.width) for out in each.outputs],
        )
        for each in plan(files(*entries), LibraryOptions(**options))
    ]


def test_each_map_is_written_once_beside_its_place_in_the_tree():
    assert planned("b.hdr@1024", "in/a.exr@2048") == [
        ("b.hdr", [], [("./b", None)]),
        ("in/a.exr", [], [("in/a", None)]),
    ]


def test_sizes_of_a_map_are_one_and_the_largest_is_looked_at():
    names = ("sky_1k.hdr@1024", "sky_4k.exr@4096", "sky_2k.hdr@2048", "sea_1k.hdr@1024")
    assert planned(*names) == [
        ("sea_1k.hdr", [], [("./sea_1k", None)]),
        ("sky_4k.exr", ["sky_1k.hdr", "sky_2k.hdr"], [("./sky_4k", None)]),
    ]
    assert planned(*names[:3], largest=2048) == [
        ("sky_2k.hdr", ["sky_1k.hdr", "sky_4k.exr"], [("./sky_2k", None)]),
    ]
    assert planned("sky_4k.exr@4096", "sky_8k.exr@8192", largest=1024)[0][0] == "sky_4k.exr"


def test_folders_of_sizes_are_one_map():
    assert planned("1k/sky.hdr@1024", "4k/sky.hdr@4096") == [
        ("4k/sky.hdr", ["1k/sky.hdr"], [("4k/sky", None)])
    ]


def test_a_size_that_is_a_lie_groups_nothing():
    assert len(planned("sky_1k.hdr@1024", "sky_4k.hdr@1024")) == 2


def test_two_files_of_one_name_and_size_are_two_maps_with_names_of_their_own():
    assert planned("sky.exr@1024", "sky.hdr@1024") == [
        ("sky.exr", [], [("./sky.exr", None)]),
        ("sky.hdr", [], [("./sky.hdr", None)]),
    ]


def test_names_that_differ_in_case_alone_do_not_collide():
    stems = [out[0][0] for _, _, out in planned("Sky.hdr@1024", "sky.hdr@1024")]
    assert len({stem.casefold() for stem in stems}) == 2


def test_a_file_without_a_size_in_its_header_is_a_map_of_its_own():
    assert planned("sky_1k.hdr@1024", "sky_1k.exr@0") == [
        ("sky_1k.exr", [], [("./sky_1k.exr", None)]),
        ("sky_1k.hdr", [], [("./sky_1k.hdr", None)]),
    ]


def test_each_size_that_is_asked_for_is_written():
    names = ("sky_1k.hdr@1024", "sky_8k.exr@8192")
    assert planned(*names, sizes="all")[0][2] == [("./sky_8k", 8192), ("./sky_1k", 1024)]
    assert planned(*names, sizes=(4096, 1024))[0][2] == [("./sky_4k", 4096), ("./sky_1k", 1024)]
    assert planned(*names, sizes=(16384,))[0][2] == [("./sky_8k", 8192)]
    assert planned("1k/sky.hdr@1024", "4k/sky.hdr@4096", sizes="all")[0][2] == [
        ("4k/sky", 4096),
        ("1k/sky", 1024),
    ]


def test_sizes_that_are_no_whole_part_of_a_map_are_not_made():
    assert planned("sky.hdr@3000", sizes=(1024, 2048, 1000)) == [
        ("sky.hdr", [], [("./sky_1000", 1000)])
    ]


@pytest.mark.parametrize("sizes", [(0,), (3,), (1024, -2)])
def test_sizes_that_no_map_has_are_refused(sizes):
    with pytest.raises(BadSetting, match="even numbers"):
        LibraryOptions(sizes=sizes)


paths = st.lists(
    st.tuples(
        st.sampled_from(["", "a/", "4k/", "a/b/"]),
        st.sampled_from(["sky", "Sky", "sky_1k", "sky_4k", "sky (2)", "sky_4k.exr"]),
        st.sampled_from([".exr", ".hdr", ".EXR"]),
        st.sampled_from([0, 512, 1024, 4096]),
    ),
    unique_by=lambda entry: entry[:3],
)


@given(paths, st.sampled_from([(), "all", (512,), (512, 1024)]))
def test_every_file_is_in_one_map_and_every_output_has_a_name_of_its_own(entries, sizes):
    names = [f"{folder}{stem}{end}@{width}" for folder, stem, end, width in entries]
    maps = plan(files(*names), LibraryOptions(sizes=sizes))
    covered = [file.path for each in maps for file in (each.file, *each.others)]
    assert sorted(covered) == sorted(name.partition("@")[0] for name in names)
    outputs = [(o.folder, o.stem.casefold()) for each in maps for o in each.outputs]
    assert len(set(outputs)) == len(outputs)
    assert all(each.outputs for each in maps)
