"""Folders of small maps, and what was made of them."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np

from sunsplit.core.library.state import STATE
from tests.files import noise, sunny, write_exr, write_hdr

REPORT = ("report.html", "report.csv")


def write_maps(folder: Path, count: int, width: int = 64) -> list[str]:
    """Maps that all differ, in three folders and both formats; their paths, in order."""
    paths = []
    for number in range(count):
        inner = folder / ("", "noon", "noon/late")[number % 3]
        inner.mkdir(parents=True, exist_ok=True)
        pixels = sunny(width) + noise(width // 2, seed=number)
        pixels *= np.float32(1 + number % 7)
        if number % 2:
            path = write_exr(inner / f"map {number:04}.exr", pixels)
        else:
            path = write_hdr(inner / f"map {number:04}.hdr", pixels)
        paths.append(path.relative_to(folder).as_posix())
    return sorted(paths)


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes of all files of a library's output, hidden leftovers too, but for what it remembers of
    itself; of the report without the seconds that each map took."""
    return {
        path.relative_to(folder).as_posix(): _without_seconds(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and STATE not in path.relative_to(folder).parts
    }


def _without_seconds(path: Path) -> bytes:
    data = path.read_bytes()
    if path.name == "report.csv":
        rows = list(csv.DictReader(data.decode("utf-8-sig").splitlines()))
        return json.dumps([row | {"seconds": ""} for row in rows]).encode()
    if path.name == "report.html":
        data = re.sub(rb'data-v="[0-9.e-]+">[0-9.]+ s</td>', b"", data)
        return re.sub(rb"<b>[^<]+</b> of work", b"", data)
    return data


def documents(folder: Path) -> dict[str, dict]:
    """What was written about each conversion, by path without its ending."""
    return {
        path.relative_to(folder).as_posix().removesuffix(".lights.json"): json.loads(
            path.read_text(encoding="utf-8")
        )
        for path in sorted(folder.rglob("*.lights.json"))
    }
