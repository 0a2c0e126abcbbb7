"""Where suns lie on a screen: plain functions of numbers, for drawing and for clicks alike.

Pixels count from the lower left corner of a region. Matrices are Blender's: they act on columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core import sphere
from ..core.outlines import lines_in_image

Floats = NDArray[np.float64]

AROUND = 49
"""Points of a circle, its first twice."""

IN_FRONT = 0.02
"""Cosine of the angle to where the view looks, about, from which on a direction is in front: what
is farther aside would lie a hundred times the region's width away."""

GLOBE = 0.36
"""Radius of the globe of directions in an orthographic view, as a part of the region's shorter
side."""


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


@dataclass(frozen=True, eq=False)
class Marks:
    """Suns on a screen.

    place: of the centre, pixels, nan where it is not shown, (n, 2). lines: pieces of outlines by
    both ends, (m, 2, 2), of the suns owner, (m,). narrow: drawn as a ring, as its disc would be too
    small, (n,). aside: out of sight; place is at the frame, on the way there, (n,). behind: on the
    far side of the globe of an orthographic view, (n,).
    """

    place: Floats
    lines: Floats
    owner: NDArray[np.intp]
    narrow: NDArray[np.bool_]
    aside: NDArray[np.bool_]
    behind: NDArray[np.bool_]

    @property
    def key(self) -> tuple[bytes, ...]:
        """Tells apart what would be drawn differently."""
        return self.place.tobytes(), self.lines.tobytes()

    def hit(self, x: float, y: float, reach: float) -> int | None:
        """The sun whose centre or outline is nearest, at most `reach` pixels away."""
        at = np.array([x, y])
        nearest = np.linalg.norm(self.place - at, axis=1)
        nearest[np.isnan(nearest)] = np.inf
        np.minimum.at(nearest, self.owner, distances(self.lines, at))
        if not len(nearest) or nearest.min() > reach:
            return None
        return int(nearest.argmin())


def distances(lines: Floats, place: Floats) -> Floats:
    """From a place, (2,), to pieces of lines, (m, 2, 2); (m,)."""
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip(((place - start) * along).sum(axis=1) / square, 0, 1)
    return np.linalg.norm(start + part[:, None] * along - place, axis=1)


def circles(to_light: Floats, half_angle: Floats) -> Floats:
    """Directions along the rims of discs, closed, (n, AROUND, 3)."""
    rims = [
        sphere.circle(centre, angle, AROUND)
        for centre, angle in zip(to_light, half_angle, strict=True)
    ]
    return np.array(rims).reshape(-1, AROUND, 3)


def marks_in_view(to_light: Floats, rims: Floats, view: View, least: float) -> Marks:
    """Suns on the sky of a 3D view; see `circles` for rims.

    least: radius in pixels below which a disc becomes a ring of that radius. In an orthographic
    view, which sees one direction only, they lie on a globe, seen from outside.
    """
    if not view.perspective:
        return _marks_on_globe(to_light, rims, view, least)
    to_clip = view.matrix[:, :3].T
    centre, rim = to_light @ to_clip, rims @ to_clip
    # The last row is the way the view looks, but for a factor.
    looks = IN_FRONT * np.linalg.norm(view.matrix[3, :3])
    front, rim_front = centre[:, 3] > looks, rim[..., 3] > looks
    place = view.on_screen(np.where(front[:, None], centre, 1))
    place[~front] = np.nan
    points = view.on_screen(np.where(rim_front[..., None], rim, 1))
    radius = np.linalg.norm(points - place[:, None], axis=-1).max(axis=1, initial=0)
    narrow = front & rim_front.all(axis=1) & (radius < least)
    aside = ~(front & view.frame.holds(place))
    whole = rim_front[:, 1:] & rim_front[:, :-1] & ~narrow[:, None]
    lines, owner = _pieces(points, whole)
    ringed = narrow & ~aside
    rings, of_rings = _rings(place, ringed, least)
    place[aside] = _at_frame(centre[aside], view, least)
    return Marks(
        place,
        np.concatenate([lines, rings]),
        np.concatenate([owner, of_rings]),
        narrow,
        aside,
        np.zeros(len(place), bool),
    )


