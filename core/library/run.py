"""A whole library: `convert_library` finds, plans, converts what is not done, and reports."""

from __future__ import annotations

import logging
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
from .assets import AssetSettled, Converted, blender_command, make_assets
from .local import Done, LocalWorkers, Task
from .memory import LEAST, MEGABYTE, memory_of, usable_memory
from .options import LibraryOptions
from .plan import PlannedMap, plan
from .processes import converter
from .records import Row
from .report import write_report
from .scan import scan
from .side_files import SideFacts, facts_beside
from .state import STATE, is_current_by_times, read_record
from .work import MapJob, MapResult

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


log = logging.getLogger("sunsplit")
"""What happens to each map, for pipelines that listen: failures are warnings."""
log.addHandler(logging.NullHandler())  # else Python prints them where nobody listens

Event = Settled | AssetSettled

Listener = Callable[[Event], None]
"""Called in the thread that has called `convert_library`; what it raises ends the run."""


@dataclass(frozen=True)
class LibraryResult:
    """rows: one for each map, in the order of their names. known: how many had been converted
    before. unread: folders that could not be looked into, as sentences. report: where it lies.
    assets: .blend files, if they were asked for."""

    rows: tuple[Row, ...]
    known: int
    unread: tuple[str, ...]
    report: Path
    assets: tuple[AssetSettled, ...] = ()

    @property
    def failed(self) -> tuple[Row, ...]:
        return tuple(row for row in self.rows if row.status == "failed")

    @property
    def is_well(self) -> bool:
        """Whether all maps are converted, all assets made and all folders seen."""
        return not (self.failed or self.unread or any(one.sentence for one in self.assets))


@dataclass(frozen=True)
class Planned:
    """A map, the job that converts it, and its row where that is done already."""

    map: PlannedMap
    job: MapJob
    facts: SideFacts
    row: Row | None

    def with_facts(self, row: Row) -> Row:
        """A row with what is said of its map beside it."""
        facts = self.facts
        warnings = (*row.warnings, *facts.warnings)
        return replace(row, author=facts.author, licence=facts.licence, warnings=warnings)

    @property
    def weight(self) -> float:
        """Seconds that it takes, about."""
        return FIXED + PER_PIXEL * self.map.file.width * self.map.file.height

    @property
    def memory(self) -> int:
        """Bytes that it takes, with its worker."""
        file, asked = self.map.file, self.job.settings.residual_width
        widths = [output.width or 0 for output in self.map.outputs]
        widths += [file.width if asked == "own" else asked or 0]
        return memory_of(file, max(widths))


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
    blender: str | None = None,
    listen: Listener | None = None,
) -> LibraryResult:
    """Convert all maps of a folder that are not converted yet, and write a report.

    workers: processes, one for each core by default. memory: bytes that they may hold together, by
    default three quarters of what is free. blender: the program that makes assets, by default the
    one that is there. A map that cannot be converted is a row of the result;
    what raises ends the run: UnusableInput where there is no such library, CannotWrite where the
    output cannot be written, BadSetting. What was done stays done: called again, it goes on.
    """
    output, options = Path(output), options or LibraryOptions()
    workers, memory = _checked(workers, memory)
    command = blender_command(blender) if options.assets else []
    planned = plan_library(library, output, options)
    with _alone(output):
        _finish_interrupted(output, planned.maps)
        told = _Told(planned.maps, listen)
        rows, known = _all_converted(planned.maps, workers, memory, told)
        assets = []
        if options.assets:
            made = _converted_maps(planned.maps, rows)
            kind, pack = options.assets, options.pack
            for asset in make_assets(made, output, kind, pack, command, workers, memory):
                told.asset(asset)
                assets.append(asset)
        report, _ = write_report(output, rows, Path(library).resolve().name)
        return LibraryResult(tuple(rows), known, planned.unread, report, tuple(assets))


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
        facts = facts_beside(library / each.file.path, library)
        maps.append(Planned(each, job, facts, _row_of_earlier(job, each)))
    return LibraryPlan(tuple(maps), found.unread)


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


def _all_converted(
    maps: Sequence[Planned], workers: int, memory: int, told: _Told
) -> tuple[list[Row], int]:
    """Rows of all maps, and how many of them had been converted before."""
    rows: dict[int, Row] = {}
    known = 0

    def settle(number: int, row: Row, was_known: bool) -> None:
        nonlocal known
        known += was_known
        rows[number] = maps[number].with_facts(row)
        told.settled(number, rows[number], was_known)

    for number, each in enumerate(maps):
        if each.row:
            settle(number, each.row, True)
    left = [number for number in range(len(maps)) if number not in rows]
    for number, result in _converted(maps, left, workers, memory):
        settle(number, result.row, result.known)
    return [rows[number] for number in range(len(maps))], known


def _converted_maps(maps: Sequence[Planned], rows: Sequence[Row]) -> list[Converted]:
    return [
        Converted(each.job, each.facts, row.width * row.height)
        for each, row in zip(maps, rows, strict=True)
        if row.status == "done"
    ]


def _converted(
    maps: Sequence[Planned], left: Sequence[int], workers: int, memory: int
) -> Iterator[tuple[int, MapResult]]:
    """Numbers of maps, and what became of them, as they come; the largest are begun first."""
    order = sorted(left, key=lambda n: (-maps[n].weight, n))
    tasks = {n: Task(maps[n].job.to_json(), maps[n].memory) for n in order}
    numbers = {id(task): n for n, task in tasks.items()}
    with LocalWorkers(converter(), workers, memory) as pool:
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
        if row.status == "failed":
            log.warning("%s: %s", row.source, row.sentence)
        elif not known:
            log.info("%s: %d lights, %.1f s", row.source, row.lights, row.seconds)
        if self._listen:
            total, fraction = len(self._weights), self._weight / self._whole
            self._listen(Settled(row, known, self._number, total, fraction))

    def asset(self, asset: AssetSettled) -> None:
        if asset.sentence:
            log.warning("%s: %s", asset.blend, asset.sentence)
        elif not asset.known:
            log.info("%s", asset.blend)
        if self._listen:
            self._listen(asset)
