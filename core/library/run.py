"""A whole library: `convert_library` finds, plans, converts what is not done, and reports."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import CannotWrite
from ..files import lock
from ..files.atomic import finish_interrupted
from .assets import Converted, blender_command, make_assets
from .cluster import Notice
from .events import AssetSettled, Listener, Told
from .local import Done, Task
from .options import LibraryOptions
from .planned import Planned, plan_library
from .records import Row
from .report import write_report
from .state import STATE
from .team import Team
from .work import MapJob, MapResult


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


def convert_library(
    library: str | Path,
    output: str | Path,
    options: LibraryOptions | None = None,
    *,
    workers: int | None = None,
    memory: int | None = None,
    scheduler: str | None = None,
    blender: str | None = None,
    listen: Listener | None = None,
    notice: Notice | None = None,
) -> LibraryResult:
    """Convert all maps of a folder that are not converted yet, and write a report.

    workers: processes, one for each core by default. memory: bytes that they may hold together, by
    default three quarters of what is free. scheduler: address of a Dask cluster, whose workers
    convert maps instead; they see both folders under the same paths. blender: the program that
    makes assets, by default the one that is there. notice: called with sentences about the cluster,
    such as that it has no workers at present.

    A map that cannot be converted is a row of the result; what raises ends the run: UnusableInput
    where there is no such library, CannotWrite where the output cannot be written, ClusterFailed
    where a cluster cannot be used, BadSetting. What was done stays done: called again, it goes on.
    """
    output, options = Path(output), options or LibraryOptions()
    team = Team.of(workers, memory, scheduler, notice)
    command = blender_command(blender) if options.assets else []
    planned = plan_library(library, output, options)
    told = Told([each.weight for each in planned.maps], listen)
    with _alone(output), _whole(output, planned.maps):
        rows, known = _all_converted(planned.maps, output, team, told)
        assets = []
        if options.assets:
            made = _converted_maps(planned.maps, rows)
            kind, pack, makers = options.assets, options.pack, team.for_assets(command)
            for asset in make_assets(made, output, kind, pack, makers):
                told.asset(asset)
                assets.append(asset)
        report, _ = write_report(output, rows, Path(library).resolve().name)
        return LibraryResult(tuple(rows), known, planned.unread, report, tuple(assets))


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


@contextmanager
def _whole(output: Path, maps: Sequence[Planned]) -> Iterator[None]:
    """What was begun by a run that was killed comes to its end, and so does what workers have begun
    that are killed meanwhile."""
    folders = [
        output / folder for folder in sorted({o.folder for m in maps for o in m.map.outputs})
    ]
    for folder in folders:
        finish_interrupted(folder)
    try:
        yield
    finally:
        for folder in folders:
            finish_interrupted(folder)


def _all_converted(
    maps: Sequence[Planned], output: Path, team: Team, told: Told
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
    for number, result in _converted(maps, left, output, team):
        settle(number, result.row, result.known)
    return [rows[number] for number in range(len(maps))], known


def _converted(
    maps: Sequence[Planned], left: Sequence[int], output: Path, team: Team
) -> Iterator[tuple[int, MapResult]]:
    """Numbers of maps, and what became of them, as they come; the largest are begun first."""
    if not left:
        return
    order = sorted(left, key=lambda n: (-maps[n].weight, n))
    tasks = {n: Task(maps[n].job.to_json(), maps[n].memory) for n in order}
    numbers = {id(task): n for n, task in tasks.items()}
    with team.for_maps(output) as pool:
        for done in pool.run(list(tasks.values())):
            if done:
                number = numbers[id(done.task)]
                yield number, _result(maps[number].job, done)


def _result(job: MapJob, done: Done) -> MapResult:
    if done.answer is not None:
        return MapResult.from_json(done.answer)
    row = Row(source=job.path, status="failed", sentence=done.sentence, variants=job.others)
    return MapResult(row)


def _converted_maps(maps: Sequence[Planned], rows: Sequence[Row]) -> list[Converted]:
    return [
        Converted(each.job, each.facts, row.width * row.height)
        for each, row in zip(maps, rows, strict=True)
        if row.status == "done"
    ]
