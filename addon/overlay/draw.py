"""Lines, areas and words on the graphics card: the only part of the overlay that draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Colour = tuple[float, float, float, float]

PLATE: Colour = (0.0, 0.0, 0.0, 0.7)
"""Behind words: light letters could not be read on a bright sky."""

EDGE = 0.35
"""How far a plate reaches beyond its word, as a part of the letters' size."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Pieces of lines: pixels, or whatever the matrix makes pixels of, (m, 2, 2); one colour, or
    one for each end, (m, 2, 4); width in pixels."""

    pieces: Floats
    colour: Colour | Floats
    width: float


@dataclass(frozen=True, eq=False)
class Areas:
    """Triangles (m, 3, 2), each of one colour, (m, 4)."""

    triangles: Floats
    colour: Floats


@dataclass(frozen=True)
class Word:
    """A text with its lower left corner, width and height in pixels."""

    text: str
    x: float
    y: float
    width: float
    height: float
    colour: Colour


class Drawing:
    """What is drawn one over the other, lines below areas below words; made once, drawn as often
    as it stays the same."""

    def __init__(
        self, layers: Sequence[Lines | Areas], words: Sequence[Word] = (), size: float = 12
    ) -> None:
        lines = [layer for layer in layers if isinstance(layer, Lines) and len(layer.pieces)]
        areas = [layer for layer in layers if isinstance(layer, Areas)]
        areas = _together([*areas, _plates(words, EDGE * size)])
        self._parts = [_lines(layer) for layer in lines]
        if len(areas.triangles):
            self._parts.append(_areas(areas))
        self._words, self._size = words, size

    def draw(self) -> None:
        """Into the region that Blender draws at the moment."""
        gpu.state.blend_set("ALPHA")
        viewport = gpu.state.viewport_get()[2:]
        for shader, batch, colour, width in self._parts:
            shader.bind()
            if width is not None:
                shader.uniform_float("viewportSize", viewport)
                shader.uniform_float("lineWidth", width)
            if colour is not None:
                shader.uniform_float("color", colour)
            batch.draw(shader)
        gpu.state.blend_set("NONE")
        if self._words:
            self._write()

    def _write(self) -> None:
        blf.size(0, self._size)
        for word in self._words:
            blf.color(0, *word.colour)
            blf.position(0, word.x, word.y, 0)
            blf.draw(0, word.text)


class Kept:
    """What was drawn last in each region, so that nothing is made again that stays the same."""

    MOST = 16

    def __init__(self) -> None:
        self._drawings: dict[int, tuple[object, Drawing]] = {}

    def drawing(self, region: int, key: object, make: Callable[[], Drawing]) -> Drawing:
        """What `make` gives; it is called where the region's key differs from the last."""
        if self._drawings.get(region, (None,))[0] != key:
            self._drawings.pop(region, None)
            while len(self._drawings) >= self.MOST:  # regions that are no more
                del self._drawings[next(iter(self._drawings))]
            self._drawings[region] = key, make()
        return self._drawings[region][1]

    def forget(self) -> None:
        self._drawings.clear()


def sizes_of(texts: Sequence[str], size: float) -> Floats:
    """Width and height of texts in pixels, (n, 2)."""
    return np.array([_size_of(text, size) for text in texts]).reshape(-1, 2)


@lru_cache(1024)
def _size_of(text: str, size: float) -> tuple[float, float]:
    blf.size(0, size)
    return blf.dimensions(0, text)


def _plates(words: Sequence[Word], edge: float) -> Areas:
    """Rectangles behind words."""
    corners = np.array([(word.x, word.y, word.width, word.height) for word in words])
    corners = corners.reshape(-1, 4)
    low = corners[:, :2] - edge
    box = low[:, None] + _UNIT * (corners[:, None, 2:] + 2 * edge)
    return Areas(box.reshape(-1, 3, 2), np.tile(PLATE, (len(box) * 2, 1)))


def _together(areas: Sequence[Areas]) -> Areas:
    triangles = np.concatenate([layer.triangles for layer in areas])
    return Areas(triangles, np.concatenate([layer.colour for layer in areas]))


_Part = tuple[gpu.types.GPUShader, gpu.types.GPUBatch, Colour | None, float | None]


def _areas(areas: Areas) -> _Part:
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    colour = areas.colour.repeat(3, axis=0).astype(np.float32)
    attributes = {"pos": _positions(areas.triangles), "color": colour}
    return shader, batch_for_shader(shader, "TRIS", attributes), None, None


def _lines(lines: Lines) -> _Part:
    attributes = {"pos": _positions(lines.pieces)}
    if isinstance(lines.colour, tuple):
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        return shader, batch_for_shader(shader, "LINES", attributes), lines.colour, lines.width
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    attributes["color"] = lines.colour.reshape(-1, 4).astype(np.float32)
    return shader, batch_for_shader(shader, "LINES", attributes), None, lines.width


def _positions(points: Floats) -> NDArray[np.float32]:
    """These shaders want a third coordinate."""
    flat = points.reshape(-1, 2)
    positions = np.zeros((len(flat), 3), np.float32)
    positions[:, :2] = flat
    return positions


_UNIT = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)], np.float64)
"""A square as two triangles."""
