"""The part of a map whose light reaches what is looked at.

What reaches nothing makes no noise and casts no shadow, wherever it is kept: it stays in the
residual, so that the account closes and nothing is lost if the scene changes. Only the choice of
region A leaves it out.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .environment import EnvironmentMap
from .gloss import Gloss
from .indoors import Indoors

ROWS = 18
"""Of cells, from pole to pole."""

NEAR = np.radians(11)
"""A cell is visible that has its centre so near to a direction from which light was found to come:
about a cell's width."""

WORTH = 0.01
"""As a part of the light that is known to reach something: more must not be overlooked at once."""

FEWEST_TRIALS = 30
"""Places that are asked whether a cell's light comes to them, however faint it is: what a tenth of
them can see is not overlooked."""

MOST_LOOKS = 10_000
"""To find out about cells that may be too bright to be overlooked; what takes more is visible."""

RULE_OF_THREE = 3.0
"""What was not met in n trials has, 19 times in 20, a chance of at most 3 / n (Hanley and
Lippman-Hand, If Nothing Goes Wrong, Is Everything All Right?, 1983)."""

_SIZE = 2 * ROWS, ROWS


@dataclass(frozen=True, eq=False)
class VisiblePart:
    """cells: whether light from there may reach something, bool (ROWS, 2 ROWS), rows downwards.
    through: where it is looked for through openings, the part of the half sphere above a place
    that these take. indoors: places that light reaches through openings only, if there are any.
    gloss: what a picture shows in rough gloss."""

    cells: NDArray[np.bool_]
    through: float | None = None
    indoors: Indoors | None = None
    gloss: Gloss | None = None

    @cached_property
    def key(self) -> tuple[bytes, float | None]:
        """The same for the same part of the map."""
        return self.cells.tobytes(), self.through

    @cached_property
    def whole_key(self) -> tuple[Hashable, ...]:
        """The same where it is the same to the same places, and to what shows it."""
        return *self.key, self.indoors and self.indoors.key, self.gloss and self.gloss.key

    def pixels(self, width: int, height: int) -> NDArray[np.bool_]:
        """Which pixels of a map of this size are visible, (height, width)."""
        return self.cells.ravel()[_cells_of_pixels(width, height)]

    def of(self, lum: NDArray[np.float64]) -> NDArray[np.float64]:
        """A map of luminance, (height, width), without what is not visible."""
        return lum * self.pixels(*lum.shape[::-1])


@dataclass(frozen=True, eq=False)
class Looks:
    """Looks from places that matter, in the directions of a map.

    escaped: those that met nothing but the map, unit vectors (n, 3). count: of all looks, evenly
    over the half sphere above each place. places: how many can be found. reaches: whether light
    from a direction, (3,), comes to any of so many of them.
    """

    escaped: NDArray[np.float64]
    count: int
    places: int
    reaches: Callable[[NDArray[np.float64], int], bool]


def to_indoors(
    visible: VisiblePart | None, indoors: Indoors | None, through: float | None = None
) -> VisiblePart:
    """The same, or all of a map, to places that light reaches through openings only, if they are
    known. through: where it is looked for through these, see `VisiblePart`."""
    cells = visible.cells if visible else np.ones((ROWS, 2 * ROWS), bool)
    return VisiblePart(cells, through, indoors)


def in_gloss(visible: VisiblePart | None, gloss: Gloss | None) -> VisiblePart | None:
    """The same, or all of a map, that a picture shows in rough gloss, if it does."""
    if gloss is None:
        return visible
    cells = visible.cells if visible else np.ones((ROWS, 2 * ROWS), bool)
    return VisiblePart(cells, gloss=gloss)


def visible_part(environment: EnvironmentMap, looks: Looks) -> VisiblePart | None:
    """What of a map is visible; None: all of it, or it cannot be told.

    Only what is bright and reaches nothing is left out: the rest does no harm, and the answer is
    the same from wherever one looks a little further.
    """
    if not len(looks.escaped):
        return None
    centres = sphere.pixel_centres(np.arange(2 * ROWS * ROWS), *_SIZE)
    # A row of cells at a time: of larger products BLAS makes threads, which then wait busily.
    rows = np.split(centres, ROWS)
    nearest = np.concatenate([(row @ looks.escaped.T).max(axis=1) for row in rows])
    far = nearest <= np.cos(NEAR)
    hidden = _hidden(environment, np.flatnonzero(far), looks) if far.any() else []
    if not len(hidden):
        return None
    cells = np.ones(len(far), bool)
    cells[hidden] = False
    return VisiblePart(cells.reshape(ROWS, 2 * ROWS))


def _hidden(environment: EnvironmentMap, cells: NDArray[np.intp], looks: Looks) -> NDArray[np.intp]:
    """Those of some cells, far from where light was found to come from, that are bright and proven
    to reach nothing: not so bright that to find nothing proves nothing."""
    light = light_of_cells(environment)
    size = np.repeat(sphere.row_solid_angles(*_SIZE), 2 * ROWS)
    met = (light / size)[sphere.pixels_at(looks.escaped, *_SIZE)]
    reaching = 2 * np.pi * met.sum() / looks.count
    bright = cells[light[cells] > WORTH * reaching]
    bright = bright[np.argsort(-light[bright], kind="stable")]
    trials = np.ceil(RULE_OF_THREE * light[bright] / max(WORTH * reaching, 1e-300))
    trials = np.maximum(trials, FEWEST_TRIALS)
    proven = trials <= looks.places
    proven &= np.cumsum(np.where(proven, trials, 0)) <= MOST_LOOKS
    for k in np.flatnonzero(proven):
        proven[k] = not looks.reaches(_brightest(environment, int(bright[k])), int(trials[k]))
    return bright[proven]


def light_of_cells(
    environment: EnvironmentMap, visible: VisiblePart | None = None
) -> NDArray[np.float64]:
    """Luminance of the scalar irradiance from each cell of a map, or of what is visible of it,
    (ROWS * 2 ROWS,)."""
    light = environment.once("light of cells", lambda: _light_of_cells(environment))
    return light * visible.cells.ravel() if visible else light


def _light_of_cells(environment: EnvironmentMap) -> NDArray[np.float64]:
    width, height = environment.width, environment.height
    light = environment.luminance * sphere.row_solid_angles(width, height)[:, None]
    cell = _cells_of_pixels(width, height)
    return np.bincount(cell.ravel(), light.ravel(), 2 * ROWS * ROWS)


def _brightest(environment: EnvironmentMap, cell: int) -> NDArray[np.float64]:
    """The direction of the brightest pixel in a cell that has any, (3,)."""
    width, height = environment.width, environment.height
    row, column = divmod(cell, 2 * ROWS)
    top, left = -(-row * height // ROWS), -(-column * width // (2 * ROWS))
    bottom, right = -(-(row + 1) * height // ROWS), -(-(column + 1) * width // (2 * ROWS))
    block = environment.luminance[top:bottom, left:right]
    down, across = np.unravel_index(np.argmax(block), block.shape)
    pixel = np.array([(top + down) * width + left + across])
    return sphere.pixel_centres(pixel, width, height)[0]


def _cells_of_pixels(width: int, height: int) -> NDArray[np.intp]:
    """The flat cell that each pixel of a map lies in, (height, width)."""
    rows = (np.arange(height) * ROWS) // height
    columns = (np.arange(width) * 2 * ROWS) // width
    return rows[:, None] * 2 * ROWS + columns
