"""What a region of the screen shows, and shapes on it: plain functions of numbers.

Pixels count from the lower left corner of a region. Matrices are Blender's: they act on columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

IN_FRONT = 0.02
"""Cosine of the angle to where the view looks, about, from which on a direction is in front: what
is farther aside would lie a hundred times the region's width away."""

GLOBE = 0.36
"""Radius of the globe of directions in an orthographic view, as a part of the region's shorter
side."""

SPACE = 5.0
"""Pixels that labels are apart, and from the frame."""


@dataclass(frozen=True)
class Frame:
    """The part of a region that nothing covers, pixels."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def middle(self) -> Floats:
        return np.array([self.left + self.right, self.bottom + self.top]) / 2

    def holds(self, places: Floats) -> NDArray[np.bool_]:
        """Which of some places, (n, 2), lie inside."""
        x, y = places.T
        return (self.left <= x) & (x <= self.right) & (self.bottom <= y) & (y <= self.top)

    def shrunk(self, margin: float) -> Frame:
        return Frame(
            self.left + margin, self.bottom + margin, self.right - margin, self.top - margin
        )


@dataclass(frozen=True, eq=False)
class View:
    """What a 3D view shows.

    matrix: from the world to homogeneous clip space, (4, 4). width, height: of the region, pixels.
    frame: of it that can be seen. perspective: or else orthographic.
    """

    matrix: Floats
    width: float
    height: float
    frame: Frame
    perspective: bool

    def on_screen(self, clip: Floats) -> Floats:
        """Pixels of points in clip space, (..., 4), in front of the view."""
        return (clip[..., :2] / clip[..., 3:] + 1) / 2 * (self.width, self.height)


def globe(view: View) -> tuple[Floats, float]:
    """Centre and radius in pixels of the globe of an orthographic view."""
    frame = view.frame
    shorter = min(frame.right - frame.left, frame.top - frame.bottom)
    return frame.middle, GLOBE * max(shorter, 0)


def ray_in_view(pivot: Floats, to_light: Floats, view: View, behind: float) -> Floats | None:
    """Where the light of a sun comes from: from a point in the world, (3,), towards the sun, both
    ends in pixels, (2, 2). None where the view does not see the beginning.

    behind: pixels beyond the region's corners at which a ray ends that leads behind the viewer.
    """
    if not view.perspective:
        return None
    start = view.matrix @ np.append(pivot, 1)
    along = view.matrix[:, :3] @ to_light
    scale = np.linalg.norm(view.matrix[3, :3])
    if start[3] <= IN_FRONT * scale:
        return None
    begin = view.on_screen(start)
    if along[3] > IN_FRONT * scale:
        return np.array([begin, view.on_screen(along)])
    way = (along[:2] * start[3] - start[:2] * along[3]) * (view.width, view.height)
    length = np.linalg.norm(way)
    if length < 1e-9:
        return None
    return np.array([begin, begin + way / length * (view.width + view.height + behind)])


def distances(lines: Floats, place: Floats) -> Floats:
    """From a place, (2,), to pieces of lines, (m, 2, 2); (m,)."""
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip(((place - start) * along).sum(axis=1) / square, 0, 1)
    return np.linalg.norm(start + part[:, None] * along - place, axis=1)


def arrow_head(tip: Floats, way: Floats, size: float) -> Floats:
    """A triangle, (3, 2), with this tip that points along `way`, (2,)."""
    forward = way / max(float(np.linalg.norm(way)), 1e-300)
    aside = np.array([-forward[1], forward[0]])
    back = tip - size * forward
    return np.array([tip, back + 0.45 * size * aside, back - 0.45 * size * aside])


def place_labels(
    places: Floats, sizes: Floats, aways: Floats, frame: Frame
) -> list[tuple[float, float] | None]:
    """Lower left corners of labels beside places, the most important first; None for those that
    would cover another one or leave the frame, on whichever side they stand.

    places: (n, 2). sizes: width and height of each, (n, 2). aways: how far from its place, (n,).
    """
    low = places[:, None] + _SIDES * aways[:, None, None] - (_SIDES < 0) * sizes[:, None]
    corners = low.reshape(-1, 2)
    begin = corners - SPACE
    end = corners + sizes.repeat(len(_SIDES), axis=0) + SPACE
    free = frame.holds(begin) & frame.holds(end)
    (left, bottom), (right, top) = begin.T, end.T
    clash = (left[:, None] < right) & (left < right[:, None])
    clash &= (bottom[:, None] < top) & (bottom < top[:, None])
    chosen: list[tuple[float, float] | None] = []
    for number in range(len(places)):
        first = len(_SIDES) * number
        side = int(free[first : first + len(_SIDES)].argmax()) + first
        chosen.append((float(corners[side, 0]), float(corners[side, 1])) if free[side] else None)
        if free[side]:
            free &= ~clash[side]
    return chosen


_SIDES = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1)])
"""Where a label may stand: right and above first."""
