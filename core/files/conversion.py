"""A whole conversion as files: written together, and added up again from what was written."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..account import Account
from ..conversion import Conversion
from ..errors import UnusableInput
from . import exr, lights_json, samples_json
from .atomic import written_together
from .preview import draw_preview


@dataclass(frozen=True)
class WrittenFiles:
    """Where a conversion lies on disk; None for what was not asked for."""

    lights: Path
    residual: Path | None
    samples: Path | None
    preview: Path | None


def save(conversion: Conversion, folder: str | Path, preview: bool = False) -> WrittenFiles:
    """Write `<name>.lights.json`, `.residual.exr`, for a Voronoi map its `.samples.json` and, if
    asked for, `.preview.png`.

    All of them appear, or none and the older ones stay. Raises CannotWrite.
    """
    folder = Path(folder)
    stem = conversion.environment.name
    names = {"lights": f"{stem}.lights.json"}
    if conversion.residual is not None:
        names["residual"] = f"{stem}.residual.exr"
    if conversion.samples is not None:
        names["samples"] = f"{stem}.samples.json"
    if preview:
        names["preview"] = f"{stem}.preview.png"
    with written_together(folder, list(names.values())) as drafts:
        draft = dict(zip(names, drafts, strict=True))
        account = conversion.account
        if conversion.levelled is not None:
            half = exr.halved(conversion.residual) is not None
            written = exr.write_strips(draft["residual"], conversion.levelled, half)
            account = replace(account, residual=written)
        elif conversion.residual is not None:
            exr.write(draft["residual"], conversion.residual)
        lights_json.write(draft["lights"], describe(conversion) | _stated(account))
        if conversion.samples is not None:
            samples_json.write(draft["samples"], conversion.samples, names["residual"])
        if preview:
            draw_preview(conversion).save(draft["preview"])
    paths = {kind: folder / name for kind, name in names.items()}
    return WrittenFiles(**{kind.name: paths.get(kind.name) for kind in fields(WrittenFiles)})


def describe(conversion: Conversion) -> dict[str, Any]:
    """The document of `<name>.lights.json`."""
    environment, account = conversion.environment, conversion.account
    residual = None
    if conversion.residual is not None:
        height, width = conversion.residual.shape[:2]
        if conversion.levelled:
            height, width = conversion.levelled.height, conversion.levelled.width
        name = f"{environment.name}.residual.exr"
        kind = conversion.settings.residual
        residual = {"file": name, "kind": kind, "width": width, "height": height}
    if conversion.samples is not None:
        residual["samples"] = f"{environment.name}.samples.json"
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
        },
        "notes": [*environment.warnings, *conversion.notes],
    }


def _stated(account: Account) -> dict[str, Any]:
    return {"account": lights_json.account_as_dict(account)}


def account_of_files(lights: str | Path) -> Account:
    """The account added up anew from the files: suns from the JSON, pixels from the EXR."""
    lights = Path(lights)
    document, suns, stated = lights_json.read(lights)
    residual = np.zeros(3)
    if document["residual"]:
        file = lights.parent / document["residual"]["file"]
        if not file.exists():
            raise UnusableInput(f"{file} is missing: convert the map again.")
        residual = exr.light_of(file)
    given = np.sum([sun.scalar_irradiance for sun in suns], axis=0) if suns else np.zeros(3)
    return Account(stated.source, given, residual)