def marks_in_map(
    to_light: Floats, half_angle: Floats, origin: Floats, size: Floats, least: float
) -> Marks:
    """Suns on an equirectangular map that fills a rectangle of the screen.

    to_light: in the map's directions. origin, size: of the rectangle, pixels: its lower left
    corner, width and height.
    """
    u, v = sphere.to_image(to_light)
    place = on_map(np.stack([u, v], axis=-1), origin, size)
    # What is narrow on the map's widest row need not be so near a pole.
    radius = half_angle / np.pi * size[1]
    narrow = radius < least
    found, owner = [], []
    for number in np.flatnonzero(~narrow):
        for line in lines_in_image(sphere.circle(to_light[number], half_angle[number], 4 * AROUND)):
            line = on_map(line, origin, size)
            found.append(np.stack([line[:-1], line[1:]], axis=1))
            owner.append(np.full(len(line) - 1, number))
    rings, of_rings = _rings(place, narrow, least)
    none = np.zeros(len(place), bool)
    lines = np.concatenate([*found, rings])
    return Marks(place, lines, np.concatenate([*owner, of_rings]), narrow, none, none)


def on_map(uv: Floats, origin: Floats, size: Floats) -> Floats:
    """Pixels of places u, v (v downwards) on a map, (..., 2)."""
    return origin + (uv * (1, -1) + (0, 1)) * size


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


def globe(view: View) -> tuple[Floats, float]:
    """Centre and radius in pixels of the globe of an orthographic view."""
    frame = view.frame
    shorter = min(frame.right - frame.left, frame.top - frame.bottom)
    return frame.middle, GLOBE * max(shorter, 0)


def _marks_on_globe(to_light: Floats, rims: Floats, view: View, least: float) -> Marks:
    centre, radius = globe(view)
    # The rows of the matrix are the axes of the screen, but for a factor each.
    axes = view.matrix[:3, :3] / np.linalg.norm(view.matrix[:3, :3], axis=1, keepdims=True)
    turned = to_light @ axes.T
    place = centre + radius * turned[:, :2]
    points = centre + radius * (rims @ axes.T)[..., :2]
    extent = np.linalg.norm(points - place[:, None], axis=-1).max(axis=1, initial=0)
    narrow = extent < least
    lines, owner = _pieces(points, np.repeat(~narrow[:, None], AROUND - 1, axis=1))
    rings, of_rings = _rings(place, narrow, least)
    return Marks(
        place,
        np.concatenate([lines, rings]),
        np.concatenate([owner, of_rings]),
        narrow,
        np.zeros(len(place), bool),
        turned[:, 2] > 0,
    )


def _pieces(points: Floats, drawn: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.intp]]:
    """Pieces of lines of points (n, k, 2), those that are drawn (n, k - 1), and their owners."""
    owner, first = np.nonzero(drawn)
    return np.stack([points[owner, first], points[owner, first + 1]], axis=1), owner


def _rings(
    place: Floats, drawn: NDArray[np.bool_], radius: float
) -> tuple[Floats, NDArray[np.intp]]:
    """Circles on the screen around some places, as `_pieces` gives them."""
    owner = np.flatnonzero(drawn)
    points = place[owner, None] + radius * _CIRCLE
    lines, which = _pieces(points, np.ones((len(owner), AROUND - 1), bool))
    return lines, owner[which]


def _at_frame(clip: Floats, view: View, margin: float) -> Floats:
    """Where the way from the frame's middle to directions that are out of sight leaves it."""
    frame = view.frame.shrunk(6 * margin)  # the navigation buttons stay free
    middle = frame.middle
    front = clip[:, 3] > 1e-6
    way = clip[:, :2] * (view.width, view.height)
    # In front, and so near that where it is can be told: the way there from the middle.
    way[front] = view.on_screen(clip[front]) - middle
    way[~way.any(axis=1)] = 0, 1
    half = np.maximum([frame.right - middle[0], frame.top - middle[1]], 1)
    return middle + way / (np.abs(way) / half).max(axis=1, initial=0)[:, None]


_SIDES = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1)])
"""Where a label may stand: right and above first."""

SPACE = 5.0
"""Pixels that labels are apart, and from the frame."""

_TURN = np.linspace(0, 2 * np.pi, AROUND)
_CIRCLE = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1)
