from __future__ import annotations

import json
import os
import pty
import select
import shutil
import signal
import subprocess
import termios
import time

import pytest

from sunsplit.core import cli
from sunsplit.core.library.state import SETTLED
from tests.files import COMMAND, noise, radiance_head, sunny, sunsplit, write_exr
from tests.libraries import documents, write_maps

COUNT = 4


@pytest.fixture
def library(tmp_path):
    folder = tmp_path / "library"
    folder.mkdir()
    write_maps(folder, COUNT)
    return folder


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def run(*arguments):
    return cli.main(["library", *map(os.fspath, arguments), "--workers", "1"])


def lines(capfd):
    return [json.loads(line) for line in capfd.readouterr().out.splitlines()]


def test_each_map_is_a_line_and_the_whole_is_one(library, out, capfd):
    assert run(library, "-o", out) == 0
    said, complaints = capfd.readouterr()
    assert complaints == ""
    each = said.splitlines()[:COUNT]
    assert [line.split(" ")[0] for line in each] == [f"{n}/{COUNT}" for n in range(1, COUNT + 1)]
    assert f"{COUNT} maps: {COUNT} converted, in" in said
    assert len(documents(out)) == COUNT
    assert run(library, "-o", out) == 0
    assert f"{COUNT} maps: 0 converted, {COUNT} had been converted before" in capfd.readouterr().out


def test_options_of_convert_reach_each_map(library, out):
    assert (
        run(library, "-o", out, "--shape", "point", "--fill", "black", "--residual-width", "32")
        == 0
    )
    for document in documents(out).values():
        assert {sun["angular_diameter"] for sun in document["suns"]} == {0.0}
        assert document["settings"]["fill"] == "black"
        assert document["residual"]["width"] == 32


def test_a_failure_is_a_line_on_stderr_and_the_exit_status(library, out, capfd):
    (library / "bad.hdr").write_bytes(b"#?RADIANCE\n\nnonsense")
    assert run(library, "-o", out) == 1
    said, complaints = capfd.readouterr()
    assert complaints == (
        "sunsplit: bad.hdr: bad.hdr is truncated or damaged: its Radiance header has no size.\n"
    )
    assert f"{COUNT + 1} maps: {COUNT} converted, 1 failed" in said


def test_names_of_any_kind_are_lines(library, out):
    """In a process of its own: pytest's cannot hand on what is no text."""
    shutil.copy(library / "map 0000.hdr", library / "two\nlines.hdr")
    shutil.copy(library / "map 0000.hdr", os.fsencode(library) + b"/no\xfftext.hdr")
    done = sunsplit("library", library, "-o", out, "--preview", "--workers", "1")
    assert done.returncode == 1
    assert "two?lines.hdr: 10 suns with" in done.stdout
    assert done.stderr == (
        "sunsplit: no\\udcfftext.hdr: no\\udcfftext.hdr has a name that is not Unicode: rename it."
        "\n"
    )
    assert "no\\udcfftext" in (out / "report.html").read_text()
    done = sunsplit("library", library, "-o", out, "--preview", "--workers", "1", "--json")
    assert len(done.stdout.splitlines()) == COUNT + 3


def test_json_lines_for_machines(library, out, capfd):
    (library / "bad.hdr").write_bytes(b"")
    assert run(library, "-o", out, "--json") == 1
    *maps, end = lines(capfd)
    assert {entry["event"] for entry in maps} == {"map"}
    by_source = {entry["source"]: entry for entry in maps}
    assert len(by_source) == COUNT + 1
    assert by_source["bad.hdr"]["status"] == "failed"
    assert "is empty" in by_source["bad.hdr"]["sentence"]
    done = by_source["map 0000.hdr"]
    assert done["status"] == "done"
    assert done["files"] == ["map 0000.lights.json", "map 0000.residual.exr"]
    assert done["of"] == COUNT + 1
    assert "thumbnail" not in done
    counts = {name: end[name] for name in ("event", "maps", "converted", "known", "failed")}
    assert counts == {
        "event": "end",
        "maps": COUNT + 1,
        "converted": COUNT,
        "known": 0,
        "failed": 1,
    }


