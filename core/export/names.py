"""What an export's files are called."""

from __future__ import annotations

from dataclasses import dataclass
from unicodedata import category

from ..errors import UnusableInput
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


def check_text(name: str, program: str, also: tuple[str, ...] = ()) -> None:
    """Raise UnusableInput for a name that no text file can hold: with control characters, or what
    was no Unicode. also: what a program's files cannot hold besides."""
    if shown(name) == name and not any(part in name for part in also):
        return
    raise UnusableInput(
        f"{program} cannot refer to files named {name!r}: rename the conversion, with letters, "
        "digits and spaces."
    )


def shown(name: str) -> str:
    """A name as text in a line: control characters and bytes that are no text are spelt out."""
    return "".join(
        char.encode("unicode_escape").decode() if category(char) in ("Cc", "Cs") else char
        for char in name
    )
