"""pbrt-v4's scene files, read by its published rules: what pbrt itself would understand.

The rules are those of the file format's documentation and of pbrt's own parser: how text falls
into tokens, which directives there are, what they take, before or after WorldBegin, which
parameters an implementation knows and of which type. Everything else is an error.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import OpenEXR

from sunsplit.core.export.octahedral import to_sphere

TOKEN = re.compile(
    r'(?P<space>[ \t\r\n]+)|(?P<comment>\#[^\r\n]*)|(?P<string>"(?:\\[bfnrt\\\'"]|[^"\\\n])*")'
    r'|(?P<bracket>[\[\]])|(?P<word>[^ \t\r\n"\[\]]+)'
)
ESCAPES = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t"}

NUMBERS = {
    "Scale": 3,
    "LookAt": 9,
    "Translate": 3,
    "Rotate": 4,
    "Transform": 16,
    "ConcatTransform": 16,
}
"""Directives that take so many numbers."""

PLAIN = ("WorldBegin", "AttributeBegin", "AttributeEnd", "Identity")

OPTIONS = ("Camera", "Film", "Sampler", "Integrator")
"""Before WorldBegin only; the others below after it only."""

KNOWN = {
    ("Camera", "perspective"): {"fov": "float"},
    ("Film", "rgb"): {"xresolution": "integer", "yresolution": "integer", "filename": "string"},
    ("Sampler", "zsobol"): {"pixelsamples": "integer", "seed": "integer"},
    ("Integrator", "path"): {"maxdepth": "integer", "lightsampler": "string"},
    ("LightSource", "distant"): {
        "from": "point3",
        "to": "point3",
        "L": "rgb",
        "scale": "float",
        "illuminance": "float",
    },
    ("LightSource", "infinite"): {"filename": "string", "scale": "float", "L": "rgb"},
    ("Material", "diffuse"): {"reflectance": "rgb"},
    ("Shape", "sphere"): {"radius": "float"},
    ("Shape", "trianglemesh"): {"P": "point3", "N": "normal", "indices": "integer"},
}
COUNTS = {"float": 1, "integer": 1, "string": 1, "rgb": 3, "point3": 3, "normal": 3}
MANY = ("P", "N", "indices")


@dataclass(frozen=True, eq=False)
class Statement:
    """A directive with its numbers or its kind and parameters; transform: from the statement's own
    space to the world, (4, 4). shown: it came after WorldBegin."""

    directive: str
    kind: str = ""
    values: tuple[float, ...] = ()
    parameters: dict[str, object] = field(default_factory=dict)
    transform: np.ndarray = field(default_factory=lambda: np.eye(4))
    shown: bool = False


def read_scene(path: Path) -> list[Statement]:
    """All statements of a scene's file and of those that it includes. Raises ValueError."""
    return list(_Reader(path.parent).statements(path, shown=False))


def read_lights(path: Path) -> list[Statement]:
    """The same of a file that is to be included after WorldBegin."""
    return list(_Reader(path.parent).statements(path, shown=True))


def tokens(text: str) -> list[str]:
    """Words, brackets and strings, these with their quotes. Raises ValueError."""
    found, at = [], 0
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            raise ValueError(f"no token: {text[at : at + 40]!r}")
        if match.lastgroup not in ("space", "comment"):
            found.append(match.group())
        at = match.end()
    return found


def _string(token: str) -> str:
    if token[0] != '"':
        raise ValueError(f"{token!r} is no string")
    return re.sub(r"\\(.)", lambda m: ESCAPES.get(m.group(1), m.group(1)), token[1:-1])


