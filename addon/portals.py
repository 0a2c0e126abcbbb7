"""Portals: where light comes into a closed scene, for Cycles to look there for the sky."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ..core import sphere
from ..core.conversion import Conversion
from ..core.environment import LUMINANCE_WEIGHTS, luminance
from ..core.openings import WIDEST, Inside, Opening, find_openings, part_seen
from ..core.portal_noise import LightInside
from ..core.sums import weighted_sum
from .rays import LOOKS, Reach
from .steps import Steps
from .trace import TAG

COLLECTION = "Sunsplit Portals"

ENOUGH = 100
"""Rays that get out, for the edges of openings to be seen."""

MOST_PATHS = 1_000
"""Followed for them: if fewer get out the openings are cracks."""

MOST_SUNS = 16
"""The brightest, asked for at each place."""

SUNLIT = 600
"""Places that are asked for suns."""


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

    def light(self, conversion: Conversion, to_map: NDArray[np.float64]) -> Steps[LightInside]:
        """Of a conversion with a residual. to_map: rotation (3, 3) from the scene's axes."""
        return _light_inside(self.reach, self.inside, conversion, to_map)


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
    inside = _inside(reach)
    openings = find_openings(inside)
    return ClosedScene(reach, inside, openings) if openings else None


def _inside(reach: Reach) -> Inside:
    places = _points(place.point for place in reach.places)
    escaped, started = _points(reach.escaped), np.array(reach.started, dtype=np.intp)
    straight = [
        _is_open(reach, reach.places[place].point, direction)
        for place, direction in zip(reach.started, reach.escaped, strict=True)
    ]
    return Inside(
        places,
        LOOKS,
        escaped[straight],
        started[straight],
        _points(place.point for place in reach.met),
        _points(place.normal for place in reach.met),
        lambda start, direction: _is_open(reach, Vector(start), Vector(direction)),
    )


def _is_open(reach: Reach, start: Vector, direction: Vector) -> bool:
    return reach.sight.moments[0].is_open(start, direction)  # as in any, as nothing moves


def _points(vectors: Sequence[Vector]) -> NDArray[np.float64]:
    return np.array([tuple(one) for one in vectors], dtype=np.float64).reshape(-1, 3)


def _light_inside(
    reach: Reach, inside: Inside, conversion: Conversion, to_map: NDArray[np.float64]
) -> Steps[LightInside]:
    radiance = conversion.residual
    height, width = radiance.shape[:2]
    lum = luminance(radiance)
    solid = sphere.row_solid_angles(width, height)
    normals = _points(place.normal for place in reach.places)
    chosen = np.linspace(0, len(normals), min(SUNLIT, len(normals)), endpoint=False).astype(int)
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
        yield
    return LightInside(
        lum.ravel()[sphere.pixels_at(inside.escaped @ to_map.T, width, height)],
        (normals[inside.started] * inside.escaped).sum(axis=1),
        LOOKS * len(normals),
        facing,
        lit,
        float(weighted_sum(solid, lum.sum(axis=1))) / (4 * np.pi),
    )


def has_portals(scene: bpy.types.Scene) -> bool:
    """Whether the user has made portals for the scene."""
    lamps = (thing.data for thing in scene.objects if thing.type == "LIGHT" and not thing.get(TAG))
    return any(data.type == "AREA" and data.cycles.is_portal for data in lamps)


def make_portals(
    scene: bpy.types.Scene, openings: Sequence[Opening]
) -> bpy.types.Collection | None:
    """A portal in each opening, in a new collection of the scene; None without any."""
    if not openings:
        return None
    collection = bpy.data.collections.new(COLLECTION)
    collection[TAG] = True
    for number, opening in enumerate(openings, start=1):
        data = bpy.data.lights.new(f"Sunsplit Portal {number}", "AREA")
        data[TAG] = True
        data.shape, data.size, data.size_y = "RECTANGLE", opening.width, opening.height
        data.cycles.is_portal = True
        data.energy = 0.0  # to other engines it is a lamp
        data.use_shadow = False
        portal = bpy.data.objects.new(data.name, data)
        portal[TAG] = True
        # A lamp shines along its -Z.
        turn = np.stack([opening.across, np.cross(-opening.inwards, opening.across)], axis=1)
        axes = np.column_stack([turn, -opening.inwards])
        portal.matrix_world = Matrix.Translation(opening.centre) @ Matrix(axes.tolist()).to_4x4()
        collection.objects.link(portal)
    scene.collection.children.link(collection)
    return collection


def remove_portals(scene: bpy.types.Scene, collection: bpy.types.Collection | None) -> None:
    """Take a conversion's portals out of a scene; what another scene still uses stays there."""
    if collection is None or collection.library is not None:
        return
    if collection.name in scene.collection.children:
        scene.collection.children.unlink(collection)
    if collection.users:
        return
    portals = [thing for thing in collection.objects if thing.get(TAG)]
    for thing in collection.objects:
        if thing not in portals and thing.name not in scene.collection.objects:
            scene.collection.objects.link(thing)  # the user has put it there
    bpy.data.collections.remove(collection)
    for portal in portals:
        data = portal.data
        if portal.users == 0:
            bpy.data.objects.remove(portal)
            if data.users == 0:
                bpy.data.lights.remove(data)
