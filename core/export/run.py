"""Write a conversion as files of another renderer: the whole way on one screen."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

from ..conversion import Conversion
from ..errors import UnusableInput
from ..files import exr
from ..files.atomic import written_together
from .made import Made
from .settings import ExportSettings
from .skylight import Skylight, read_skylight, skylight_of


@dataclass(frozen=True)
class ExportedFiles:
    """lights: for one's own scene. scene: one that renders at once. map: of the surroundings, or
    None. axes: in words. losses: what the format cannot carry, in sentences."""

    lights: Path
    scene: Path
    map: Path | None
    axes: str
    losses: tuple[str, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        return tuple(path for path in (self.lights, self.scene, self.map) if path)


def export_conversion(
    source: str | Path | Conversion | Skylight, folder: str | Path, settings: ExportSettings
) -> ExportedFiles:
    """Write the light of a conversion for another renderer, with a small scene to try it in.

    source: a conversion, or its `<name>.lights.json`. All files appear, or none and older ones
    stay. Raises UnusableInput, CannotWrite.
    """
    made = made_for(_skylight(source), settings)
    folder, names = Path(folder), made.names
    wanted = [names.lights, names.scene, *([names.map] if made.radiance is not None else [])]

    def outdated() -> list[str]:
        """A map of an older export of this name would be taken for a part of this one."""
        return [name for name in (names.map,) if name not in wanted and (folder / name).is_file()]

    with written_together(folder, wanted, outdated) as drafts:
        for draft, content in zip(drafts, (made.lights, made.scene), strict=False):
            content = content if isinstance(content, bytes) else content.encode("utf-8")
            draft.write_bytes(content)
        if made.radiance is not None:
            exr.write(drafts[2], made.radiance)
    path_of_map = folder / names.map if made.radiance is not None else None
    lights, scene = folder / names.lights, folder / names.scene
    return ExportedFiles(lights, scene, path_of_map, made.axes.name, made.losses)


def made_for(sky: Skylight, settings: ExportSettings) -> Made:
    """What a format makes of a sky. Raises UnusableInput where what it takes is not installed."""
    _check(sky)
    module = import_module(f".{settings.format}", __package__)
    return getattr(module, f"made_for_{settings.format}")(sky, settings)


def _check(sky: Skylight) -> None:
    """Raise UnusableInput for what is no light; files of conversions are checked when read."""
    parts = [(sun.to_light, sun.irradiance, sun.scalar_irradiance) for sun in sky.suns]
    given = [part for sun in parts for part in sun[1:]]
    numbers = [sky.turn, *(sun[0] for sun in parts)]
    if sky.radiance is not None:
        given.append(sky.radiance)
    if not all(np.isfinite(part).all() for part in (*numbers, *given)):
        raise UnusableInput(f"The light of {sky.name} is not finite: it cannot be exported.")
    if any((part < 0).any() for part in given):
        raise UnusableInput(
            f"The light of {sky.name} is negative in places: there is no such light."
        )


def _skylight(source: str | Path | Conversion | Skylight) -> Skylight:
    if isinstance(source, Skylight):
        return source
    return skylight_of(source) if isinstance(source, Conversion) else read_skylight(source)
