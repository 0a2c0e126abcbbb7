"""What a user can choose about an export."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from ..settings import BadSetting

Format = Literal["pbrt", "mitsuba", "povray", "usd", "gltf"]
Up = Literal["usual", "y", "z"]
Discs = Literal["auto", "lights", "map"]
Reader = Literal["usdlux", "blender"]

LUMENS_PER_WATT = 683.0
"""What one watt of green light (555 nm) is by definition of the candela; Blender's exporters and
importers count all of a lamp's light so."""


@dataclass(frozen=True)
class ExportSettings:
    """format: whose files. up: the axis that points up; "usual" is what the format's users expect.
    discs: what becomes of a sun with a width where the format has no such light: "lights", many
    narrow ones; "map", a disc painted into the map; "auto", the former for narrow suns and the
    latter for wide ones. lux: of glTF, for a unit of irradiance. reader: of USD, "usdlux", whoever
    follows its specification, or "blender", whose importer does not.

    Raises BadSetting.
    """

    format: Format
    up: Up = "usual"
    discs: Discs = "auto"
    lux: float = LUMENS_PER_WATT
    reader: Reader = "usdlux"

    def __post_init__(self) -> None:
        kinds = {"format": Format, "up": Up, "discs": Discs, "reader": Reader}
        for name, kind in kinds.items():
            value, known = getattr(self, name), get_args(kind)
            if value not in known:
                raise BadSetting(f"{name} must be one of {', '.join(known)}, not {value!r}.")
        if not 0 < self.lux < float("inf"):
            raise BadSetting(f"lux must be a number above 0, not {self.lux!r}.")
        if self.format == "gltf" and self.up == "z":
            raise BadSetting("glTF is Y up by its own rules: up must be usual or y.")
