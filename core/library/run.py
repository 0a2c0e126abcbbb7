"""A whole library: `convert_library` finds, plans, converts what is not done, and reports."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from ..cores import usable
from ..errors import CannotWrite, UnusableInput
from ..files import lock
from ..files.atomic import finish_interrupted
from ..settings import BadSetting
from ..version import version
from .cluster import ClusterWorkers, Notice
from .local import Done, LocalWorkers, Task
from .memory import LEAST, MEGABYTE, memory_of, usable_memory
from .options import LibraryOptions
from .plan import PlannedMap, plan
from .processes import converter
from .records import Row
from .scan import scan
from .state import STATE, is_current_by_times, read_record
from .work import MapJob, MapResult

Team = Callable[[], "LocalWorkers | ClusterWorkers"]

FIXED, PER_PIXEL = 0.3, 4e-8
"""Seconds that a map takes, about, and for each of its pixels: only for what is told of progress,
and to begin with what takes longest."""


@dataclass(frozen=True)
class Settled:
    """A map of which nothing more is to be done. known: it had been converted before. number: of
    maps that are settled, out of `total`. fraction: of all work done, 0 to 1, about."""

    row: Row
    known: bool
    number: int
    total: int
    fraction: float


Listener = Callable[[Settled], None]
"""Called in the thread that has called `convert_library`; what it raises ends the run."""


@dataclass(frozen=True)
class LibraryResult:
    """rows: one for each map, in the order of their names. known: how many had been converted
    before. unread: folders that could not be looked into, as sentences. report: where it lies."""

    rows: tuple[Row, ...]
    known: int
    unread: tuple[str, ...]
    report: Path | None

    @property
    def failed(self) -> tuple[Row, ...]:
        return tuple(row for row in self.rows if row.status == "failed")

    @property
    def is_well(self) -> bool:
        """Whether all maps are converted and all folders were seen."""
        return not self.failed and not self.unread


@dataclass(frozen=True)
class Planned:
    """A map, the job that converts it, and its row where that is done already."""

    map: PlannedMap
    job: MapJob
    row: Row | None

    @property
    def weight(self) -> float:
        """Seconds that it takes, about."""
        return FIXED + PER_PIXEL * self.map.file.width * self.map.file.height


@dataclass(frozen=True)
class LibraryPlan:
    """All maps of a library, by name, and what could not be looked into."""

    maps: tuple[Planned, ...]
    unread: tuple[str, ...]


def convert_library(
    library: str | Path,
    output: str | Path,
    options: LibraryOptions | None = None,
    *,
    workers: int | None = None,
    memory: int | None = None,
    scheduler: str | None = None,
    listen: Listener | None = None,
    notice: Notice | None = None,
) -> LibraryResult:
    """Convert all maps of a folder that are not converted yet, and write a report.

    workers: processes, one for each core by default. memory: bytes that they may hold together, by
    default three quarters of what is free. scheduler: address of a Dask cluster, whose workers do
    the work instead; they see both folders under the same paths. notice: called with sentences
    about the cluster, such as that it has no workers at present.

    A map that cannot be converted is a row of the result; what raises ends the run: UnusableInput
    where there is no such library, CannotWrite where the output cannot be written, ClusterFailed
    where a cluster cannot be used, BadSetting. What was done stays done: called again, it goes on.
    """
    output = Path(output)
    team = _team(output, workers, memory, scheduler, notice)
    planned = plan_library(library, output, options)
    with _alone(output):
        _finish_interrupted(output, planned.maps)
        rows = [each.row for each in planned.maps]
        known = len(rows) - rows.count(None)
        told = _Told(planned.maps, listen)
        for number, row in enumerate(rows):
            if row:
                told.settled(number, row, True)
        left = [n for n, row in enumerate(rows) if row is None]
        try:
            for number, result in _converted(planned.maps, left, team):
                rows[number] = result.row
                known += result.known
                told.settled(number, result.row, result.known)
        finally:
            _finish_interrupted(output, planned.maps)
        finished = tuple(row for row in rows if row)
        return LibraryResult(finished, known, planned.unread, None)


def plan_library(
    library: str | Path, output: str | Path, options: LibraryOptions | None = None
) -> LibraryPlan:
    """What `convert_library` would do. Nothing is written, and of maps only headers are read.
    Raises UnusableInput."""
    library, output, options = Path(library), Path(output), options or LibraryOptions()
    if output.exists() and not output.is_dir():
        raise CannotWrite(f"Cannot write into {output}: it is a file.")
    found = scan(library, output, options)
    if not found.files and not found.unread:
        patterns = ", ".join(options.included)
        raise UnusableInput(f"There are no maps in {library}: nothing there is named {patterns}.")
    maps = []
    for each in plan(found, options):
        job = _job(library, output, each, options)
        maps.append(Planned(each, job, _row_of_earlier(job, each)))
    return LibraryPlan(tuple(maps), found.unread)


def _team(
    output: Path,
    workers: int | None,
    memory: int | None,
    scheduler: str | None,
    notice: Notice | None,
) -> Team:
    """What makes those who will do the work."""
    if scheduler is None:
        count, limit = _checked(workers, memory)
        return lambda: LocalWorkers(converter(), count, limit)
    if workers is not None or memory is not None:
        raise BadSetting(
            "--workers and --memory are for work on this machine: with --scheduler, "
            "`dask worker --nthreads N --memory-limit SIZE` says that for each machine."
        )
    return lambda: ClusterWorkers(scheduler, output.absolute(), notice or (lambda _: None))


def _checked(workers: int | None, memory: int | None) -> tuple[int, int]:
    if workers is not None and workers < 1:
        raise BadSetting(f"workers must be at least 1, not {workers}.")
    memory = usable_memory() if memory is None else memory
    if memory < LEAST:
        raise BadSetting(f"memory must be at least {LEAST // MEGABYTE}M.")
    return workers or usable(), memory


def _job(library: Path, output: Path, each: PlannedMap, options: LibraryOptions) -> MapJob:
    return MapJob(
        library=str(library.absolute()),
        output=str(output.absolute()),
        path=each.file.path,
        others=tuple(file.path for file in each.others),
        name=each.name,
        outputs=each.outputs,
        settings=options.settings,
        preview=options.preview,
        allow_ldr=options.allow_ldr,
        version=version(),
    )


def _row_of_earlier(job: MapJob, each: PlannedMap) -> Row | None:
    """Of a conversion that surely is what is asked for; else a worker looks at it closely."""
    record = read_record(Path(job.output), each.name)
    if record and is_current_by_times(record, job.request, job.source, Path(job.output)):
        return replace(record.row, variants=job.others)
    return None


@contextmanager
def _alone(output: Path) -> Iterator[None]:
    """Nobody else converts into this folder. Raises CannotWrite."""
    state = output / STATE
    try:
        state.mkdir(parents=True, exist_ok=True)
        held = lock.take(state / "lock")
    except OSError as error:
        raise CannotWrite(f"Cannot write into {output}: {error.strerror or error}.") from error
    if held is None:
        raise CannotWrite(f"Another run converts into {output}: wait for it, or stop it.")
    with held:
        yield


def _finish_interrupted(output: Path, maps: Sequence[Planned]) -> None:
    """What was begun by a run that was killed."""
    for folder in sorted({out.folder for each in maps for out in each.map.outputs}):
        finish_interrupted(output / folder)


def _converted(
    maps: Sequence[Planned], left: Sequence[int], team: Team
) -> Iterator[tuple[int, MapResult]]:
    """Numbers of maps, and what became of them, as they come; the largest are begun first."""
    order = sorted(left, key=lambda n: (-maps[n].weight, n))
    tasks = {n: Task(maps[n].job.to_json(), memory_of(maps[n].map.file)) for n in order}
    numbers = {id(task): n for n, task in tasks.items()}
    if not tasks:
        return
    with team() as pool:
        for done in pool.run(list(tasks.values())):
            if done:
                number = numbers[id(done.task)]
                yield number, _result(maps[number].job, done)


def _result(job: MapJob, done: Done) -> MapResult:
    if done.answer is not None:
        return MapResult.from_json(done.answer)
    row = Row(source=job.path, status="failed", sentence=done.sentence, variants=job.others)
    return MapResult(row)


class _Told:
    """Counts what is settled, and tells the listener."""

    def __init__(self, maps: Sequence[Planned], listen: Listener | None) -> None:
        self._weights = [each.weight for each in maps]
        self._whole = sum(self._weights)
        self._listen, self._number, self._weight = listen, 0, 0.0

    def settled(self, number: int, row: Row, known: bool) -> None:
        self._number += 1
        self._weight += self._weights[number]
        if self._listen:
            total, fraction = len(self._weights), self._weight / self._whole
            self._listen(Settled(row, known, self._number, total, fraction))
