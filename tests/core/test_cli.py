from __future__ import annotations

import json
import os
import pty
import resource
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sunsplit.core import cli, interrupts, progress
from sunsplit.core.files.conversion import account_of_files
from sunsplit.core.tolerances import ACCOUNT_HALF
from tests.files import COMMAND, noise, sunny, sunsplit, write_exr, write_hdr

RESULT = ["map.lights.json", "map.preview.png", "map.residual.exr"]


@pytest.fixture
def sky_file(tmp_path):
    return write_exr(tmp_path / "map.exr", sunny())


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def run(*arguments):
    return cli.main([os.fspath(argument) for argument in arguments])


def names(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


# What it does


def test_convert_writes_and_says_what(sky_file, out, capfd):
    assert run("convert", sky_file, "-o", out, "--preview") == 0
    assert names(out) == RESULT
    said, complaints = capfd.readouterr()
    assert "map.exr: 128 x 64" in said
    assert "1 sun with" in said
    for name in RESULT:
        assert f"wrote {out / name}" in said
    assert complaints == ""


def test_a_narrower_residual_is_written_and_adds_up(sky_file, out, capfd):
    assert run("convert", sky_file, "-o", out, "--residual-width", "32", "--json") == 0
    written = json.loads(capfd.readouterr().out)
    assert (written["residual"]["width"], written["residual"]["height"]) == (32, 16)
    assert account_of_files(out / "map.lights.json").relative_error.max() <= ACCOUNT_HALF
    assert run("convert", sky_file, "-o", out, "--residual-width", "50") == 1
    assert "whole part" in capfd.readouterr().err


def test_convert_writes_here_unless_told_otherwise(sky_file, tmp_path, out, monkeypatch):
    out.mkdir()
    monkeypatch.chdir(out)
    assert run("convert", Path("..") / "out" / ".." / "map.exr") == 0
    assert names(out) == ["map.lights.json", "map.residual.exr"]


def test_what_an_older_conversion_had_is_said_to_go(sky_file, out, capfd):
    assert run("convert", sky_file, "-o", out, "--preview") == 0
    assert "removed" not in capfd.readouterr().out
    assert run("convert", sky_file, "-o", out, "--residual", "none") == 0
    lines = capfd.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("removed")] == [
        f"removed {out / name}, which was of an older conversion"
        for name in ("map.residual.exr", "map.preview.png")
    ]
    assert names(out) == ["map.lights.json"]


def test_json_is_one_object_and_nothing_else(sky_file, out, capfd):
    assert run("convert", sky_file, "-o", out, "--json", "--preview") == 0
    said, complaints = capfd.readouterr()
    answer = json.loads(said, parse_constant=pytest.fail)
    assert said.count("\n") == 1
    assert complaints == ""
    assert answer["files"] == {
        "lights": str(out / "map.lights.json"),
        "residual": str(out / "map.residual.exr"),
        "samples": None,
        "preview": str(out / "map.preview.png"),
    }
    written = json.loads((out / "map.lights.json").read_text())
    assert {key: answer[key] for key in answer if key != "files"} == {
        key: written[key] for key in written if key not in ("format", "version", "axes")
    }
    assert answer["settings"] | {"threshold": 0, "share": 0} == {
        "target": "cycles",
        "lights": 1,
        "tolerance": 1.0,
        "share": 0,
        "strata": 2,
        "method": "edge",
        "samples": None,
        "per_stratum": False,
        "shape": "disc",
        "position": "centroid",
        "frequency": "energy",
        "residual": "map",
        "residual_width": None,
        "residual_samples": 500,
        "fill": "surroundings",
        "mirrors": True,
        "threshold": 0,
    }


