"""Libraries on a Dask cluster: real schedulers and workers, and what may happen to them."""

from __future__ import annotations

import gc
import json
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from sunsplit.core.errors import ClusterFailed
from sunsplit.core.files.journal import HIDDEN
from sunsplit.core.library import cluster as under_test
from sunsplit.core.library.cluster import DEATHS, ClusterWorkers
from sunsplit.core.library.events import Settled
from sunsplit.core.library.link import Link
from sunsplit.core.library.local import Task
from sunsplit.core.library.options import LibraryOptions
from sunsplit.core.library.planned import plan_library
from sunsplit.core.library.run import LibraryResult, convert_library
from sunsplit.core.settings import ConversionSettings
from tests.dask_cluster import Cluster, Process, wait
from tests.files import COMMAND, noise, sunny, sunsplit, write_hdr
from tests.libraries import REPORT, contents, write_maps

distributed = pytest.importorskip("distributed")

QUICK = LibraryOptions(settings=ConversionSettings(method="median-cut", lights=8, share=0.3))

MOUNTS = os.name == "posix" and not subprocess.call(
    ["unshare", "--mount", "true"], stderr=subprocess.DEVNULL
)

ARGUMENTS = ("--method", "median-cut", "--lights", "8", "--share", "0.3")

COUNT = 18


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library."""
    folder = tmp_path_factory.mktemp("library")
    write_maps(folder, COUNT)
    return folder


@pytest.fixture(scope="module")
def local(maps: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What this machine makes of it."""
    output = tmp_path_factory.mktemp("local")
    assert convert_library(maps, output, QUICK, workers=2).is_well
    return conversions(output)


def some(last: str) -> LibraryOptions:
    """Only the maps whose numbers end like this."""
    return replace(QUICK, include=(f"*{last}.hdr", f"*{last}.exr"))


def check(output: Path, local: dict[str, bytes], last: str = "") -> None:
    """The cluster's files are those of this machine, byte for byte, and nothing else is there."""
    expected = {name: data for name, data in local.items() if name.split(".")[0].endswith(last)}
    assert expected
    assert conversions(output) == expected
    assert not drafts(output)


def conversions(folder: Path) -> dict[str, bytes]:
    """All that was written but the report, which names what was left out of a run, too."""
    return {name: data for name, data in contents(folder).items() if name not in REPORT}


def drafts(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path.parent.name == HIDDEN and path.is_dir()}


class Run:
    """A run in a thread, with what it has told."""

    def __init__(self, maps: Path, output: Path, scheduler: str, options: LibraryOptions) -> None:
        self.settled: list[Settled] = []
        self.notices: list[str] = []
        self.result: LibraryResult | None = None
        self.error: Exception | None = None
        self._arguments = maps, output, options
        self._scheduler = scheduler
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.result = convert_library(
                *self._arguments,
                scheduler=self._scheduler,
                listen=self.settled.append,
                notice=self.notices.append,
            )
        except Exception as error:
            self.error = error

    def ended(self) -> LibraryResult:
        self._thread.join(60)
        assert not self._thread.is_alive()
        if self.error:
            raise self.error
        assert self.result is not None
        # Nothing is lost, and nothing is told twice.
        sources = [event.row.source for event in self.settled]
        assert sorted(sources) == sorted(row.source for row in self.result.rows)
        assert len(set(sources)) == len(sources)
        return self.result


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    logs = tmp_path / "cluster"
    logs.mkdir()
    with Cluster(logs) as made:
        yield made


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with Cluster(tmp_path_factory.mktemp("cluster")) as made:
        made.scheduler()
        yield made


@pytest.fixture
def team(shared: Cluster) -> Iterator[Cluster]:
    """A scheduler that runs, without workers so far."""
    yield shared
    shared.dismiss_workers()


