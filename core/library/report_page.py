"""The report of a library as one HTML page that needs nothing else: no network, no library.

The rows are in the page as a table, so that it can be read, searched by the browser and printed
whatever becomes of the script; that only sorts and hides them.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import PurePosixPath
from urllib.parse import quote

from ..files.conversion import ENDINGS
from .records import Row
from .report_script import SCRIPT
from .report_style import STYLE

UP, DOWN = "ascending", "descending"

COLUMNS = (
    ("Map", UP, "map", "Folder and name of the map"),
    ("Status", DOWN, "status", "Whether there is a conversion"),
    ("Suns", DOWN, "n", "How many lights"),
    ("Light in suns", DOWN, "n", "Part of all light that is in suns"),
    ("Predicted error", DOWN, "n", "What shadows of the suns are wrong by, in the mean"),
    ("Ground error", DOWN, "n", "What level ground in the open is wrong by"),
    ("Account", DOWN, "n", "Part of the light that suns and residual map together miss"),
    ("Size", DOWN, "n size", "Width and height of the map in pixels"),
    ("Time", DOWN, "n", "Seconds of work, without waiting"),
    ("Warnings", DOWN, "notes", "Why there is no conversion, and how many warnings"),
)
"""Of the table, behind the picture: name, which way the first click sorts, CSS class, explanation.
What is sorted is a number in each cell: what an artist looks for, the worst, comes first."""

KINDS = {
    "lights": "lights",
    "residual": "residual map",
    "samples": "samples",
    "preview": "preview",
}
"""What a link to a file of this kind is called."""

FAILURE = 1000
"""Warnings that a failure counts as: all failures come before what is only warned of."""


def page(rows: Sequence[Row], title: str, csv: str) -> Iterator[str]:
    """The page in pieces. csv: the name of the table beside it."""
    yield _head(title)
    yield f"<header><h1>{escape(readable(title))}</h1>\n{_totals(rows)}</header>\n"
    yield _bar(rows)
    yield (
        '<noscript><p class="message">Sorting and searching need JavaScript, which is off here. '
        f'All figures are in <a href="{link(csv)}">{escape(csv)}</a>, too, for a spreadsheet.'
        "</p></noscript>\n"
    )
    yield f'<div class="report"><table role="table" aria-label="Maps">\n{_table_head()}'
    yield '<tbody role="rowgroup">\n'
    by_name = sorted(range(len(rows)), key=lambda n: in_words(rows[n].source))
    places = {n: place for place, n in enumerate(by_name)}
    for n, row in enumerate(rows):
        yield _row(row, places[n])
    empty = "" if not rows else " hidden"
    words = "No map matches." if rows else "There are no maps in this library."
    yield f'</tbody></table></div>\n<p class="nothing" id="nothing"{empty}>{words}</p>\n'
    yield f"<script>{SCRIPT}</script>\n</body></html>\n"


def readable(name: str) -> str:
    """Text that can be written as UTF-8: bytes of a file's name that are none become \\udc80."""
    return name.encode("utf-8", "backslashreplace").decode()


def in_words(name: str) -> list[str | int]:
    """What to sort names by: without case, and sky_9 before sky_10."""
    parts: list[str | int] = list(re.split("([0-9]+)", name.casefold()))
    parts[1::2] = map(int, parts[1::2])
    return parts


def link(path: str) -> str:
    """A relative address of a file, from its path with slashes."""
    return quote(os.fsencode(path))


def _head(title: str) -> str:
    # Whatever a file is called, nothing but this script runs and nothing is fetched.
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(STYLE)}'; "
        f"script-src '{_hash(SCRIPT)}'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(readable(title))}</title>\n<style>{STYLE}</style></head><body>\n"
    )


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _totals(rows: Sequence[Row]) -> str:
    failed = sum(row.status == "failed" for row in rows)
    warned = sum(bool(row.warnings) for row in rows)
    parts = [
        _counted(len(rows), "map"),
        f"<b>{len(rows) - failed:,}</b> converted",
        f"<b>{failed:,}</b> failed",
        f"<b>{warned:,}</b> with warnings",
        _counted(sum(row.lights for row in rows), "sun"),
        f"<b>{_duration(sum(row.seconds for row in rows))}</b> of work",
    ]
    return f'<p class="totals">{" · ".join(parts)}</p>'


def _counted(count: int, noun: str) -> str:
    return f"<b>{count:,}</b> {noun}{'' if count == 1 else 's'}"


def _duration(seconds: float) -> str:
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:,} h {minutes} min" if hours else f"{minutes} min {rest} s"


