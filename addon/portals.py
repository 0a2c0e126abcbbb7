"""Portals: where light comes into a closed scene, for Cycles to look there for the sky."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ..core import sphere
from ..core.conversion import Conversion
from ..core.environment import LUMINANCE_WEIGHTS, EnvironmentMap, luminance
from ..core.indoors import Indoors
from ..core.openings import (
    WIDEST,
    Inside,
    Opening,
    are_inside,
    find_openings,
    may_be_closed,
    part_seen,
)
from ..core.portal_noise import LightInside, square_through
from ..core.sums import weighted_sum
from ..core.visible import VisiblePart, light_of_cells
from .images import READ
from .lamps import remove_lamps, unlink_lamps
from .rays import LOOKS, Reach
from .steps import Apart, Steps
from .trace import TAG

COLLECTION = "Sunsplit Portals"

ENOUGH = 100
"""Rays that get out, for the edges of openings to be seen."""

MOST_PATHS = 1_000
"""Followed for them: if fewer get out the openings are cracks."""

MOST_PLACES = 3_000
"""That are asked, where more were found."""

AT_A_TIME = 16
"""Rays between two moments for the window."""

MOST_SUNS = 16
"""The brightest, asked for at each place."""

SUNLIT = 600
"""Places that are asked for suns."""

MOST_LIT = 600
"""Places that suns are chosen for."""


@dataclass(frozen=True, eq=False)
class ClosedScene:
    """A scene that light comes into through openings. part: of the half sphere above a place inside
    that these take."""

    reach: Reach
    inside: Inside
    openings: tuple[Opening, ...]

    @property
    def part(self) -> float:
        return part_seen(self.inside, self.openings)

    @cached_property
    def within(self) -> NDArray[np.intp]:
        """The places that are inside."""
        return np.flatnonzero(are_inside(self.inside, self.openings))

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """Of the surface at each place, (p, 3)."""
        return _points(place.normal for place in self.reach.places[: len(self.inside.places)])

    def some_within(self, most: int) -> NDArray[np.intp]:
        """Of the places inside about so many, evenly."""
        count = len(self.within)
        return self.within[np.linspace(0, count, min(most, count), endpoint=False).astype(int)]

    def indoors(
        self,
        environment: EnvironmentMap,
        visible: VisiblePart | None,
        to_map: NDArray[np.float64],
    ) -> Indoors:
        """What a map's light may reach. visible: of the map, None for all. to_map: rotation (3, 3)
        from the scene's axes."""
        places = self.some_within(MOST_LIT)
        return Indoors(
            self.inside.places[places] @ to_map.T,
            self.normals[places] @ to_map.T,
            tuple(opening.turned(to_map) for opening in self.openings),
            light_of_cells(environment, visible),
        )

    def light(self, conversion: Conversion, to_map: NDArray[np.float64]) -> Steps[LightInside]:
        """Of a conversion with a residual. to_map: rotation (3, 3) from the scene's axes."""
        return _light_inside(self, conversion, to_map)


def closed_scene(reach: Reach) -> Steps[ClosedScene | None]:
    """The scene with its openings; None where it has none that explain all light in it, or where
    more than the camera moves."""
    if not reach.sight.stands_still:
        return None
    moments = reach.sight.moments
    for path in range(MOST_PATHS):
        if len(reach.escaped) >= min(ENOUGH, WIDEST * LOOKS * max(len(reach.places), 1)):
            break
        reach.follow_another(moments[path % len(moments)])
        yield
    if not may_be_closed(len(reach.escaped), LOOKS * len(reach.places)):
        return None
    inside, openings = yield Apart(lambda _, in_main: _openings(reach, in_main), READ, READ)
    return ClosedScene(reach, inside, openings) if openings else None


def _openings(reach: Reach, run: Callable[[Steps], Any]) -> tuple[Inside, tuple[Opening, ...]]:
    """run: runs steps where rays may be cast, and returns their result."""

    def are_open(starts: NDArray[np.float64], directions: NDArray[np.float64]) -> Any:  # noqa: ANN401
        rays = [(Vector(a), Vector(b)) for a, b in zip(starts, directions, strict=True)]
        return run(_are_open(reach, rays))

    known = len(reach.places[:MOST_PLACES])
    rays = [ray for ray in zip(reach.started, reach.escaped, strict=True) if ray[0] < known]
    started = np.array([place for place, _ in rays], dtype=np.intp)
    straight = run(_are_open(reach, [(reach.places[k].point, away) for k, away in rays]))
    inside = Inside(
        _points(place.point for place in reach.places[:known]),
        LOOKS,
        _points(away for _, away in rays)[straight],
        started[straight],
        _points(place.point for place in reach.met),
        _points(place.normal for place in reach.met),
        are_open,
    )
    return inside, find_openings(inside)