@pytest.fixture(autouse=True)
def _short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    patience = replace(under_test.PATIENCE, other_worker=1.0, notice=0.5)
    monkeypatch.setattr(under_test, "PATIENCE", patience)


@contextmanager
def impatient(**seconds: float) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(under_test, "PATIENCE", replace(under_test.PATIENCE, **seconds))
        yield


def kill_while_it_writes(worker: Process, output: Path) -> None:
    """With drafts on disk, which stay."""
    older = drafts(output)
    while True:
        wait(lambda: drafts(output) - older, pause=0.0005)
        worker.stop()
        if drafts(output) - older:
            worker.kill()
            return
        worker.go_on()


def test_many_small_maps_with_a_worker_killed(team, tmp_path):
    many, output = tmp_path / "maps", tmp_path / "out"
    write_maps(many, 200, 32)
    team.worker(threads=2)
    nanny = team.worker(nanny=True)
    run = Run(many, output, team.address, QUICK)
    wait(lambda: len(run.settled) > 20)
    nanny.child().kill()
    result = run.ended()
    assert result.is_well
    assert (len(result.rows), result.known) == (200, 0)
    assert [event.number for event in run.settled] == list(range(1, 201))
    assert not drafts(output)
    again = convert_library(many, output, QUICK, scheduler=team.address)
    assert again.known == 200
    assert convert_library(many, tmp_path / "local", some("17"), workers=2).is_well
    of_this_machine = conversions(tmp_path / "local")
    assert len(of_this_machine) == 4
    assert of_this_machine.items() <= contents(output).items()


def test_worker_killed_while_it_writes(team, tmp_path, maps, local):
    output = tmp_path / "out"
    first = team.worker()
    run = Run(maps, output, team.address, QUICK)
    wait(lambda: run.settled)
    kill_while_it_writes(first, output)
    assert drafts(output)
    wait(lambda: run.notices)
    assert "has no workers: waiting for some" in run.notices[0]
    team.worker()
    result = run.ended()
    assert result.is_well
    assert result.known == 0
    check(output, local)


def test_map_over_which_workers_die(team, tmp_path, maps, local):
    output = tmp_path / "out"
    run = Run(maps, output, team.address, some("07"))
    for _ in range(DEATHS):
        kill_while_it_writes(team.worker(), output)
    (row,) = run.ended().failed
    assert row.sentence.startswith("3 workers have died over it, tcp://127.0.0.1:")
    assert not drafts(output)
    assert not conversions(output)
    team.worker()
    assert convert_library(maps, output, some("07"), scheduler=team.address).is_well
    check(output, local, "07")


def test_scheduler_killed_and_restarted(cluster, tmp_path, maps, local):
    output = tmp_path / "out"
    scheduler = cluster.scheduler()
    cluster.worker()
    run = Run(maps, output, cluster.address, QUICK)
    wait(lambda: len(run.settled) >= 3)
    scheduler.kill()
    wait(lambda: run.notices)
    assert f"The scheduler at {cluster.address} is lost" in run.notices[0]
    assert len(run.settled) < COUNT
    cluster.scheduler()
    cluster.worker()
    result = run.ended()
    assert result.is_well
    assert result.known == 0
    check(output, local)


def test_scheduler_that_does_not_come_back(cluster, tmp_path, maps, local):
    output = tmp_path / "out"
    scheduler = cluster.scheduler()
    cluster.worker()
    with impatient(back=1.0):
        run = Run(maps, output, cluster.address, QUICK)
        wait(lambda: len(run.settled) >= 3)
        scheduler.kill()
        with pytest.raises(
            ClusterFailed, match=r"did not come back within 1 s: run the same again"
        ):
            run.ended()
    assert len(run.settled) < COUNT
    wait(lambda: not drafts(output))  # a worker may be at a map still
    again = convert_library(maps, output, QUICK, workers=1)
    assert again.is_well
    assert again.known >= len(run.settled)
    check(output, local)


SHARED = "that is to be shared under this path"