def test_info_writes_nothing(sky_file, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("info", sky_file) == 0
    assert "brightest pixel" in capfd.readouterr().out
    assert run("info", sky_file, "--json") == 0
    answer = json.loads(capfd.readouterr().out, parse_constant=pytest.fail)
    assert answer["residual"] is None
    assert len(answer["suns"]) == 1
    assert names(tmp_path) == ["map.exr"]


def test_share_one_leaves_no_residual(sky_file, out, capfd):
    assert run("convert", sky_file, "-o", out, "--share", "1", "--lights", "4", "--json") == 0
    answer = json.loads(capfd.readouterr().out)
    assert names(out) == ["map.lights.json"]
    assert answer["residual"] is None
    assert answer["files"]["residual"] is None
    assert answer["account"]["residual"] == [0, 0, 0]
    assert answer["settings"]["residual"] == "none"


def test_residual_none_says_what_is_left_out(sky_file, out, capfd):
    assert run("convert", sky_file, "-o", out, "--residual", "none") == 0
    assert names(out) == ["map.lights.json"]
    assert "no residual map" in capfd.readouterr().out


def test_settings_arrive(sky_file, out, capfd):
    options = ["--lights", "3", "--share", "0.5", "--strata", "4"]
    assert run("convert", sky_file, "-o", out, "--json", *options) == 0
    answer = json.loads(capfd.readouterr().out)
    assert (answer["settings"]["lights"], answer["settings"]["strata"]) == (3, 4)
    assert 1 <= len(answer["suns"]) <= 3
    assert run("convert", sky_file, "-o", out, "--share", "auto") == 0


def test_the_papers_settings_arrive(sky_file, out, capfd):
    options = {
        "method": "penrose",
        "samples": 40,
        "shape": "point",
        "position": "sample",
        "frequency": "mean",
        "residual": "voronoi",
        "residual_samples": 30,
        "residual_width": 32,
        "fill": "surroundings",
        "share": 0.5,
    }
    words = [
        word
        for key, value in options.items()
        for word in (f"--{key.replace('_', '-')}", f"{value}")
    ]
    assert run("convert", sky_file, "-o", out, "--json", "--per-stratum", *words) == 0
    answer = json.loads(capfd.readouterr().out)
    assert names(out) == ["map.lights.json", "map.residual.exr", "map.samples.json"]
    assert answer["files"]["samples"] == str(out / "map.samples.json")
    settings = answer["settings"] | {"share": 0.5}
    assert settings | options | {"per_stratum": True} == settings
    assert answer["residual"]["kind"] == "voronoi"
    assert answer["residual"]["samples"] == "map.samples.json"
    assert all(sun["angular_diameter"] == 0 for sun in answer["suns"])


@pytest.mark.parametrize("option", [("--samples", "999999"), ("--residual-width", "1")])
def test_a_number_outside_its_limits_is_wrong_usage(sky_file, out, capfd, option):
    assert run("convert", sky_file, "-o", out, *option) == 2
    said, complaints = capfd.readouterr()
    assert said == ""
    assert complaints.count("\n") == 1
    assert "must be" in complaints
    assert names(out) == []


def test_repairs_and_warnings_are_said(tmp_path, out, capfd):
    pixels = sunny()
    pixels[3, 4] = np.nan
    pixels[5, 6, 0] = -1
    pixels[7, 8] = np.inf
    wide = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    path = write_exr(tmp_path / "map.exr", pixels, chromaticities=wide)
    assert run("convert", path, "-o", out) == 0
    said = capfd.readouterr().out
    assert "repaired pixels: 1 NaN, 1 infinite, 1 negative" in said
    assert "warning: The file states primaries" in said


@pytest.mark.parametrize(
    "name", ["a.b.hdr", "with space.hdr", "ü 空.x.hdr", "..hdr", "map\udcff.exr"]
)
def test_any_file_name(tmp_path, out, name, capfd):
    write = write_exr if name.endswith("exr") else write_hdr
    path = write(tmp_path / "plain", sunny()).rename(tmp_path / name)
    assert run("convert", path, "-o", out / name, "--preview") == 0
    assert names(out / name) == [
        f"{path.stem}.{kind}" for kind in ("lights.json", "preview.png", "residual.exr")
    ]
    assert run("convert", path, "-o", out / name, "--json") == 0
    assert capfd.readouterr().err == ""
    files = out / name / f"{path.stem}.lights.json"
    assert account_of_files(files).relative_error.max() < ACCOUNT_HALF


# What it refuses


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["melt"],
        ["convert"],
        ["convert", "map.exr", "--lights", "0"],
        ["convert", "map.exr", "--lights", "many"],
        ["convert", "map.exr", "--share", "-0.1"],
        ["convert", "map.exr", "--method", "magic"],
        ["convert", "map.exr", "--samples", "0"],
        ["convert", "map.exr", "--share", "1.1"],
        ["convert", "map.exr", "--share", "nan"],
        ["convert", "map.exr", "--strata", "3"],
        ["convert", "map.exr", "--residual", "half"],
        ["info", "map.exr", "--preview"],
    ],
)
def test_wrong_usage_is_status_two(arguments, capfd):
    assert cli.main(arguments) == 2
    said, complaints = capfd.readouterr()
    assert said == ""
    assert complaints.startswith("usage: sunsplit")
    assert "Traceback" not in complaints


