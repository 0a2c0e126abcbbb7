"""Where suns lie on a screen, for drawing and for clicks alike: plain functions of numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core import sphere
from ...core.outlines import lines_in_image
from .screen import IN_FRONT, View, distances, globe

Floats = NDArray[np.float64]

AROUND = 49
"""Points of a circle, its first twice."""

WIDE = 0.2
"""Radians; near a pole, or if it is wide, a disc is no circle on the map and takes more points."""


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

    def hit(self, x: float, y: float, reach: float) -> int | None:
        """The sun whose centre or outline is nearest, at most `reach` pixels away."""
        at = np.array([x, y])
        nearest = np.linalg.norm(self.place - at, axis=1)
        nearest[np.isnan(nearest)] = np.inf
        np.minimum.at(nearest, self.owner, distances(self.lines, at))
        if not len(nearest) or nearest.min() > reach:
            return None
        return int(nearest.argmin())


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


@dataclass(frozen=True, eq=False)
class MapDiscs:
    """Discs on an equirectangular map, in u, v (v downwards).

    place: of each centre, (n, 2). half_angle: radians, (n,). pieces: of the outlines by both ends,
    (m, 2, 2), of the discs owner, (m,).
    """

    place: Floats
    half_angle: Floats
    pieces: Floats
    owner: NDArray[np.intp]


def discs_in_map(to_light: Floats, half_angle: Floats) -> MapDiscs:
    """Discs as an equirectangular map shows them. to_light: in the map's directions, (n, 3)."""
    u, v = sphere.to_image(to_light)
    pieces, owner = [np.empty((0, 2, 2))], [np.empty(0, np.intp)]
    for number, (centre, angle) in enumerate(zip(to_light, half_angle, strict=True)):
        plain = angle < WIDE and np.hypot(centre[0], centre[1]) > 2 * WIDE
        for line in lines_in_image(sphere.circle(centre, angle, AROUND if plain else 3 * AROUND)):
            pieces.append(np.stack([line[:-1], line[1:]], axis=1))
            owner.append(np.full(len(line) - 1, number))
    place = np.stack([u, v], axis=-1)
    return MapDiscs(place, half_angle, np.concatenate(pieces), np.concatenate(owner))


def marks_in_map(discs: MapDiscs, origin: Floats, size: Floats, least: float) -> Marks:
    """Suns on a map that fills a rectangle of the screen.

    origin, size: of the rectangle, pixels: its lower left corner, width and height. least: see
    `marks_in_view`.
    """
    place = on_map(discs.place, origin, size)
    # Along the map's height a degree is the same everywhere.
    narrow = discs.half_angle / np.pi * size[1] < least
    drawn = ~narrow[discs.owner]
    rings, of_rings = _rings(place, narrow, least)
    return Marks(
        place,
        np.concatenate([on_map(discs.pieces[drawn], origin, size), rings]),
        np.concatenate([discs.owner[drawn], of_rings]),
        narrow,
        np.zeros(len(place), bool),
        np.zeros(len(place), bool),
    )


def on_map(uv: Floats, origin: Floats, size: Floats) -> Floats:
    """Pixels of places u, v (v downwards) on a map, (..., 2)."""
    return uv * np.array([size[0], -size[1]]) + np.array([origin[0], origin[1] + size[1]])


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


_TURN = np.linspace(0, 2 * np.pi, AROUND)
_CIRCLE = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1)