BLIND = {
    "nothing": ("mount -t tmpfs none {maps}", f"does not see the folder {{maps}} {SHARED}", 2),
    "other": ("mount -t tmpfs none {out}", f"does not see the folder {{out}} {SHARED}", 2),
    "less": ("mount -t tmpfs none {maps}/noon", f"does not see {{maps}}/noon/m.hdr {SHARED}", 1),
    "read only": ("mount --bind -o ro {out} {out}", "cannot write (Cannot write into {out}", 2),
    "elsewhere": ("mount -t tmpfs none {out}/noon", "has written into another {out} than this", 1),
}
"""What a worker does not see of a library of two maps, what is said of that, and how many of the
maps it cannot do."""


@pytest.mark.skipif(not MOUNTS, reason="a process cannot have mounts of its own here")
def test_workers_that_do_not_share_the_folders(team, tmp_path, monkeypatch):
    patient = replace(under_test.PATIENCE, files=0.3, other_worker=0.3)
    monkeypatch.setattr(under_test, "PATIENCE", patient)
    mounts, places = [], {}
    for name, (mount, sentence, _) in BLIND.items():
        folders = {"maps": tmp_path / name.replace(" ", "") / "maps"}
        folders["out"] = folders["maps"].with_name("out")
        for folder in folders.values():
            (folder / "noon").mkdir(parents=True)
        write_hdr(folders["maps"] / "n.hdr", noise(16))
        write_hdr(folders["maps"] / "noon" / "m.hdr", sunny(32))
        mounts.append(mount.format(**folders))
        places[name] = folders, sentence.format(**folders)
    blind = team.worker(before=mounts)
    for name, (folders, sentence) in places.items():
        result = convert_library(*folders.values(), QUICK, scheduler=team.address)
        assert len(result.failed) == BLIND[name][2], name
        for row in result.failed:
            assert row.sentence.startswith("No worker can do it: tcp://127.0.0.1:")
            assert sentence in row.sentence
    assert not list(blind.sees(places["other"][0]["out"]).iterdir())
    team.worker()
    for name, (folders, sentence) in places.items():
        run = Run(*folders.values(), team.address, QUICK)
        assert run.ended().is_well
        assert any(sentence in notice for notice in run.notices) == (name in ("nothing", "other"))
        assert not drafts(folders["out"])
        assert conversions(folders["out"]) == conversions(places["nothing"][0]["out"])


def test_workers_with_another_sunsplit(team, tmp_path, maps, local):
    output = tmp_path / "out"
    none = tmp_path / "none"
    none.mkdir()
    (none / "sunsplit.py").touch()  # no package, and so nothing in it
    team.worker(PYTHONPATH=str(other_version(tmp_path / "other", "0.0.9")))
    with pytest.raises(ClusterFailed, match=r"has Sunsplit 0\.0\.9, and .* was asked for: install"):
        convert_library(maps, output, QUICK, scheduler=team.address)
    team.worker(PYTHONPATH=str(none))
    with pytest.raises(ClusterFailed, match=r"\(1 more cannot either\)\.$"):
        convert_library(maps, output, QUICK, scheduler=team.address)
    team.worker()
    run = Run(maps, output, team.address, some("2"))
    assert run.ended().is_well
    assert len(run.notices) <= 2
    assert any("cannot use Sunsplit (ModuleNotFoundError" in notice for notice in run.notices)
    check(output, local, "2")


def other_version(folder: Path, version: str) -> Path:
    """A folder to import this Sunsplit from, which says it is another one."""
    root = Path(under_test.__file__).resolve().parents[2]
    package = folder / "sunsplit"
    package.mkdir(parents=True)
    (package / "core").symlink_to(root / "core")
    shutil.copy(root / "__init__.py", package)
    (package / "blender_manifest.toml").write_text(f'version = "{version}"\n')
    return folder


