"""The light of a conversion, from wherever it is taken, as every format gets it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..conversion import Conversion
from ..environment import scalar_irradiance, whole_part
from ..files.written import WrittenConversion, read_written
from ..reduction import narrowed
from ..suns import Sun

Floats = NDArray[np.float64]

WIDEST = 8192
"""Pixels of the widest map that is exported: 400 MB as float32. A wider one is narrowed."""


@dataclass(frozen=True, eq=False)
class Skylight:
    """Suns, and a map around the scene.

    name: what the files are called by. suns: brightest first, in the scene's axes (right-handed,
    Z up). radiance: of the map, float32 (height, width, 3) in the layout of `sphere`, or None.
    has_cells: it is a Voronoi map, between whose pixels nothing is to be blended. turn: rotation,
    (3, 3), from directions in the map to directions in the scene.
    """

    name: str
    suns: tuple[Sun, ...]
    radiance: NDArray[np.float32] | None
    has_cells: bool
    turn: Floats

    @property
    def scalar_irradiance(self) -> Floats:
        """Of suns and map together, (3,): what every export must keep."""
        total = np.sum([sun.scalar_irradiance for sun in self.suns] or [np.zeros(3)], axis=0)
        return total if self.radiance is None else total + scalar_irradiance(self.radiance)

    def turned(self, rotation: Floats) -> Skylight:
        """All of it turned about the scene's origin by a rotation, (3, 3)."""
        suns = tuple(replace(sun, to_light=rotation @ sun.to_light) for sun in self.suns)
        return replace(self, suns=suns, turn=rotation @ self.turn)


def skylight_of(conversion: Conversion) -> Skylight:
    """Of a conversion that is in memory."""
    radiance, pixels = conversion.residual, conversion.levelled
    if pixels is not None:
        radiance = narrowed(pixels, whole_part(pixels.width, WIDEST))
    has_cells = conversion.settings.residual == "voronoi"
    name = conversion.environment.name
    return Skylight(name, tuple(conversion.suns), radiance, has_cells, np.eye(3))


def read_skylight(lights: str | Path) -> Skylight:
    """Of a conversion's files. lights: its `<name>.lights.json`. Raises UnusableInput."""
    lights = Path(lights)
    written = read_written(lights, WIDEST)
    return _of_written(lights.name.removesuffix(".json").removesuffix(".lights"), written)


def _of_written(name: str, written: WrittenConversion) -> Skylight:
    return Skylight(name, written.suns, written.radiance, written.has_cells, np.eye(3))
