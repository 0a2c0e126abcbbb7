"""Lines, areas and words on the graphics card: the only part of the overlay that draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
    """What is drawn one over the other; made once, drawn as often as it stays the same."""

    def __init__(
        self, layers: Sequence[Lines | Areas], words: Sequence[Word] = (), size: float = 12
    ) -> None:
        layers = [*layers, _plates(words, EDGE * size)]
        self._parts = [_part(layer) for layer in layers if len(_points(layer))]
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


def size_of(text: str, size: float) -> tuple[float, float]:
    """Width and height of a text in pixels."""
    blf.size(0, size)
    return blf.dimensions(0, text)


def _plates(words: Sequence[Word], edge: float) -> Areas:
    """Rectangles behind words."""
    corners = np.array([(word.x, word.y, word.width, word.height) for word in words])
    corners = corners.reshape(-1, 4)
    low = corners[:, :2] - edge
    box = low[:, None] + _UNIT * (corners[:, None, 2:] + 2 * edge)
    return Areas(box.reshape(-1, 3, 2), np.tile(PLATE, (len(box) * 2, 1)))


def _points(layer: Lines | Areas) -> Floats:
    return layer.pieces if isinstance(layer, Lines) else layer.triangles


def _part(
    layer: Lines | Areas,
) -> tuple[gpu.types.GPUShader, gpu.types.GPUBatch, Colour | None, float | None]:
    points = _points(layer).reshape(-1, 2)
    attributes = {"pos": np.pad(points, ((0, 0), (0, 1))).astype(np.float32)}
    if isinstance(layer, Areas):
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        attributes["color"] = layer.colour.repeat(3, axis=0).astype(np.float32)
        return shader, batch_for_shader(shader, "TRIS", attributes), None, None
    if isinstance(layer.colour, tuple):
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        return shader, batch_for_shader(shader, "LINES", attributes), layer.colour, layer.width
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    attributes["color"] = layer.colour.reshape(-1, 4).astype(np.float32)
    return shader, batch_for_shader(shader, "LINES", attributes), None, layer.width


_UNIT = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)], np.float64)
"""A square as two triangles."""
