"""`<stem>.samples.json`: positions of a Voronoi map's samples and the light of their cells."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .. import sphere
from ..errors import UnusableInput
from ..pixels import whole
from ..samples import MapOfSamples
from . import exr
from .belonging import read_named, read_together
from .lights_json import AXES, DAMAGE, named_file, numbers, read_document

FORMAT = "sunsplit.samples"
VERSION = 1


def write(path: Path, samples: MapOfSamples, residual: dict[str, Any]) -> None:
    """Write the list. residual: what `lights_json` says of the Voronoi map, its SHA-256 too."""
    height, width = samples.radiance.shape[:2]
    u, v = sphere.to_image(samples.sites)
    document = {
        "format": FORMAT,
        "version": VERSION,
        "axes": AXES,
        "map": {name: residual[name] for name in ("file", "width", "height", "sha256")},
        "samples": [
            {"to_light": site, "position": position, "scalar_irradiance": flux, "area": area}
            for site, position, flux, area in zip(
                samples.sites.tolist(),
                np.stack([u * width, v * height], axis=-1).tolist(),
                samples.flux.tolist(),
                samples.area.tolist(),
                strict=True,
            )
        ],
    }
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def read_samples(path: str | Path) -> MapOfSamples:
    """Samples and their map, as they were written. Raises UnusableInput."""
    path = Path(path)
    return read_together(path, lambda: _read(path))


def _read(path: Path) -> MapOfSamples:
    document = read_document(path, FORMAT, VERSION)
    try:
        samples = document["samples"]
        sites = numbers([entry["to_light"] for entry in samples], len(samples), 3)
        flux = numbers([entry["scalar_irradiance"] for entry in samples], len(samples), 3)
        area = numbers([entry["area"] for entry in samples], len(samples))
        image, stated = named_file(path, document["map"])
        shape = int(document["map"]["height"]), int(document["map"]["width"]), 3
    except DAMAGE as error:
        raise UnusableInput(f"{path.name} is damaged: {error!r}.") from error
    radiance = read_named(image, stated, path.name, lambda file: whole(exr.read(file)[0]))
    if radiance.shape != shape:
        raise UnusableInput(f"{image.name} is another map than {path.name} says.")
    return MapOfSamples(sites, flux, area, radiance)
