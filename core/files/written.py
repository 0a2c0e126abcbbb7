"""A conversion as its files state it: what is needed to show it without converting again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..account import Account
from ..environment import WIDE, whole_part
from ..errors import UnusableInput
from ..reduction import narrowed
from ..suns import Sun
from . import exr, lights_json
from .belonging import read_named, read_together


@dataclass(frozen=True, eq=False)
class WrittenConversion:
    """source_sha256: of the map's file. suns: brightest first. residual: its file, or None.
    radiance: of the residual, float32 (height, width, 3), narrowed where it is wider than asked.
    has_cells: the residual is a Voronoi map. predicted_error, ground_error,
    standing_error: parts, as `Conversion` has them."""

    source_sha256: str
    suns: tuple[Sun, ...]
    account: Account
    residual: Path | None
    radiance: NDArray[np.float32] | None
    has_cells: bool
    predicted_error: float
    ground_error: float
    standing_error: float | None


def read_written(lights: str | Path, widest: int = WIDE) -> WrittenConversion:
    """The conversion that a `<name>.lights.json` and the files beside it hold.

    widest: pixels of the residual's width that are wanted at most. Raises UnusableInput, also when
    the residual is missing or of another conversion.
    """
    lights = Path(lights)
    return read_together(lights, lambda: _read(lights, widest))


def _read(lights: Path, widest: int) -> WrittenConversion:
    document, suns, account = lights_json.read(lights)
    residual, radiance = None, None
    if stored := document["residual"]:
        residual, stated = lights_json.named_file(lights, stored)
        radiance = read_named(
            residual, stated, lights.name, lambda path: _radiance_of(path, widest)
        )
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


def _radiance_of(residual: Path, widest: int) -> NDArray[np.float32]:
    """Of a residual map, which needs no repair and may be black. Raises UnusableInput."""
    pixels, _ = exr.read(residual)
    if pixels.width != 2 * pixels.height:
        raise UnusableInput(f"{residual.name} is damaged: a residual map is twice as wide as high.")
    radiance = narrowed(pixels, whole_part(pixels.width, widest))
    if not (np.isfinite(radiance).all() and (radiance >= 0).all()):
        raise UnusableInput(f"{residual.name} is damaged: it holds what is no light.")
    return radiance


def _errors(stated: dict[str, Any]) -> tuple[float, float, float | None]:
    edges, ground = stated["shadow_edges_percent"], stated["level_ground_percent"]
    walls = stated.get("walls_percent")  # earlier files do not state it
    return float(edges) / 100, float(ground) / 100, None if walls is None else float(walls) / 100
