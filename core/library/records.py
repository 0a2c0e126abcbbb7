"""What became of each map of a library: a row of the report, and what a second run goes by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Status = Literal["done", "failed"]


@dataclass(frozen=True)
class Row:
    """One map of a library in the report.

    source: the file that was read, from the library's folder, with slashes. variants: other sizes
    of the same map, likewise. sentence: why there is no conversion; "" where there is one.
    width, height: of the map, 0 where they could not be read. share: part of all light that is in
    suns. predicted_error, ground_error, account_error: parts, as in `<stem>.lights.json`; the last
    is the worst channel's. seconds: that it took, without waiting. warnings: plain sentences.
    files: what was written, from the output's folder, with slashes. thumbnail: a small JPEG in
    base64, the map with its suns marked; "" where there is none. author, licence: as a file beside
    the map states them.
    """

    source: str
    status: Status
    sentence: str = ""
    variants: tuple[str, ...] = ()
    width: int = 0
    height: int = 0
    lights: int = 0
    share: float = 0.0
    predicted_error: float = 0.0
    ground_error: float = 0.0
    account_error: float = 0.0
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    thumbnail: str = ""
    author: str = ""
    licence: str = ""
