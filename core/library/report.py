"""What became of a library: a page to look at, and a table for a spreadsheet."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TextIO

from ..files.atomic import written_together
from .records import Row
from .report_page import page, readable

HTML, CSV = "report.html", "report.csv"

RESULTS = {"lights", "share", "predicted_error", "ground_error", "account_error"}
"""Figures that only a conversion has."""

FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet would compute begins with one of these."""


def write_report(folder: Path, rows: Sequence[Row], title: str) -> tuple[Path, Path]:
    """Write `report.html` and `report.csv` into a folder, both or none; return their paths.

    The same bytes for the same rows. Links in the page go to the rows' files, from the folder.
    title: of the page, the library's name. Raises CannotWrite.
    """
    with written_together(folder, (HTML, CSV)) as (html, table):
        with html.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(page(rows, title, CSV))
        # With a byte order mark: without it, Excel reads no UTF-8.
        with table.open("w", encoding="utf-8-sig", newline="") as file:
            _write_csv(file, rows)
    return folder / HTML, folder / CSV


def _write_csv(file: TextIO, rows: Sequence[Row]) -> None:
    """All of the rows but the pictures, as RFC 4180 says."""
    writer = csv.writer(file)
    names = [field.name for field in fields(Row) if field.name != "thumbnail"]
    writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(row, name) for name in names])


def _cell(row: Row, name: str) -> object:
    """What stands in a cell; nothing for a figure that there is not, so that no mean counts it."""
    value = getattr(row, name)
    if isinstance(value, (str, tuple)):
        text = readable(value if isinstance(value, str) else "; ".join(value))
        return "'" + text if text.startswith(FORMULAS) else text
    if (name in RESULTS and row.status == "failed") or (name in ("width", "height") and not value):
        return ""
    return value
