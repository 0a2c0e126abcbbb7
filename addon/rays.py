"""Rays through a scene at the frames that are looked at: from where light reaches what the camera
sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.visible import Looks
from .moments import Moment, Place, Sight
from .steps import Steps

PLACES = 300
"""Where paths through the picture end that tell what is visible: three looks from each meet most
of it. What is bright and was not met is asked for by itself."""

LEAST_PLACES = 100
"""In each of several frames, as those next to each other show nearly the same."""

ENOUGH, FEWEST = 200, 60
"""So many looks that escaped, over all frames so far, suffice with so few places in each."""

PATHS = 2
"""So many for each of the places that are wanted, at most: some pictures show little but the
world."""

MOST_PLACES = 10_000
"""In each frame, if it must be known that something bright reaches none of them."""

BOUNCES = 3
"""So often does a path go on; later ones bring little light."""

LOOKS = 3
"""Rays from every place on a path, of which one goes on."""


@dataclass(frozen=True)
class Reach:
    """Places that light to the camera comes from, and directions of rays from there to the world,
    in the scene's axes, with the number of the place; met: what others have met. Those of all
    frames that are looked at. More places are found when they are asked for; always the same."""

    sight: Sight
    places: list[Place] = field(default_factory=list)
    escaped: list[Vector] = field(default_factory=list)
    started: list[int] = field(default_factory=list)
    met: list[Place] = field(default_factory=list)
    random: Random = field(default_factory=lambda: Random(0))  # numpy's takes longer for few

    @classmethod
    def steps(cls, sight: Sight) -> Steps[Reach]:
        """Paths are followed until enough of the scene is known."""
        found = cls(sight)
        each = max(PLACES // len(sight.moments), LEAST_PLACES)
        for moment in sight.moments:
            yield from found._find(moment, each, PATHS * each, ENOUGH)
        return found

    def looks(self, to_map: NDArray[np.float64], run: Callable[[Steps], Any]) -> Looks:
        """In the axes of a map; to_map: rotation (3, 3) from the scene's. run: runs steps where
        rays may be cast, and returns their result."""
        return Looks(
            np.array(self.escaped, dtype=np.float64).reshape(-1, 3) @ to_map.T,
            LOOKS * len(self.places),
            MOST_PLACES if self.places else 0,
            lambda direction, count: run(self.is_reached(Vector(to_map.T @ direction), count)),
        )

    def is_reached(self, direction: Vector, count: int) -> Steps[bool]:
        """Whether light from a direction comes to any of so many places in any frame, or may do."""
        for moment in self.sight.moments:
            yield from self._find(moment, count, count)
            places = [place for place in self.places if place.moment == moment.number]
            if len(places) < count:
                return True  # it cannot be told
            for k in np.linspace(0, len(places), count, endpoint=False).astype(int):
                place = places[k]
                if place.normal.dot(direction) > 0 and moment.cast(place.point, direction) is None:
                    return True
                yield
        return False

    def _find(self, moment: Moment, count: int, paths: int, enough: float = np.inf) -> Steps[None]:
        """Follow paths until so many places are known in a moment, or so many looks escaped; a path
        that meets nothing finds none."""
        known = sum(place.moment == moment.number for place in self.places)
        for _ in range(paths):
            if known >= (count if len(self.escaped) < enough else FEWEST):
                return
            before = len(self.places)
            self.follow_another(moment)
            known += len(self.places) - before
            yield

    def follow_another(self, moment: Moment) -> None:
        """A path from the camera, through another point of its picture."""
        start, direction = moment.view.ray(self.random.random(), self.random.random())
        passed: list[Place] = []
        place = moment.cast(start, direction, passed)
        for side in passed:
            self._look_around(moment, side)
        for _ in range(BOUNCES):
            if place is None:
                return
            place = self._look_around(moment, place)

    def _look_around(self, moment: Moment, place: Place) -> Place | None:
        """Note a place, and the last one that some rays over its surface meet."""
        self.places.append(place)
        last = None
        normal = self.random.gauss
        for _ in range(LOOKS):
            direction = Vector((normal(0, 1), normal(0, 1), normal(0, 1))).normalized()
            if direction.dot(place.normal) < 0:
                direction = -direction
            found = moment.cast(place.point, direction)
            if found is None:
                self.escaped.append(direction)
                self.started.append(len(self.places) - 1)
            else:
                self.met.append(found)
            last = found or last
        return last