def _bar(rows: Sequence[Row]) -> str:
    """Search and filters; without the script they would do nothing, so it shows them."""
    counts = {
        "all": len(rows),
        "failed": sum(row.status == "failed" for row in rows),
        "warned": sum(bool(row.warnings) for row in rows),
    }
    buttons = "".join(
        f'<button type="button" data-choice="{choice}" '
        f'aria-pressed="{str(choice == "all").lower()}"'
        f"{'' if counts[choice] else ' disabled'}>{name} ({counts[choice]:,})</button>"
        for choice, name in (("all", "All"), ("failed", "Failed"), ("warned", "With warnings"))
    )
    return (
        '<div class="bar" role="search" hidden>'
        '<input type="search" id="search" autocomplete="off" '
        'placeholder="Name, folder, warning, author" aria-label="Search the maps">'
        f'{buttons}<span class="shown" id="shown" role="status"></span></div>\n'
    )


def _table_head() -> str:
    cells = "".join(
        f'<th role="columnheader" scope="col" class="{look}" data-first="{first}">'
        f'<button type="button" title="{escape(explained)}">{name}</button></th>'
        for name, first, look, explained in COLUMNS
    )
    picture = '<th role="columnheader" scope="col" aria-label="Picture"></th>'
    return f'<thead role="rowgroup"><tr role="row">{picture}{cells}</tr></thead>\n'


def _row(row: Row, place: int) -> str:
    """place: of its name among all."""
    kinds = [row.status] + ["warned"] * bool(row.warnings)
    cells = [_picture(row), _map(row, place), *_figures(row), _notes(row)]
    return f'<tr role="row" class="{" ".join(kinds)}">{"".join(cells)}</tr>\n'


def _cell(look: str, content: str, sorted_by: float | None = None) -> str:
    value = "" if sorted_by is None else f' data-v="{sorted_by:.17g}"'
    return f'<td role="cell" class="{look}"{value}>{content}</td>'


def _picture(row: Row) -> str:
    if not row.thumbnail:
        return _cell("picture", '<span class="none">no picture</span>')
    name = escape(readable(PurePosixPath(row.source).name))
    image = (
        f'<img src="data:image/jpeg;base64,{escape(row.thumbnail)}" width="192" height="96" '
        f'decoding="async" alt="{name} with its suns marked">'
    )
    preview = next((file for file in row.files if _kind(file) == KINDS["preview"]), None)
    if preview:
        image = f'<a href="{link(preview)}">{image}</a>'
    return _cell("picture", image)


def _map(row: Row, place: int) -> str:
    path = PurePosixPath(row.source)
    lines = [f"<b>{escape(readable(path.name))}</b>"]
    whose = [f"by {row.author}"] * bool(row.author) + [row.licence] * bool(row.licence)
    about = [
        "" if path.parent == PurePosixPath() else f"in {path.parent}",
        f"other sizes: {', '.join(row.variants)}" if row.variants else "",
        " · ".join(whose),
    ]
    lines += [f"<small>{escape(readable(line))}</small>" for line in about if line]
    if row.files:
        links = "".join(f'<a href="{link(f)}">{_kind(f)}</a>' for f in row.files)
        lines.append(f'<span class="files">{links}</span>')
    return _cell("map", "".join(lines), place)


def _kind(file: str) -> str:
    """What a written file is to a reader."""
    known = (word for kind, word in KINDS.items() if file.endswith(f".{ENDINGS[kind]}"))
    return next(known, None) or escape(readable(PurePosixPath(file).name))


def _figures(row: Row) -> list[str]:
    size = f"{row.width}\N{NO-BREAK SPACE}× {row.height}" if row.width else ""
    figures = [
        (f"{row.lights:,}", row.lights),
        (f"{row.share:.1%}", row.share),
        (_percent(row.predicted_error), row.predicted_error),
        (_percent(row.ground_error), row.ground_error),
        (_rounded(row.account_error), row.account_error),
    ]
    if row.status == "failed":  # there are none: 0 would look like a result
        figures = [('<span class="dim">–</span>', None)] * len(figures)
    return [
        _cell("status", *(("failed", 1) if row.status == "failed" else ("converted", 0))),
        *(_cell("n", *figure) for figure in figures),
        _cell("n size", size, row.width * row.height or None),
        _cell("n", f"{row.seconds:.1f} s", row.seconds),
    ]


def _percent(part: float) -> str:
    """With the digits that matter: 0.42%, 12%."""
    return f"{part:.2%}" if part < 0.1 else f"{part:.0%}"


def _rounded(part: float) -> str:
    """3e-7, as short as that."""
    if part == 0:
        return "0"
    digits, exponent = f"{part:.0e}".split("e")
    return f"{digits}e{int(exponent)}"


def _notes(row: Row) -> str:
    sentences = [("sentence", row.sentence)] if row.sentence else []
    sentences += [("warning", warning) for warning in row.warnings]
    words = "".join(f'<p class="{look}">{escape(readable(s))}</p>' for look, s in sentences)
    return _cell("notes", words, len(sentences) + FAILURE * bool(row.sentence))
