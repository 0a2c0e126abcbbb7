"""Openings that light comes into a closed scene through: windows, doors, a missing wall.

A path tracer that looks for the sky from inside finds it once in many tries, as a window is a small
part of all directions. If it knows the openings it looks nowhere else.

They are found by rays from the surfaces that matter: whatever gets out crosses the plane of an
opening within a rectangle, and no plane is crossed more narrowly. Planes that may be that are those
of walls, which a window lies in, and the sides of the box around all that was met, where a wall is
missing. An opening that is found too small or too large costs noise and changes no light.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST = 8
"""More openings than these are not looked for: each sample tries one of them, drawn by lot."""

FEWEST = 12
"""Rays that get out, from which on openings can be told."""

MOST_RAYS, MOST_SURFACES = 300, 3000
"""Of them, and of surfaces that the others met, are looked at: more say little more."""

FEWEST_EACH, EACH = 3, 0.04
"""Of them through each opening, and as a part of all: less is a crack."""

COVERED = 0.9
"""Of the rays that get out from inside: if openings have less, they are not all there is."""

WIDEST = 0.25
"""Of the looks from inside: where more get out, rays find the sky by themselves."""

INSIDE = 0.5
"""Of the places that matter: where fewer are inside, it is another scene that the picture shows."""

FLAT = np.cos(np.radians(2))
"""Surfaces whose normals are nearer to each other than 2 degrees may lie in one plane."""

THIN = 2e-3
"""Of the scene's size: surfaces within so much of a plane lie in it."""

MOST_PLANES = 30
"""Of walls, those that were met most."""

LARGE = 0.02
"""Of all surfaces that were met: a plane with fewer of them is no direction that a room has."""

APART = 9.0
"""Openings in one wall are two where nothing between them is crossed over so many distances of one
crossing to the next, the lower quartile of these: 2.7 sides of the square that each has for itself
where they are spread at random."""

WIDER = 1.3
"""So much larger than its crossings is the rectangle in which an opening's edges are looked for."""

TARGETS = 256
"""Rays that look for the edges of an opening."""

GROWTHS, GROWN = 4, 1.1
"""So often are they looked for again, where an opening turned out by so much larger."""


