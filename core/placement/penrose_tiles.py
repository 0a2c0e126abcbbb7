"""Penrose tiling by subdivision, with Fibonacci numbers for its points.

Ostromoukhov, Donohue, Jodoin: Fast Hierarchical Importance Sampling with Blue Noise Properties,
SIGGRAPH 2004. Half rhombs of four kinds (c, d thin; e, f fat) are cut into smaller ones; now and
then a cut leaves a point (kinds a and b of the paper). The cuts write a Fibonacci code, and its
value orders the points: those of a value below any V are spread evenly over the plane.

Positions are complex numbers x + iy. Directions are counted in steps of 18 degrees from +y to -x.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

PHI = (1 + math.sqrt(5)) / 2

DEEPEST = 45
"""Level at which the value of a code, below F(2 * 45 + 2), still fits into 64 bits."""

STEP = tuple(cmath.exp(0.1j * math.pi * k) for k in range(20))
"""Turns by k * 18 degrees, as factors."""

UNIT = np.array([1j * turn for turn in STEP])
"""The unit vector of each direction, complex (20,)."""

DENSITY = math.sqrt(5) / (PHI**2 * (PHI * math.sin(math.radians(72)) + math.sin(math.radians(36))))
"""Points of a value below V in an area of s^2: DENSITY * V, with s the scale of the root."""


def _fibonacci(last: int) -> tuple[int, ...]:
    numbers = [0, 1]
    while len(numbers) <= last:
        numbers.append(numbers[-1] + numbers[-2])
    return tuple(numbers)


FIBONACCI = _fibonacci(2 * DEEPEST + 3)
"""F(0) = 0, F(1) = F(2) = 1 and so on, as exact integers."""

CORNERS = {
    "c": (0, 1, PHI * STEP[4]),
    "d": (0, 1, PHI * STEP[4]),
    "e": (0, PHI**2, PHI * STEP[2]),
    "f": (0, PHI**2, PHI * STEP[2]),
}
"""The corners of each triangle of scale 1 in its own frame: from the first, along its direction."""


@dataclass(frozen=True)
class _Child:
    """A tile that a cut leaves: its kind, its origin in the parent's frame and scale, its turn
    against the parent, and the new digit of its code: 0, 1 for F(2n), 2 for F(2n + 1)."""

    kind: str
    origin: complex
    turn: int
    digit: int

    def corner(self, number: int) -> complex:
        """Corner 0, 1 or 2 of this child, in the parent's frame."""
        return self.origin + STEP[self.turn] / PHI * CORNERS[self.kind][number]

    @property
    def steps(self) -> NDArray[np.complex128]:
        """From the parent's origin to this one's, for each direction of the parent, (20,)."""
        return np.array([complex(unit) * self.origin for unit in UNIT])


def _rules() -> dict[str, tuple[_Child, ...]]:
    """How each triangle is cut; the kind "a" is a point."""
    _, p2, p3 = CORNERS["c"]
    f, c = _Child("f", p3, 14, 0), _Child("c", p2, 6, 2)
    rules = {"c": (f, c, _Child("a", f.corner(2), 1, 2))}
    e = _Child("e", p2, 6, 0)
    rules["d"] = (e, _Child("d", e.corner(2), 14, 2))
    _, p2, p3 = CORNERS["e"]
    c, e, f = _Child("c", p3, 12, 2), _Child("e", p2, 8, 1), _Child("f", 0, 0, 0)
    rules["e"] = (c, e, f, _Child("a", c.corner(1), 7, 2))
    f = _Child("f", p3, 12, 1)
    e = _Child("e", f.corner(2), 0, 0)
    rules["f"] = (f, e, _Child("d", e.corner(2), 8, 2), _Child("a", f.corner(2), 15, 1))
    return rules


_RULES = {
    kind: tuple((child, child.steps) for child in children) for kind, children in _rules().items()
}

_FIRST_POINT = {"c": 1, "d": 3, "e": 1, "f": 0}
"""A triangle that is cut at level n leaves no point of a value below its own + F(2n + this)."""

_WIDTH = {"c": PHI, "d": PHI, "e": PHI**2, "f": PHI**2}
"""The longest side of a triangle of scale 1: no box around it is wider or higher."""


def _boxes(kind: str) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """The least and the greatest x and y of a triangle of scale 1 by direction, two of (20,)."""
    corners = UNIT[:, None] * np.array(CORNERS[kind])
    low = corners.real.min(axis=1) + 1j * corners.imag.min(axis=1)
    return low, corners.real.max(axis=1) + 1j * corners.imag.max(axis=1)


_BOXES = {kind: _boxes(kind) for kind in CORNERS}


@dataclass(frozen=True, eq=False)
class Tiles:
    """Tiles of one kind and level.

    position: of the origin, complex (n,). direction: 0 to 19, int8 (n,). value: of the code,
    int64 (n,). level: at which each one came to be, int8 (n,).
    """

    position: NDArray[np.complex128]
    direction: NDArray[np.int8]
    value: NDArray[np.int64]
    level: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.value)

    def __getitem__(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> Tiles:
        return Tiles(*(getattr(self, field.name)[index] for field in fields(self)))

    @classmethod
    def joined(cls, parts: list[Tiles]) -> Tiles:
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    @classmethod
    def empty(cls) -> Tiles:
        none = np.empty(0, np.int8)
        return cls(np.empty(0, np.complex128), none, np.empty(0, np.int64), none)

    def box(self, kind: str, scale: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Corners of the upright boxes around the triangles, two of (n,)."""
        low, high = (scale * corner for corner in _BOXES[kind])
        return self.position + low[self.direction], self.position + high[self.direction]

    def child(self, child: _Child, steps: NDArray[np.complex128], level: int) -> Tiles:
        digit = (0, FIBONACCI[2 * level], FIBONACCI[2 * level + 1])[child.digit]
        return Tiles(
            self.position + steps[self.direction],
            (self.direction + np.int8(child.turn)) % np.int8(20),
            self.value + digit,
            np.full(len(self), level, np.int8),
        )


Bound = Callable[[NDArray[np.complex128], NDArray[np.complex128], float], NDArray[np.float64]]
"""From the corners of boxes, (n,), and their greatest width to what a box reaches, (n,)."""


def subdivide(scale: float, root: complex, reach: Bound) -> list[Tiles]:
    """All points whose value is below what the box around any triangle with them reaches.

    scale: of the root, a triangle f along +x from `root`. No triangle is left whole that may
    hold such a point. Returns the points of each level.
    """
    start = np.zeros(1, np.int8)
    tiles = {"f": Tiles(np.array([root]), start + np.int8(15), np.zeros(1, np.int64), start)}
    points = []
    for level in range(1, DEEPEST + 1):
        parts: dict[str, list[Tiles]] = {kind: [] for kind in "acdef"}
        for kind, parents in tiles.items():
            most = reach(*parents.box(kind, scale), scale * _WIDTH[kind])
            first = FIBONACCI[2 * level + _FIRST_POINT[kind]]
            parents = parents[most > parents.value + float(first)]
            for child, steps in _RULES[kind] if len(parents) else ():
                parts[child.kind].append(parents.child(child, scale * steps, level))
        points += parts.pop("a")
        tiles = {kind: Tiles.joined(some) for kind, some in parts.items() if some}
        scale /= PHI
    return points