class _Reader:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.transform = np.eye(4)
        self.kept: list[np.ndarray] = []

    def statements(self, path: Path, shown: bool) -> Iterator[Statement]:
        rest = tokens(path.read_text(encoding="utf-8"))
        depth = len(self.kept)
        while rest:
            directive = rest.pop(0)
            if directive == "Include":
                yield from self.statements(self.folder / _string(rest.pop(0)), shown)
            elif directive in NUMBERS:
                yield self._moved(directive, _numbers(rest, NUMBERS[directive]), shown)
            elif directive in PLAIN:
                shown = self._plain(directive, shown)
                yield Statement(directive, shown=shown)
            else:
                yield self._made(directive, rest, shown)
        if len(self.kept) != depth:
            raise ValueError("AttributeBegin without its end")

    def _moved(self, directive: str, values: list[float], shown: bool) -> Statement:
        step = np.eye(4)
        if directive == "Scale":
            step = np.diag([*values, 1.0])
        elif directive == "Translate":
            step[:3, 3] = values
        elif directive in ("Transform", "ConcatTransform"):  # column by column
            step = np.reshape(values, (4, 4)).T
            if directive == "Transform":  # replaces what there was
                self.transform = np.eye(4)
        elif shown:
            raise ValueError(f"{directive} in the world is not looked at here")
        self.transform = self.transform @ step
        return Statement(directive, values=tuple(values), shown=shown)

    def _plain(self, directive: str, shown: bool) -> bool:
        if directive == "WorldBegin":
            if shown:
                raise ValueError("a second WorldBegin")
            self.transform = np.eye(4)
            return True
        if not shown:
            raise ValueError(f"{directive} before WorldBegin")
        if directive == "AttributeBegin":
            self.kept.append(self.transform)
        elif directive == "AttributeEnd":
            self.transform = self.kept.pop()
        return shown

    def _made(self, directive: str, rest: list[str], shown: bool) -> Statement:
        kind = _string(rest.pop(0))
        if (directive, kind) not in KNOWN:
            raise ValueError(f'{directive} "{kind}" is not known')
        if shown == (directive in OPTIONS):
            raise ValueError(f"{directive} on the wrong side of WorldBegin")
        parameters = dict(_parameters(rest, KNOWN[directive, kind]))
        return Statement(directive, kind, (), parameters, self.transform, shown)


def infinite_of(statements: list[Statement]) -> Statement:
    """The light around the scene. Raises StopIteration where there is none."""
    return next(s for s in statements if s.kind == "infinite")


def pixels_of(path: Path) -> np.ndarray:
    """Of a map, float64 (side, side, 3)."""
    with OpenEXR.File(str(path)) as file:
        return file.channels()["RGB"].pixels.astype(np.float64)


def irradiance(lights: Path, facing: np.ndarray) -> np.ndarray:
    """Of a plate, (3,), by a file's lights: each distant one, and each pixel of the map around.

    facing: unit normal in the file's axes.
    """
    statements = read_lights(lights)
    found = np.zeros(3)
    for light in (s for s in statements if s.kind == "distant"):
        to_light = light.parameters["from"] - light.parameters["to"]
        to_light = light.transform[:3, :3] @ to_light
        cosine = to_light @ facing / np.linalg.norm(to_light)
        found += max(cosine, 0) * light.parameters["L"]
    around = infinite_of(statements)
    radiance = pixels_of(lights.parent / around.parameters["filename"])
    side = len(radiance)
    places = (np.arange(side) + 0.5) / side
    turned = to_sphere(places[None, :], places[:, None]) @ around.transform[:3, :3].T
    cosines = np.maximum(turned @ facing, 0)
    return found + np.einsum("ijk,ij->k", radiance, cosines) * 4 * np.pi / side**2


def _numbers(rest: list[str], count: int) -> list[float]:
    bracketed = rest[0] == "["
    found = [rest.pop(0) for _ in range(count + 2 * bracketed)]
    if bracketed:
        if found[-1] != "]":
            raise ValueError(f"not {count} numbers: {found}")
        found = found[1:-1]
    return [float(value) for value in found]


def _parameters(rest: list[str], known: dict[str, str]) -> Iterator[tuple[str, object]]:
    while rest and rest[0][0] == '"':
        kind, name = _string(rest.pop(0)).split()
        if known.get(name) != kind:
            raise ValueError(f"{kind} {name} is no parameter here")
        values = [rest.pop(0)]
        if values[0] == "[":
            end = rest.index("]")
            values, rest[: end + 1] = rest[:end], []
        count = COUNTS[kind]
        if len(values) % count or (len(values) != count and name not in MANY):
            raise ValueError(f"{name} has {len(values)} values")
        yield name, _value(kind, values)


def _value(kind: str, values: list[str]) -> object:
    if kind == "string":
        return _string(values[0])
    made = np.array([int(v) if kind == "integer" else float(v) for v in values])
    if not np.isfinite(made).all():
        raise ValueError(f"{values} are no numbers")
    return made