def _are_open(reach: Reach, rays: Sequence[tuple[Vector, Vector]]) -> Steps[NDArray[np.bool_]]:
    """From which directions light comes straight."""
    found = np.zeros(len(rays), bool)
    for k, (start, direction) in enumerate(rays):
        found[k] = _is_open(reach, start, direction)
        if k % AT_A_TIME == 0:
            yield
    return found


def _is_open(reach: Reach, start: Vector, direction: Vector) -> bool:
    return reach.sight.moments[0].is_open(start, direction)  # as in any, as nothing moves


def _points(vectors: Iterable[Vector]) -> NDArray[np.float64]:
    return np.array([tuple(one) for one in vectors], dtype=np.float64).reshape(-1, 3)


def _light_inside(
    closed: ClosedScene, conversion: Conversion, to_map: NDArray[np.float64]
) -> Steps[LightInside]:
    reach, inside, radiance = closed.reach, closed.inside, conversion.residual
    height, width = radiance.shape[:2]
    lum = luminance(radiance)
    solid = sphere.row_solid_angles(width, height)
    # Places outside find the sky by themselves, whoever is told of openings.
    normals, places, chosen = closed.normals, closed.within, closed.some_within(SUNLIT)
    looks = np.isin(inside.started, places)
    suns = sorted(conversion.suns, key=lambda sun: -float(sun.irradiance @ LUMINANCE_WEIGHTS))
    facing = np.zeros((len(chosen), min(len(suns), MOST_SUNS)))
    lit = np.zeros_like(facing)
    for k, sun in enumerate(suns[:MOST_SUNS]):
        direction = to_map.T @ sun.to_light
        strength = float(sun.irradiance @ LUMINANCE_WEIGHTS)
        facing[:, k] = strength * np.maximum(normals[chosen] @ direction, 0)
        for row in np.flatnonzero(facing[:, k]):
            if _is_open(reach, reach.places[chosen[row]].point, Vector(direction)):
                lit[row, k] = facing[row, k]
            if row % AT_A_TIME == 0:
                yield

    def sky(directions: NDArray[np.float64]) -> NDArray[np.float64]:
        return lum.ravel()[sphere.pixels_at(directions @ to_map.T, width, height)]

    return LightInside(
        sky(inside.escaped[looks]),
        (normals[inside.started] * inside.escaped).sum(axis=1)[looks],
        LOOKS * len(places),
        square_through(closed.openings, inside.places[places], normals[places], sky),
        facing,
        lit,
        float(weighted_sum(solid, lum.sum(axis=1))) / (4 * np.pi),
        len(suns),
    )


def has_portals(scene: bpy.types.Scene) -> bool:
    """Whether the user has made portals for the scene."""
    lamps = (thing.data for thing in scene.objects if thing.type == "LIGHT" and not thing.get(TAG))
    return any(data.type == "AREA" and data.cycles.is_portal for data in lamps)


def make_portals(scene: bpy.types.Scene, openings: Sequence[Opening]) -> None:
    """A portal in each opening, in a new collection of the scene."""
    if not openings:
        return
    state = scene.sunsplit
    state.portals_collection = bpy.data.collections.new(COLLECTION)
    state.portals_collection[TAG] = True
    for number, opening in enumerate(openings, start=1):
        portal = _portal(opening, f"Sunsplit Portal {number}")
        state.portals_collection.objects.link(portal)
        state.portals.add().lamp = portal
    scene.collection.children.link(state.portals_collection)


def _portal(opening: Opening, name: str) -> bpy.types.Object:
    data = bpy.data.lights.new(name, "AREA")
    data[TAG] = True
    data.shape, data.size, data.size_y = "RECTANGLE", opening.width, opening.height
    data.cycles.is_portal = True
    data.energy = 0.0  # to other engines it is a lamp
    data.use_shadow = False
    portal = bpy.data.objects.new(name, data)
    portal[TAG] = True
    # A lamp shines along its -Z.
    out = -opening.inwards
    axes = np.column_stack([opening.across, np.cross(out, opening.across), out])
    portal.matrix_world = Matrix.Translation(opening.centre) @ Matrix(axes.tolist()).to_4x4()
    return portal


def remove_portals(scene: bpy.types.Scene) -> None:
    """Take a conversion's portals out of a scene, wherever the user has put them; what another
    scene still uses stays there."""
    state = scene.sunsplit
    portals = [entry.lamp for entry in state.portals if entry.lamp]
    collection, state.portals_collection = state.portals_collection, None
    state.portals.clear()
    unlink_lamps(scene, collection, portals)
    remove_lamps(portals)
