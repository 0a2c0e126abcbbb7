"""One map of a library: converted and written, in whatever process and on whatever machine."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..errors import CannotWrite, SunsplitError, UnusableInput
from ..settings import ConversionSettings
from ..tolerances import ACCOUNT
from ..version import version
from .plan import Output
from .records import Row
from .state import (
    Known,
    Record,
    is_current,
    read_record,
    row_from,
    times_of,
    with_times_of_today,
    write_record,
)

if TYPE_CHECKING:
    from ..conversion import Conversion
    from ..environment import EnvironmentMap
    from ..files.conversion import WrittenFiles


@dataclass(frozen=True)
class MapJob:
    """What a worker has to know. library, output: folders. path: of the map in the library.
    others: further sizes of it. name: of the record. version: of Sunsplit, as the same one must
    convert all of a library."""

    library: str
    output: str
    path: str
    others: tuple[str, ...]
    name: str
    outputs: tuple[Output, ...]
    settings: ConversionSettings
    preview: bool
    allow_ldr: bool
    version: str

    @property
    def source(self) -> Path:
        return Path(self.library) / self.path

    @property
    def request(self) -> str:
        """What is asked for, as a digest: another one asks for other bytes."""
        asked = [
            *(self.version, self.path, self.settings.as_dict(), self.preview, self.allow_ldr),
            [asdict(output) for output in self.outputs],
        ]
        return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, stored: dict[str, Any]) -> MapJob:
        return cls(
            **stored
            | {
                "others": tuple(stored["others"]),
                "outputs": tuple(Output(**output) for output in stored["outputs"]),
                "settings": ConversionSettings(**stored["settings"]),
            }
        )


Obstacle = Literal["unseen", "unwritable", "memory"]


@dataclass(frozen=True)
class MapResult:
    """row: for the report. known: whether it had been converted before. obstacle: what of this
    machine stood in the way, so that another one may do it: the map was not there ("unseen"), the
    output could not be written ("unwritable"), or it has not "memory" enough."""

    row: Row
    known: bool = False
    obstacle: Obstacle | None = None

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, stored: dict[str, Any]) -> MapResult:
        return cls(**stored | {"row": row_from(stored["row"])})


def convert_map(job: MapJob) -> MapResult:
    """Convert a map and write it, unless that was done. A map that cannot be used is a row that
    says why; what raises is a bug."""
    started = time.perf_counter()
    output = Path(job.output)
    row = Row(source=job.path, status="failed", variants=job.others)
    obstacle: Obstacle | None = None
    try:
        _refuse_other_version(job)
        record = _record_of_today(job)
        if record:
            write_record(output, job.name, record)
            return MapResult(replace(record.row, variants=job.others), known=True)
        record = _converted(job, row, started)
        write_record(output, job.name, record)
        return MapResult(record.row)
    except SunsplitError as error:
        sentence = " ".join(str(error).split())
        obstacle = _obstacle(job, error)
    except MemoryError:
        sentence, obstacle = f"{job.path} does not fit into memory.", "memory"
    seconds = time.perf_counter() - started
    return MapResult(replace(row, sentence=sentence, seconds=seconds), obstacle=obstacle)


def _obstacle(job: MapJob, error: SunsplitError) -> Obstacle | None:
    if isinstance(error, CannotWrite):
        return "unwritable"
    return None if os.access(job.source, os.R_OK) else "unseen"


def _refuse_other_version(job: MapJob) -> None:
    if job.version != version():
        raise UnusableInput(
            f"This worker has Sunsplit {version()}, and {job.version} was asked for: "
            "install the same one everywhere."
        )


def _record_of_today(job: MapJob) -> Record | None:
    """The record of a conversion that need not be made again."""
    output = Path(job.output)
    record = read_record(output, job.name)
    if record and is_current(record, job.request, job.source, output):
        return with_times_of_today(record, job.source, output)
    return None


def _converted(job: MapJob, row: Row, started: float) -> Record:
    from ..files.conversion import save
    from ..files.maps import load

    output = Path(job.output)
    times = times_of(job.source, settled=True)
    environment = load(job.source, job.allow_ldr)
    files: dict[str, Known] = {}
    first = None
    for wanted in job.outputs:
        conversion = _conversion(environment, job.settings, wanted)
        written = save(conversion, output / wanted.folder, job.preview)
        files |= _known_files(written, output)
        first = first or conversion
    if times is not None and times != times_of(job.source):
        raise UnusableInput(f"{job.path} was changed while it was converted: run this again.")
    assert first is not None, "a map has at least one output"
    row = _row(first, replace(row, files=tuple(files)))
    row = replace(row, seconds=time.perf_counter() - started)
    return Record(job.request, Known(environment.sha256, times), files, row)


def _conversion(
    environment: EnvironmentMap, settings: ConversionSettings, wanted: Output
) -> Conversion:
    """Of a map that keeps what was found out about it: another width takes little time."""
    from ..conversion import convert

    if wanted.width is not None:
        asked = settings.residual_width
        width = min(asked, wanted.width) if isinstance(asked, int) else wanted.width
        settings = replace(settings, residual_width=width)
    conversion = convert(environment, settings)
    return replace(conversion, environment=replace(environment, name=wanted.stem))


def _known_files(written: WrittenFiles, output: Path) -> dict[str, Known]:
    from ..files.belonging import sha256

    paths = (written.lights, written.residual, written.samples, written.preview)
    return {
        path.relative_to(output).as_posix(): Known(sha256(path), times_of(path))
        for path in paths
        if path
    }


def _row(conversion: Conversion, row: Row) -> Row:
    from ..suspicions import map_warnings
    from .thumbnail import thumbnail

    environment = conversion.environment
    return replace(
        row,
        status="done",
        width=environment.own_width,
        height=environment.own_height,
        lights=len(conversion.suns),
        share=conversion.account.share,
        predicted_error=conversion.predicted_error,
        ground_error=conversion.ground_error,
        account_error=float(conversion.account.relative_error.max()),
        warnings=(*map_warnings(conversion), *_left_out(conversion)),
        thumbnail=base64.b64encode(thumbnail(conversion)).decode(),
    )


def _left_out(conversion: Conversion) -> list[str]:
    missing = 1 - conversion.account.share
    if conversion.residual is not None or missing < ACCOUNT:
        return []
    return [f"No residual map: {missing:.1%} of all light is left out."]
