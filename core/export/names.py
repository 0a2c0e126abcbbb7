"""What an export's files are called."""

from __future__ import annotations

from dataclasses import dataclass

from .settings import Format


@dataclass(frozen=True)
class Names:
    """Of the files of an export. lights: for one's own scene. scene: one that renders at once. map:
    what surrounds it."""

    lights: str
    scene: str
    map: str


ENDINGS: dict[Format, Names] = {
    "pbrt": Names("lights.pbrt", "scene.pbrt", "pbrt.exr"),
    "mitsuba": Names("lights.xml", "scene.xml", "mitsuba.exr"),
    "povray": Names("lights.inc", "scene.pov", "povray.exr"),
    "usd": Names("lights.usda", "scene.usda", "usd.exr"),
    "gltf": Names("lights.gltf", "scene.gltf", "gltf.exr"),
}
"""Each format has its own, so that several exports may lie in one folder, a conversion too."""


def names_of(kind: Format, name: str) -> Names:
    """Of a sky of this name."""
    endings = ENDINGS[kind]
    return Names(*(f"{name}.{end}" for end in (endings.lights, endings.scene, endings.map)))