def write_picture(path):
    Image.fromarray(np.full((16, 32, 3), 90, np.uint8)).save(path)


def unusable(folder):
    """Files of every kind that cannot be used, and a word of what is said about each."""
    whole = write_exr(folder / "whole.exr", noise(64)).read_bytes()
    (folder / "half.exr").write_bytes(whole[: len(whole) // 2])
    (folder / "head.exr").write_bytes(whole[:340])
    (folder / "text.hdr").write_text("no picture")
    (folder / "empty.exr").touch()
    write_exr(folder / "depth.exr", {"Z": noise()[..., 0].copy()})
    write_exr(folder / "square.exr", np.ones((16, 16, 3), np.float32))
    write_exr(folder / "black.exr", np.zeros((16, 32, 3), np.float32))
    whole = write_hdr(folder / "whole.hdr", noise(64)).read_bytes()
    (folder / "half.hdr").write_bytes(whole[: len(whole) // 2])
    write_picture(folder / "picture.png")
    return {
        "half.exr": "truncated or damaged",
        "head.exr": "truncated or damaged",
        "text.hdr": "not an image",
        "empty.exr": "is empty",
        "depth.exr": "it has: Z",
        "square.exr": "angular map",
        "black.exr": "no light",
        "half.hdr": "truncated or damaged",
        "picture.png": "--allow-ldr",
        "missing.exr": "does not exist",
        "": "is a folder",
    }


def test_unusable_input_is_one_line_and_status_one(tmp_path, out, capfd):
    for name, word in unusable(tmp_path).items():
        for verb in (["convert", "-o", out, "--json", "--preview"], ["info"]):
            assert run(*verb, tmp_path / name) == 1, name
            said, complaints = capfd.readouterr()
            assert said == "", name
            assert complaints.startswith("sunsplit: "), name
            assert word in complaints
            assert complaints.count("\n") == 1, complaints
    assert not out.exists()


@pytest.mark.parametrize("name", ["half.exr", "half.hdr", "text.hdr"])
def test_nothing_is_added_when_the_process_ends(tmp_path, name):
    unusable(tmp_path)
    ended = sunsplit("convert", tmp_path / name, "-o", tmp_path / "out", "--json")
    assert ended.returncode == 1
    assert ended.stdout == ""
    assert ended.stderr.count("\n") == 1
    assert ended.stderr.startswith("sunsplit: ")


def test_ldr_is_taken_when_allowed(tmp_path, out):
    write_picture(tmp_path / "map.png")
    assert run("convert", tmp_path / "map.png", "-o", out, "--allow-ldr") == 0
    assert names(out) == ["map.lights.json", "map.residual.exr"]


def test_an_output_that_is_a_file_is_one_line(sky_file, tmp_path, capfd):
    (tmp_path / "file").write_text("mine")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", "/proc/self/fdinfo"):
        assert run("convert", sky_file, "-o", folder) == 1
        said, complaints = capfd.readouterr()
        assert said == ""
        assert complaints.startswith("sunsplit: Cannot write into ")
        assert complaints.count("\n") == 1
    assert (tmp_path / "file").read_text() == "mine"


def limit_files(size):
    """Let a process write no file beyond this size, as on a full disk."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    return limit


@pytest.mark.parametrize("size", [0, 500, 5000])
def test_a_full_disk_is_one_line_and_the_older_files_stay(tmp_path, out, size):
    path = write_exr(tmp_path / "map.exr", sunny() + noise(64))
    out.mkdir()
    for name in RESULT:
        (out / name).write_text("old")
    # Python sets SIGXFSZ aside by itself, but only after preexec_fn.
    ended = sunsplit("convert", path, "-o", out, "--preview", preexec_fn=limit_files(size))
    assert ended.returncode == 1
    assert ended.stdout == ""
    assert (
        ended.stderr == f"sunsplit: Cannot write into {out}: File too large. Nothing was changed.\n"
    )
    assert {name: (out / name).read_text() for name in names(out)} == dict.fromkeys(RESULT, "old")


def test_too_little_memory_is_one_line(tmp_path):
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 32768\n"
    path = tmp_path / "map.hdr"
    path.write_bytes(head + bytes([2, 2, 0, 0]) * 16384)

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))

    ended = sunsplit("info", path, preexec_fn=limit)
    assert ended.returncode == 1
    assert ended.stderr.count("\n") == 1


# How it ends

READY = (
    "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "from sunsplit.core.cli import main; print('ready', flush=True); sys.exit(main())"
)


def interrupted(path, out, seconds):
    """The command line, with a Ctrl-C so long after it has begun: (status, stderr)."""
    process = subprocess.Popen(
        [sys.executable, "-c", READY, "convert", path, "-o", out, "--preview"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "ready\n"
    time.sleep(seconds)
    process.send_signal(signal.SIGINT)
    complaints = process.communicate(timeout=60)[1]
    return process.returncode, complaints


def test_ctrl_c_leaves_all_or_nothing(tmp_path, out):
    path = write_exr(tmp_path / "map.exr", sunny(1024))
    out.mkdir()
    stopped = 0
    for seconds in (0, 0.07, 0.15, 0.3, 0.5, 0.7, 0.9):
        for name in RESULT:
            (out / name).write_text("old")
        status, complaints = interrupted(path, out, seconds)
        assert names(out) == RESULT
        is_old = [(out / name).read_bytes() == b"old" for name in RESULT]
        if status == 130 and "nothing" in complaints:
            assert complaints == "sunsplit: cancelled, nothing was written.\n"
            assert all(is_old)
            stopped += 1
        else:  # too late
            assert complaints in ("", "sunsplit: cancelled, the files are written.\n")
            assert not any(is_old)
    assert stopped >= 2


def test_a_reader_that_leaves_is_no_error(sky_file, out):
    for arguments in (["info", sky_file], ["convert", sky_file, "-o", out], ["--help"]):
        read, write = os.pipe()
        os.close(read)  # before anything is printed
        ended = subprocess.run(
            [*COMMAND, *arguments], stdout=write, stderr=subprocess.PIPE, timeout=60
        )
        os.close(write)
        assert (ended.returncode, ended.stderr) == (0, b"")
    assert len(names(out)) == 2


def test_a_closed_stdout_is_no_error(sky_file):
    ended = sunsplit("info", sky_file, preexec_fn=lambda: os.close(1))
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_full_stdout_is_one_line(sky_file):
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [*COMMAND, "info", sky_file], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60
        )
    assert ended.returncode == 1
    assert ended.stderr == "sunsplit: cannot print the result: No space left on device.\n"


def test_a_terminal_without_unicode(tmp_path):
    path = write_exr(tmp_path / "plain", sunny()).rename(tmp_path / "ü空.exr")
    ended = sunsplit("info", path, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "\\u7a7a" in ended.stdout


@pytest.mark.parametrize("arguments", [["--help"], ["convert", "--help"], ["--version"]])
def test_help_waits_for_no_library(arguments):
    code = (
        "import sys; from sunsplit.core.cli import main; status = main();"
        "heavy = {'numpy', 'scipy', 'skimage', 'OpenEXR', 'OpenImageIO', 'PIL', 'tqdm'};"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr); sys.exit(status)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stderr) == (0, "[]\n")
    assert "sunsplit" in ended.stdout


def test_help_names_every_option(capfd):
    assert cli.main(["convert", "--help"]) == 0
    said = capfd.readouterr().out
    for option in ("--output", "--lights", "--share", "--method", "--residual", "--preview"):
        assert option in said
    assert "--json" in said
    assert "--allow-ldr" in said


def test_version(capfd):
    assert cli.main(["--version"]) == 0
    project = (Path(cli.__file__).parent.parent / "pyproject.toml").read_text()
    word, version = capfd.readouterr().out.split()
    assert word == "sunsplit"
    assert f'version = "{version}"' in project


def test_a_dropped_interrupt_is_not_lost(capfd):
    class Dropping:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)  # Python ignores what is raised in here

    with interrupts.remembered():
        dropping = Dropping()
        del dropping
        with pytest.raises(KeyboardInterrupt), progress.terminal_progress() as report:
            report("reading", 0)
    assert capfd.readouterr() == ("", "")
    interrupts.check()  # forgotten once the work has ended


def test_an_interrupt_that_became_an_import_error_is_one():
    def half_imported():
        with interrupts.remembered():
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt as stop:
                raise ImportError("initialization failed") from stop

    with pytest.raises(KeyboardInterrupt):
        half_imported()


# Progress


def on_a_terminal(command):
    """What a process prints to stderr when that is a terminal: (status, text)."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    text = b""
    while select.select([ours], [], [], 60)[0]:
        try:
            text += os.read(ours, 4096)
        except OSError:  # how Linux reports that the other side has closed
            break
    os.close(ours)
    return process.wait(), text.decode()


SLOW = (
    "import time\nfrom sunsplit.core.progress import terminal_progress\n"
    "with terminal_progress(delay={delay}) as progress:\n"
    "    for step in range(4):\n"
    "        progress('resting', step / 4)\n"
    "        time.sleep(0.4)\n"
)


def test_a_bar_for_slow_work_on_a_terminal():
    status, text = on_a_terminal([sys.executable, "-c", SLOW.format(delay=0.2)])
    assert status == 0
    assert "resting" in text
    assert "75%" in text
    # It goes away: the line is overwritten with blanks.
    assert text.rpartition("\r")[0].rpartition("\r")[2].strip() == ""


def test_no_bar_for_quick_work_on_a_terminal():
    assert on_a_terminal([sys.executable, "-c", SLOW.format(delay=60)]) == (0, "")


def test_no_bar_on_a_pipe():
    code = SLOW.format(delay=0.2)
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, b"", b"")


def test_the_command_line_shows_its_progress(tmp_path):
    path = write_exr(tmp_path / "map.exr", sunny(1024))
    code = (
        "import sys; from sunsplit.core import cli, progress; shown = progress.terminal_progress;"
        "cli.terminal_progress = lambda: shown(delay=0.01); sys.exit(cli.main())"
    )
    command = [sys.executable, "-c", code, "convert", str(path), "-o", str(tmp_path / "out")]
    status, text = on_a_terminal(command)
    assert status == 0
    assert "reading" in text
    assert "%" in text


def test_a_program_without_stderr(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)  # as under pythonw
    with progress.terminal_progress() as report:
        report("resting", 0.5)
