"""What a library's output knows of itself: which conversion was made of what, and as what files.

A record for each map lies in a hidden folder of the output. It is written after the files that it
is about have their names: where it is missing or does not fit, the map is converted again.
"""

from __future__ import annotations

import json
import secrets
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import CannotWrite
from ..files.belonging import sha256
from .records import Row

STATE = ".sunsplit"

VERSION = 1
"""Of records; others are not read."""

SETTLED = 2.0
"""Seconds after its last change from which a file's times tell that it is still the same: clocks of
file systems tick that slowly at worst (FAT)."""


@dataclass(frozen=True)
class Known:
    """A file's bytes. times: size in bytes and when it was changed, in nanoseconds, as long as they
    tell that the bytes are the same; None: they do not."""

    sha256: str
    times: tuple[int, int, int] | None

    def fits_by_times(self, path: Path) -> bool:
        """Whether a file has surely not changed. False: it may or may not have."""
        return self.times is not None and self.times == times_of(path)

    def fits(self, path: Path) -> bool:
        """Whether a file has these bytes, which are read if need be."""
        if self.fits_by_times(path):
            return True
        try:
            return (self.times is None or self.times[0] == path.stat().st_size) and (
                sha256(path) == self.sha256
            )
        except OSError:
            return False


@dataclass(frozen=True)
class Record:
    """request: what was asked for, see `work.MapJob.request`. source: the map. files: what was
    written, by path from the output's folder. row: for the report."""

    request: str
    source: Known
    files: dict[str, Known]
    row: Row


def times_of(path: Path, settled: bool = False) -> tuple[int, int, int] | None:
    """A file's size and the times of its last change; None where there is none.

    settled: None also where it was changed so lately that it may change again unseen.
    """
    try:
        status = path.stat()
    except OSError:
        return None
    if settled and time.time() - max(status.st_mtime, status.st_ctime) < SETTLED:
        return None
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns


def is_current_by_times(record: Record, request: str, source: Path, output: Path) -> bool:
    """Whether a conversion is surely what was asked for, without reading anything."""
    return (
        record.request == request
        and record.source.fits_by_times(source)
        and all(known.fits_by_times(output / path) for path, known in record.files.items())
    )


def is_current(record: Record, request: str, source: Path, output: Path) -> bool:
    """Whether a conversion is what was asked for, byte by byte."""
    return (
        record.request == request
        and record.source.fits(source)
        and all(known.fits(output / path) for path, known in record.files.items())
    )


def with_times_of_today(record: Record, source: Path, output: Path) -> Record:
    """A record whose files have been found to be the same, with their times."""
    files = {p: replace(k, times=times_of(output / p)) for p, k in record.files.items()}
    return replace(
        record, source=replace(record.source, times=times_of(source, settled=True)), files=files
    )


def record_path(output: Path, name: str) -> Path:
    """Of a map of this name, see `plan.PlannedMap.name`."""
    return output / STATE / "records" / f"{name}.json"


def read_record(output: Path, name: str) -> Record | None:
    """None where there is none that can be used: it is no more than a memory."""
    try:
        stored = json.loads(record_path(output, name).read_text(encoding="utf-8"))
        if stored["version"] != VERSION:
            return None
        files = {path: _known(entry) for path, entry in stored["files"].items()}
        return Record(stored["request"], _known(stored["source"]), files, row_from(stored["row"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def write_record(output: Path, name: str, record: Record) -> None:
    """Raises CannotWrite."""
    write_state(record_path(output, name), output, {"version": VERSION, **asdict(record)})


def write_state(path: Path, output: Path, document: dict[str, Any]) -> None:
    """Write what is to be remembered: whole, but it need not survive a power cut. Raises
    CannotWrite."""
    draft = path.with_name(f".{secrets.token_hex(8)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            draft.write_text(json.dumps(document), encoding="utf-8")
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise CannotWrite(f"Cannot write into {output}: {error.strerror or error}.") from error


def row_from(stored: dict[str, Any]) -> Row:
    """A row that was stored as JSON. Raises TypeError or KeyError where it is none."""
    lists = {name: tuple(stored[name]) for name in ("variants", "warnings", "files")}
    return Row(**stored | lists)


def _known(stored: dict[str, Any]) -> Known:
    times = stored["times"]
    return Known(stored["sha256"], None if times is None else (times[0], times[1], times[2]))
