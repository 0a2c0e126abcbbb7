"""What is to be done for each map of a library, and what is done already."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import CannotWrite, UnusableInput
from ..version import version
from .memory import memory_of
from .options import LibraryOptions
from .plan import PlannedMap, plan
from .records import Row
from .scan import scan
from .side_files import SideFacts, facts_beside
from .state import is_current_by_times, read_record
from .work import MapJob

FIXED, PER_PIXEL = 0.3, 4e-8
"""Seconds that a map takes, about, and for each of its pixels: only for what is told of progress,
and to begin with what takes longest."""


@dataclass(frozen=True)
class Planned:
    """A map, the job that converts it, what is said of it beside it, and its row where that is done
    already."""

    map: PlannedMap
    job: MapJob
    facts: SideFacts
    row: Row | None

    @property
    def weight(self) -> float:
        """Seconds that it takes, about."""
        return FIXED + PER_PIXEL * self.map.file.width * self.map.file.height

    @property
    def memory(self) -> int:
        """Bytes that it takes, with its worker."""
        file, asked = self.map.file, self.job.settings.residual_width
        widths = [output.width or 0 for output in self.map.outputs]
        widths += [file.width if asked == "own" else asked if isinstance(asked, int) else 0]
        return memory_of(file, max(widths))

    def with_facts(self, row: Row) -> Row:
        """A row with what is said of its map beside it."""
        facts = self.facts
        warnings = (*row.warnings, *facts.warnings)
        return replace(row, author=facts.author, licence=facts.licence, warnings=warnings)


@dataclass(frozen=True)
class LibraryPlan:
    """All maps of a library, by name, and what could not be looked into."""

    maps: tuple[Planned, ...]
    unread: tuple[str, ...]


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
        facts = facts_beside(library / each.file.path, library, each.file.width)
        maps.append(Planned(each, job, facts, _row_of_earlier(job, each)))
    return LibraryPlan(tuple(maps), found.unread)


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