@dataclass(frozen=True, eq=False)
class Inside:
    """What rays from the surfaces that matter have met.

    places: where they started, (p, 3), each as many, `looks`. escaped: directions of those that got
    out straight, (n, 3), and started: the place of each, (n,). points, normals: of surfaces that
    the others met, (m, 3), normals to the ray's side. are_open: which of rays, starts and
    directions (k, 3), get out, (k,).
    """

    places: Floats
    looks: int
    escaped: Floats
    started: NDArray[np.intp]
    points: Floats
    normals: Floats
    are_open: Callable[[Floats, Floats], NDArray[np.bool_]]

    def thinned(self, count: int, surfaces: int) -> Inside:
        """The same with places that have about so many rays that get out, if there are more, and
        so many surfaces that were met."""
        every = -(-len(self.escaped) // count)
        every_met = max(-(-len(self.points) // surfaces), 1)
        chosen = np.arange(0, len(self.places), every)
        of_chosen = self.started % every == 0
        return replace(
            self,
            places=self.places[chosen],
            escaped=self.escaped[of_chosen],
            started=self.started[of_chosen] // every,
            points=self.points[::every_met],
            normals=self.normals[::every_met],
        )


@dataclass(frozen=True, eq=False)
class Opening:
    """A rectangle. centre: (3,). across, up, inwards: orthonormal, (3,). width: along `across`."""

    centre: Floats
    across: Floats
    up: Floats
    inwards: Floats
    width: float
    height: float

    def is_before(self, points: Floats) -> NDArray[np.bool_]:
        """Whether points (n, 3) are inside, seen from here."""
        return (points - self.centre) @ self.inwards > 0

    def turned(self, rotation: Floats) -> Opening:
        """The same in other axes. rotation: (3, 3)."""
        vectors = {name: getattr(self, name) for name in ("centre", "across", "up", "inwards")}
        return replace(self, **{name: rotation @ vector for name, vector in vectors.items()})

    def points(self, side: int) -> tuple[Floats, float]:
        """Evenly over the rectangle, (side * side, 3), and the area that each stands for."""
        part = (np.arange(side) + 0.5) / side - 0.5
        across = part[:, None, None] * (self.width * self.across)
        points = self.centre + across + part[:, None] * (self.height * self.up)
        return points.reshape(-1, 3), self.width * self.height / side**2

    def is_crossed(self, starts: Floats, directions: Floats) -> NDArray[np.bool_]:
        """Whether rays (n, 3) go out through here."""
        along, out = _crossings(self.inwards, self.inwards @ self.centre, starts, directions)
        local = starts + along[:, None] * directions - self.centre
        within = np.abs(local @ self.across) <= self.width / 2
        return out & within & (np.abs(local @ self.up) <= self.height / 2)


@dataclass(frozen=True, eq=False)
class _Plane:
    """inwards: unit normal, (3,). offset: of the plane along it. surfaces: that were met in it."""

    inwards: Floats
    offset: float
    surfaces: int = 0


def find_openings(inside: Inside) -> tuple[Opening, ...]:
    """The openings of a closed scene, the most important first; none where it is not closed, or
    where some of what gets out is not explained by them."""
    if not may_be_closed(len(inside.escaped), inside.looks * len(inside.places)):
        return ()
    if len(inside.points) < FEWEST:  # nothing stops light
        return ()
    inside = inside.thinned(MOST_RAYS, MOST_SURFACES)
    starts = inside.places[inside.started]
    planes, axes = _planes(inside)
    left = np.ones(len(starts), bool)
    found: list[Opening] = []
    while len(found) < MOST and left.mean() > 1 - COVERED:
        opening = _through_one_plane(inside, planes, axes, left)
        if opening is None:
            break
        found.append(opening)
        left &= opening.is_before(starts) & ~opening.is_crossed(starts, inside.escaped)
    return tuple(found) if found and _is_closed(inside, found) else ()


def may_be_closed(escaped: int, looks: int) -> bool:
    """Whether so many of all looks may have got out of a closed scene: all of those from places
    outside, and few from inside, but enough to tell openings by."""
    return FEWEST <= escaped <= looks * (1 - INSIDE + INSIDE * WIDEST)


def are_inside(inside: Inside, found: Sequence[Opening]) -> NDArray[np.bool_]:
    """Which places are inside of openings, (p,)."""
    return _from_inside(inside, found)[1]


def part_seen(inside: Inside, found: Sequence[Opening]) -> float:
    """Of the half sphere above a place inside, what openings take on average."""
    through, within = _from_inside(inside, found)
    return float(through.sum() / (inside.looks * within.sum()))


def _is_closed(inside: Inside, found: list[Opening]) -> bool:
    """Whether openings are all there is, for those places that are inside of them."""
    through, within = _from_inside(inside, found)
    out = within[inside.started].sum()
    return bool(
        through.sum() >= COVERED * out
        and out <= WIDEST * inside.looks * within.sum()
        and within.mean() >= INSIDE
    )


def _from_inside(
    inside: Inside, found: Sequence[Opening]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which rays get out through openings, (n,), and which places are inside of them, (p,)."""
    starts = inside.places[inside.started]
    through = np.any([each.is_crossed(starts, inside.escaped) for each in found], axis=0)
    within = np.all([each.is_before(inside.places) for each in found], axis=0)
    within[inside.started[through]] = True
    return through, within


def _through_one_plane(
    inside: Inside, planes: list[_Plane], axes: Floats, left: NDArray[np.bool_]
) -> Opening | None:
    """The main opening in the plane that most of the rays that are left cross most narrowly."""
    starts, directions = inside.places[inside.started][left], inside.escaped[left]
    fewest = max(FEWEST_EACH, EACH * len(left))
    best, found = 0.0, None
    for plane in planes:
        along, out = _crossings(plane.inwards, plane.offset, starts, directions)
        points = (starts + along[:, None] * directions)[out]
        points = points[_is_within(points, inside.points, axes)]
        if len(points) < fewest:
            continue
        rectangles = _rectangles(plane, axes, points, fewest)
        area = sum(each.width * each.height for each in rectangles)
        count = sum(np.count_nonzero(each.is_crossed(starts, directions)) for each in rectangles)
        if area > 0 and count**2 / area > best:
            best, found = count**2 / area, rectangles[0]
    return _with_edges(inside, axes, found) if found else None


def _is_within(points: Floats, box: Floats, axes: Floats) -> NDArray[np.bool_]:
    """Whether points (n, 3) are between the outermost of others (m, 3) along all axes (k, 3)."""
    along = box @ axes.T
    slack = THIN * np.ptp(along, axis=0).max()
    here = points @ axes.T
    return ((here >= along.min(axis=0) - slack) & (here <= along.max(axis=0) + slack)).all(axis=1)


def _crossings(
    inwards: Floats, offset: float, starts: Floats, directions: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """How far along rays (n, 3) a plane is, (n,), and which go out through it."""
    speed = directions @ inwards
    out = speed < -1e-9
    along = (offset - starts @ inwards) / np.where(out, speed, -1.0)
    return along, out & (along > 0)


def _planes(inside: Inside) -> tuple[list[_Plane], Floats]:
    """Planes that openings may lie in, and the directions that walls look to, (k, 3)."""
    points, normals = inside.points, inside.normals
    thin = THIN * float(np.ptp(points, axis=0).max())
    planes: list[_Plane] = []
    axes: list[Floats] = []
    rest = np.ones(len(points), bool)
    while rest.any():
        first = int(np.argmax(rest))
        normal, offset = normals[first], points[first] @ normals[first]
        alike = normals @ normal > FLAT
        alike &= np.abs(points @ normal - offset) < thin
        alike[first] = True
        count = np.count_nonzero(alike & rest)
        rest &= ~alike
        if count < FEWEST_EACH:
            continue
        planes.append(_Plane(normal, float(offset), count))
        is_new = all(abs(normal @ axis) < FLAT for axis in axes)
        if is_new and count >= LARGE * len(points):
            axes.append(normal)
    axes = axes or [np.array([0.0, 0.0, 1.0])]
    planes = sorted(planes, key=lambda one: -one.surfaces)[:MOST_PLANES]
    for axis in axes:
        along = points @ axis
        planes += [_Plane(axis, float(along.min())), _Plane(-axis, float(-along.max()))]
    return planes, np.array(axes)


def _rectangles(plane: _Plane, axes: Floats, points: Floats, fewest: float) -> list[Opening]:
    """Around points in a plane, (n, 3): as many as there are groups of so many of them."""
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial import KDTree

    nearest = KDTree(points).query(points, 2)[0][:, 1]
    near = APART * np.quantile(nearest, 0.25)  # where they are dense: of the narrowest
    if near == 0:
        return []
    group = fcluster(linkage(points, "single"), near, "distance")
    counts = np.bincount(group)
    return [
        _smallest(plane.inwards, axes, points[group == k])
        for k in np.argsort(-counts, kind="stable")
        if counts[k] >= fewest
    ]


def _smallest(inwards: Floats, axes: Floats, points: Floats) -> Opening:
    """The smallest rectangle around points in a plane, (n, 3), with sides as walls have them."""
    around = [_around(inwards, frame, points) for frame in _frames(inwards, axes)]
    return min(around, key=lambda one: one.width * one.height)


def _frames(inwards: Floats, axes: Floats) -> list[tuple[Floats, Floats]]:
    """(across, up) of rectangles in a plane that have sides along directions that walls have."""
    frames = []
    for axis in axes:
        up = axis - (axis @ inwards) * inwards
        length = np.linalg.norm(up)
        if length > 0.1:
            up = up / length
            frames.append((np.cross(up, inwards), up))
    if not frames:
        up = np.cross(inwards, np.eye(3)[np.argmin(np.abs(inwards))])
        up /= np.linalg.norm(up)
        frames.append((np.cross(up, inwards), up))
    return frames


def _around(inwards: Floats, frame: tuple[Floats, Floats], points: Floats) -> Opening:
    """The rectangle around points (n, 3), twice as much larger as n of them do not reach its edges:
    what is missed of an opening is noisier than a rim of a wall is."""
    across, up = frame
    middle = points.mean(axis=0)
    local = (points - middle) @ np.stack(frame, axis=1)
    low, high = local.min(axis=0), local.max(axis=0)
    width, height = (high - low) * (1 + 4 / (len(points) + 1))
    x, y = (low + high) / 2
    return Opening(middle + x * across + y * up, across, up, inwards, float(width), float(height))


def _with_edges(inside: Inside, axes: Floats, rough: Opening) -> Opening:
    """An opening whose edges were looked for, in ever larger rectangles until they are found."""
    random = np.random.default_rng(0)
    for _ in range(GROWTHS):
        targets = _targets(inside, rough, random)
        if len(targets) < FEWEST_EACH:
            return rough
        size = rough.width, rough.height
        rough = _smallest(rough.inwards, axes, targets)
        if rough.width < GROWN * size[0] and rough.height < GROWN * size[1]:
            break
    return rough


def _targets(inside: Inside, rough: Opening, random: np.random.Generator) -> Floats:
    """Points that light comes in through, (n, 3), in and around an opening."""
    before = np.flatnonzero(rough.is_before(inside.places))
    x, y = WIDER * (random.random((2, TARGETS)) - 0.5)
    targets = rough.centre + np.outer(x * rough.width, rough.across)
    targets += np.outer(y * rough.height, rough.up)
    starts = inside.places[random.choice(before, TARGETS)]
    away = targets - starts
    away /= np.linalg.norm(away, axis=1)[:, None]
    return targets[inside.are_open(starts, away)]