def test_a_dry_run_says_what_would_be_done_and_writes_nothing(library, out, capfd):
    assert run(library, "-o", out, "--dry-run") == 0
    said = capfd.readouterr().out.splitlines()
    assert said[0] == "map 0000.hdr, 64 x 32: to do: map 0000"
    assert said[-1] == f"{COUNT} maps, 0 of them already converted"
    assert not out.exists()
    time.sleep(SETTLED)  # a map that has just been written is looked at again
    assert run(library, "-o", out, "--exclude", "noon/*") == 0
    capfd.readouterr()
    assert run(library, "-o", out, "--dry-run", "--json") == 0
    assert {entry["source"]: entry["known"] for entry in lines(capfd)} == {
        "map 0000.hdr": True,
        "map 0003.exr": True,
        "noon/late/map 0002.hdr": False,
        "noon/map 0001.exr": False,
    }


def test_sizes_that_are_asked_for(tmp_path, out):
    library = tmp_path / "sizes"
    library.mkdir()
    write_exr(library / "sky_512.exr", sunny(512) + noise(256))
    write_exr(library / "sky_128.exr", sunny(128))
    assert run(library, "-o", out, "--sizes", "all") == 0
    assert sorted(documents(out)) == ["sky_128", "sky_512"]
    assert run(library, "-o", out / "b", "--sizes", "256,128", "--largest", "512") == 0
    assert sorted(documents(out / "b")) == ["sky_128", "sky_256"]


@pytest.mark.parametrize(
    "wrong",
    [
        ("--sizes", "huge"),
        ("--sizes", "1k,"),
        ("--largest", "0"),
        ("--workers", "0"),
        ("--memory", "much"),
        ("--memory", "1M"),
        (),
    ],
)
def test_wrong_usage_is_said_and_writes_nothing(library, out, capfd, wrong):
    output = ("-o", os.fspath(out)) if wrong else ()
    assert cli.main(["library", os.fspath(library), *output, *wrong]) == 2
    assert capfd.readouterr().err
    assert not out.exists()


def test_no_library_is_a_sentence(tmp_path, out, capfd):
    assert run(tmp_path / "none", "-o", out) == 1
    assert capfd.readouterr().err.endswith("give the folder that holds the maps.\n")
    assert not out.exists()


def test_ctrl_c_says_how_to_go_on(tmp_path, out):
    library = tmp_path / "many"
    library.mkdir()
    write_maps(library, 60)
    process = subprocess.Popen(
        [*COMMAND, "library", os.fspath(library), "-o", os.fspath(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout.readline().startswith("1/60")
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: all of them get it
    _, complaints = process.communicate(timeout=60)
    assert process.returncode == cli.CANCELLED
    assert complaints.startswith("sunsplit: cancelled, ")
    assert complaints.endswith(" maps are done; run the same again to go on.\n")
    assert complaints.count("\n") == 1
    done = sunsplit("library", library, "-o", out, "--json")
    assert done.returncode == 0
    end = json.loads(done.stdout.splitlines()[-1])
    assert end["known"] > 0
    assert end["known"] + end["converted"] == 60


def test_a_terminal_gets_a_bar_with_time_left_and_throughput(tmp_path, out):
    library = tmp_path / "many"
    library.mkdir()
    write_maps(library, 30)
    # Large by its header, and so begun first.
    (library / "bad.hdr").write_bytes(radiance_head("-Y 512 +X 1024") + bytes(2048))
    master, slave = pty.openpty()
    termios.tcsetwinsize(slave, (24, 100))
    process = subprocess.Popen(
        [*COMMAND, "library", os.fspath(library), "-o", os.fspath(out)],
        stdout=subprocess.PIPE,
        stderr=slave,
        text=True,
    )
    os.close(slave)
    painted = _all_of(master)
    said = process.communicate(timeout=60)[0]
    assert process.returncode == 1
    assert "31 maps: 30 converted, 1 failed" in said
    assert "of 31 maps, 1 failed" in painted
    assert "maps/min" in painted
    assert " left" in painted
    assert "sunsplit: bad.hdr: " in painted


def _all_of(terminal):
    """What was written to it until its last writer has left."""
    end, text = time.monotonic() + 120, b""
    while time.monotonic() < end:
        if not select.select([terminal], [], [], 1)[0]:
            continue
        try:
            more = os.read(terminal, 1 << 16)
        except OSError:  # how Linux says it
            break
        text += more
    os.close(terminal)
    return text.decode(errors="replace")