def test_no_scheduler_and_no_workers(cluster, tmp_path, maps):
    output = tmp_path / "out"
    with impatient(scheduler=0.5), pytest.raises(ClusterFailed, match="No Dask scheduler answers"):
        convert_library(maps, output, QUICK, scheduler=cluster.address)
    with pytest.raises(ClusterFailed, match="is no scheduler's address"):
        convert_library(maps, output, QUICK, scheduler="nonsense://here")
    cluster.scheduler()
    with impatient(workers=1.0):
        run = Run(maps, output, cluster.address, QUICK)
        with pytest.raises(ClusterFailed, match="has had no workers for 1 s"):
            run.ended()
    assert len(run.notices) == 1
    assert "has no workers: waiting for some" in run.notices[0]


def test_no_garbage_is_collected_while_a_connection_begins(team, monkeypatch):
    collects = []

    class Watched(distributed.Client):
        def start(self, **options):
            collects.append(gc.isenabled())
            return super().start(**options)

    monkeypatch.setattr(distributed, "Client", Watched)
    link = Link(team.address)
    link.open()
    assert link.connect()
    link.close()
    assert collects == [False]
    assert gc.isenabled()


def test_command_line_and_a_bug_on_a_worker(team, tmp_path, maps, local):
    output = tmp_path / "out"
    at = ("--scheduler", team.address, "--include", "*1.hdr", "--include", "*1.exr")
    team.worker(threads=2)
    done = sunsplit("library", maps, "-o", output, *at, *ARGUMENTS, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert [event["event"] for event in events] == ["map"] * 2 + ["end"]
    check(output, local, "1")
    good = plan_library(maps, output, some("2")).maps[0].job.to_json()
    bad = good | {"path": "no\0name.hdr"}  # which the plan would never make
    with ClusterWorkers(team.address, output, print) as workers:
        done = [done for done in workers.run([Task(bad, 0), Task(good, 0)]) if done]
    raised = next(each for each in done if each.answer is None)
    assert raised.task.job == bad
    assert raised.sentence.startswith("It raised ValueError: ")
    assert len(done) == 2


def test_interrupt(team, tmp_path, maps, local):
    output = tmp_path / "out"
    team.worker()
    command = [*COMMAND, "library", maps, "-o", output, "--scheduler", team.address, *ARGUMENTS]
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True) as run:
        assert f"1/{COUNT} " in run.stdout.readline()
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=30)
    assert run.returncode == 130
    assert said.startswith("sunsplit: cancelled, ")
    assert said.endswith("maps are done; run the same again to go on.\n")
    assert said.count("\n") == 1
    wait(lambda: not drafts(output))  # what was begun comes to its end
    lights = {name for name in contents(output) if name.endswith(".lights.json")}
    assert len(lights) < COUNT
    again = convert_library(maps, output, QUICK, scheduler=team.address)
    assert again.is_well
    assert again.known >= len(lights) - 1
    check(output, local)


def test_without_dask(tmp_path, maps):
    (tmp_path / "distributed.py").write_text("raise ModuleNotFoundError('no distributed')")
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"PYTHONPATH": path}
    at = ("--scheduler", "tcp://127.0.0.1:1")
    done = sunsplit("library", maps, "-o", tmp_path / "out", *at, env=environment)
    assert done.returncode == 1
    assert done.stderr == (
        'sunsplit: A cluster needs Dask, which is not installed: pip install "sunsplit[cluster]".\n'
    )


def test_limits_of_this_machine_are_refused(tmp_path, maps):
    at = ("--scheduler", "tcp://127.0.0.1:1")
    for more in (("--workers", "2"), ("--memory", "2G")):
        wrong = sunsplit("library", maps, "-o", tmp_path / "out", *at, *more)
        assert wrong.returncode == 2
        assert wrong.stderr.startswith("sunsplit: --workers and --memory are for work on this")
        assert wrong.stderr.count("\n") == 1
