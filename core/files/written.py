"""A conversion as its files state it: what is needed to show it without converting again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..account import Account
from ..errors import UnusableInput
from ..suns import Sun
from . import lights_json
from .belonging import read_named, read_together
from .maps import load


@dataclass(frozen=True, eq=False)
class WrittenConversion:
    """source_sha256: of the map's file. suns: brightest first. residual: its file, or None.
    radiance: of the residual, float32 (height, width, 3), narrower where it is very wide.
    has_cells: the residual is a Voronoi map. predicted_error, ground_error: parts, as
    `Conversion` has them."""

    source_sha256: str
    suns: tuple[Sun, ...]
    account: Account
    residual: Path | None
    radiance: NDArray[np.float32] | None
    has_cells: bool
    predicted_error: float
    ground_error: float


def read_written(lights: str | Path) -> WrittenConversion:
    """The conversion that a `<name>.lights.json` and the files beside it hold.

    Raises UnusableInput, also when the residual is missing or of another conversion.
    """
    lights = Path(lights)
    return read_together(lights, lambda: _read(lights))


def _read(lights: Path) -> WrittenConversion:
    document, suns, account = lights_json.read(lights)
    residual, radiance = None, None
    if stored := document["residual"]:
        residual, stated = lights_json.named_file(lights, stored)
        radiance = read_named(residual, stated, lights.name, lambda path: load(path).radiance)
    try:
        return WrittenConversion(
            str(document["source"]["sha256"]),
            suns,
            account,
            residual,
            radiance,
            bool(stored) and stored["kind"] == "voronoi",
            *_errors(document["predicted_error"]),
        )
    except lights_json.DAMAGE as error:
        raise UnusableInput(f"{lights.name} is damaged: {error!r} in what it states.") from error


def _errors(stated: dict[str, Any]) -> tuple[float, float]:
    percents = stated["shadow_edges_percent"], stated["level_ground_percent"]
    return float(percents[0]) / 100, float(percents[1]) / 100
