"""A whole conversion as files: written together, and added up again from what was written."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..account import Account
from ..conversion import Conversion
from ..errors import UnusableInput
from ..suspicions import map_warnings
from . import exr, lights_json, samples_json
from .atomic import written_together
from .belonging import read_named, read_together, sha256

ENDINGS = {
    "residual": "residual.exr",
    "samples": "samples.json",
    "preview": "preview.png",
    "lights": "lights.json",
}
"""Of a conversion's files, in the order in which they get their names."""


@dataclass(frozen=True)
class WrittenFiles:
    """Where a conversion lies on disk; None for what was not asked for."""

    lights: Path
    residual: Path | None
    samples: Path | None
    preview: Path | None
    removed: tuple[Path, ...] = ()
    """Files of an older conversion of this name that this one has not."""


def save(conversion: Conversion, folder: str | Path, preview: bool = False) -> WrittenFiles:
    """Write `<name>.lights.json`, `.residual.exr`, for a Voronoi map its `.samples.json` and, if
    asked for, `.preview.png`.

    All of them appear, or none and the older ones stay. Where an older conversion of this name is
    replaced, those of its files that this one has not go away. Raises CannotWrite.
    """
    folder = Path(folder)
    stem = conversion.environment.name
    wanted = {
        "residual": conversion.residual is not None,
        "samples": conversion.samples is not None,
        "preview": preview,
        "lights": True,
    }
    paths = {kind: folder / f"{stem}.{ENDINGS[kind]}" for kind in ENDINGS if wanted[kind]}
    removed: list[Path] = []

    def outdated() -> list[str]:
        removed.extend(_of_older(folder, stem, set(paths.values())))
        return [path.name for path in removed]

    with written_together(folder, [path.name for path in paths.values()], outdated) as drafts:
        _write(conversion, dict(zip(paths, drafts, strict=True)))
    return WrittenFiles(**{kind: paths.get(kind) for kind in ENDINGS}, removed=tuple(removed))


def _of_older(folder: Path, stem: str, new: set[Path]) -> list[Path]:
    """Files of an older conversion that would be taken for parts of the new one.

    Only beside a document of ours: others' files of such names are left alone.
    """
    try:
        lights_json.read_document(folder / f"{stem}.lights.json")
    except UnusableInput:
        return []
    older = (folder / f"{stem}.{ending}" for ending in ENDINGS.values())
    return [path for path in older if path not in new and path.is_file()]


def _write(conversion: Conversion, drafts: dict[str, Path]) -> None:
    """Write each file of a conversion to its draft; those that others name before these."""
    document = describe(conversion)
    if conversion.residual is not None:
        if conversion.levelled is None:
            exr.write(drafts["residual"], conversion.residual)
        else:
            half = exr.halved(conversion.residual) is not None
            written = exr.write_strips(drafts["residual"], conversion.levelled, half)
            document |= _stated(replace(conversion.account, residual=written))
        document["residual"]["sha256"] = sha256(drafts["residual"])
    if conversion.samples is not None:
        samples_json.write(drafts["samples"], conversion.samples, document["residual"])
        document["residual"]["samples_sha256"] = sha256(drafts["samples"])
    if "preview" in drafts:
        from .preview import draw_preview  # and Pillow with it

        draw_preview(conversion).save(drafts["preview"])
    lights_json.write(drafts["lights"], document)


def describe(conversion: Conversion) -> dict[str, Any]:
    """The document of `<name>.lights.json`, but for the SHA-256 of the files that it names."""
    environment, account = conversion.environment, conversion.account
    walls = conversion.standing_error
    residual = None
    if conversion.residual is not None:
        height, width = conversion.residual.shape[:2]
        if conversion.levelled:
            height, width = conversion.levelled.height, conversion.levelled.width
        name = f"{environment.name}.{ENDINGS['residual']}"
        kind = conversion.settings.residual
        residual = {"file": name, "kind": kind, "width": width, "height": height}
    if conversion.samples is not None:
        residual["samples"] = f"{environment.name}.{ENDINGS['samples']}"
    chosen = conversion.settings
    settings = chosen.as_dict() | {
        "lights": chosen.lights or len(conversion.suns),
        "tolerance": chosen.allowed_error(account.share),
        "share": conversion.strata.share,
        "threshold": conversion.strata.threshold,
        "fill": conversion.settings.filled,
        "residual": conversion.settings.residual if conversion.residual is not None else "none",
    }
    return {
        "source": {
            "file": environment.file,
            "width": environment.own_width,
            "height": environment.own_height,
            "sha256": environment.sha256,
            "repaired_pixels": environment.repairs.pixels,
        },
        "settings": settings,
        "suns": [lights_json.sun_as_dict(sun) for sun in conversion.suns],
        "residual": residual,
        **_stated(account),
        "predicted_error": {
            "shadow_edges_percent": 100 * conversion.predicted_error,
            "level_ground_percent": 100 * conversion.ground_error,
            "walls_percent": None if walls is None else 100 * walls,
        },
        "notes": [*map_warnings(environment), *conversion.notes],
    }


def _stated(account: Account) -> dict[str, Any]:
    return {"account": lights_json.account_as_dict(account)}


def account_of_files(lights: str | Path) -> Account:
    """The account added up anew from the files: suns from the JSON, pixels from the EXR.

    Raises UnusableInput, also when the EXR is not the one that the JSON was written with.
    """
    lights = Path(lights)
    return read_together(lights, lambda: _account(lights))


def _account(lights: Path) -> Account:
    document, suns, stated = lights_json.read(lights)
    residual = np.zeros(3)
    if stored := document["residual"]:
        file, sum_of_file = lights_json.named_file(lights, stored)
        residual = read_named(file, sum_of_file, lights.name, exr.light_of)
    given = np.sum([sun.scalar_irradiance for sun in suns], axis=0) if suns else np.zeros(3)
    return Account(stated.source, given, residual)
