"""`<stem>.samples.json`: positions of a Voronoi map's samples and the light of their cells."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from .. import sphere
from ..errors import UnusableInput
from ..samples import MapOfSamples
from . import exr
from .lights_json import AXES

FORMAT = "sunsplit.samples"
VERSION = 1


def write(path: Path, samples: MapOfSamples, map_name: str) -> None:
    """Write the list; the Voronoi map itself lies beside it under `map_name`."""
    height, width = samples.radiance.shape[:2]
    u, v = sphere.to_image(samples.sites)
    document = {
        "format": FORMAT,
        "version": VERSION,
        "axes": AXES,
        "map": {"file": map_name, "width": width, "height": height},
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


def read(path: str | Path) -> MapOfSamples:
    """Samples and their map, as they were written. Raises UnusableInput."""
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UnusableInput(f"{path} does not exist.") from None
    except (OSError, ValueError) as error:
        raise UnusableInput(f"{path.name} is not readable JSON ({error}).") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise UnusableInput(f"{path.name} is no list of samples: its format is missing.")
    if document.get("version") != VERSION:
        raise UnusableInput(
            f"{path.name} has version {document.get('version')}; this Sunsplit reads {VERSION}."
        )
    try:
        samples, name = document["samples"], document["map"]["file"]
        sites = np.array([entry["to_light"] for entry in samples], float).reshape(-1, 3)
        flux = np.array([entry["scalar_irradiance"] for entry in samples], float).reshape(-1, 3)
        area = np.array([entry["area"] for entry in samples], float)
    except (KeyError, TypeError, ValueError) as error:
        raise UnusableInput(f"{path.name} is damaged: {error!r}.") from error
    if not (path.parent / name).exists():
        raise UnusableInput(f"{path.parent / name} is missing: convert the map again.")
    radiance = exr.read(path.parent / name)[0].astype(np.float32)
    return MapOfSamples(sites, flux, area, radiance)
