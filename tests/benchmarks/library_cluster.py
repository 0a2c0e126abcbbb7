"""Many small maps on a Dask cluster of this machine, and by its own processes: maps a second.

    .venv-5.2/bin/python -m tests.benchmarks.library_cluster [-o FOLDER] [--count 1000]

In the last run a worker is killed after a third of the maps, and the scheduler after two thirds; a
new scheduler and new workers are started. All runs must write the same bytes.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from sunsplit.core.library.events import Settled
from sunsplit.core.library.options import LibraryOptions
from sunsplit.core.library.run import convert_library
from sunsplit.core.settings import ConversionSettings
from tests.dask_cluster import Cluster, Process
from tests.libraries import contents, write_maps

QUICK = LibraryOptions(settings=ConversionSettings(method="median-cut", lights=8, share=0.3))


@dataclass(frozen=True)
class Result:
    """seconds: from the first map that was settled to the last one."""

    what: str
    maps: int
    failed: int
    seconds: float
    megabytes: float

    @property
    def rate(self) -> float:
        """Maps a second."""
        return (self.maps - 1) / self.seconds


def run(
    what: str,
    maps: Path,
    output: Path,
    after: Callable[[int], None] = lambda number: None,
    **where: object,
) -> Result:
    """after: called with the number of maps that are settled."""
    times: list[float] = []
    began = psutil.Process().memory_info().rss

    def listen(event: Settled) -> None:
        times.append(time.perf_counter())
        after(event.number)

    result = convert_library(maps, output, QUICK, listen=listen, **where)
    if len({event.source for event in result.rows}) != len(times):
        raise AssertionError("a map was settled twice, or not at all")
    grown = (psutil.Process().memory_info().rss - began) / 1e6
    return Result(what, len(times), len(result.failed), times[-1] - times[0], grown)


class Kills:
    """What is killed, and what comes instead, when so many maps are settled."""

    def __init__(self, cluster: Cluster, scheduler: Process, worker: Process, count: int) -> None:
        self._cluster, self._scheduler, self._worker = cluster, scheduler, worker
        self._at = {count // 3: self._kill_worker, 2 * count // 3: self._kill_scheduler}

    def __call__(self, number: int) -> None:
        self._at.get(number, lambda: None)()

    def _kill_worker(self) -> None:
        self._worker.kill()

    def _kill_scheduler(self) -> None:
        self._scheduler.kill()
        self._cluster.scheduler()
        for _ in range(2):
            self._cluster.worker()


def runs(maps: Path, folder: Path, count: int) -> list[Result]:
    results = [
        run(f"this machine, {n} worker{'s' * (n > 1)}", maps, folder / f"local {n}", workers=n)
        for n in (1, 2)
    ]
    with Cluster(folder) as cluster:
        scheduler, where = cluster.scheduler(), {"scheduler": cluster.address}
        first = cluster.worker()
        results.append(run("cluster, 1 worker", maps, folder / "1", **where))
        cluster.worker()
        results.append(run("cluster, 2 workers", maps, folder / "2", **where))
        kills = Kills(cluster, scheduler, first, count)
        what = "cluster, 2 workers, a worker killed, then the scheduler"
        results.append(run(what, maps, folder / "killed", kills, **where))
    expected = contents(folder / "local 1")
    for name in ("local 2", "1", "2", "killed"):
        if contents(folder / name) != expected:
            raise AssertionError(f"other bytes: {name}")
    return results


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--count", type=int, default=1000)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        maps = Path(name) / "maps"
        write_maps(maps, options.count, 32)
        load = os.getloadavg()[1]
        results = runs(maps, Path(name), options.count)
    lines = [
        "# Many small maps on a Dask cluster",
        "",
        f"{options.count:,} maps of 32 x 16 pixels, --method median-cut --lights 8 --share 0.3; "
        f"scheduler, workers and client on one machine of {os.cpu_count()} cores, whose load was "
        f"{load:.1f} before. What is killed is killed by SIGKILL: a worker after a third of the "
        "maps, the scheduler after two thirds, with its workers started again. Files are the same "
        "in all runs, byte for byte.",
        "",
        "| run | maps | failed | seconds | maps a second | memory of the client, MB more |",
        "| --- | --- | --- | --- | --- | --- |",
        *(
            f"| {one.what} | {one.maps:,} | {one.failed} | {one.seconds:.1f} | {one.rate:.1f} "
            f"| {one.megabytes:.0f} |"
            for one in results
        ),
    ]
    text = "\n".join(lines) + "\n"
    (options.output / "library_cluster.md").write_text(text, encoding="utf-8")
    return results


if __name__ == "__main__":
    main()
