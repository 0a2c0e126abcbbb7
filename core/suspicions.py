"""What makes a map suspect, in plain sentences: its light is probably not what it should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .brightest import Brightest, brightest_of_map
from .conversion import Conversion
from .environment import EnvironmentMap
from .sums import weighted_sum

Floats = NDArray[np.float64]

STEP = 1 / 128
"""Of a channel's highest number: what is nearer than this to it is as high. So coarse are the steps
of Radiance's shared exponents, at worst."""

OWN_STEP = 0.5
"""Of the highest number of a map: a channel must reach so high to be looked at, as the shared
exponent is the highest channel's, and a lower channel's steps are coarser than STEP."""

FLAT = 0.25
"""Of the part of a light that shines more than half as bright as its brightest, what is flat where
it was clipped. Cut at 0.8 of its peak, a blurred sun has so much, and nearly all where it is cut
deeper; one with its peak has 0.01, and with the sun's own darkening to the limb alone 0.03."""

LEAST_FLAT = 5.0
"""Pixels of the horizon's size that are flat in one light: four are equal wherever its peak lies
in the middle between them."""

CONTRAST = 10.0
"""How much higher than the mean of its channel a clipped light is. What is flat and lower may be a
white wall, a cloud or the page of a book."""

WIDEST = np.radians(8.0)
"""Of what is flat in one light: fifteen times the sun's width. What is wider is rather a soft box,
a window or a screen, which may well be even."""

CHANNELS = ("red", "green", "blue")

FROM_BELOW = 4.0
"""How many times more light falls on what faces down than on what faces up in a map that is
suspect. Level ground in the open sends back a part of what it gets: a quarter at most of grass,
soil or asphalt, so that such a map upside down has 4 and more. Snow and bright sand upside down are
not noticed; that a map the right way up has more than 1 takes lamps or a view from the dark."""

BRIGHTER_BELOW = 1.5
"""How many times brighter than the upper half as a whole, by the mean of the root of its luminance,
in which lamps hardly count, most of the lower half of a suspect map is: that tells a sky from lamps
and soft boxes that shine upwards."""

MOST_OF_IT = 0.5
"""Of the lower half, to go by: its median."""

MANY_REPAIRED = 0.01
"""Of all pixels: so many are said even if their light is not worth it."""

MUCH_REPAIRED = 0.001
"""Of all light, added by repairs: as much as a half file may be wrong by (tolerances.ACCOUNT_HALF).
"""


def map_warnings(of: EnvironmentMap | Conversion) -> tuple[str, ...]:
    """All that the user should know of a map, in plain sentences: what was odd in its file, what
    was repaired, whether its light looks clipped or upside down."""
    environment = of.environment if isinstance(of, Conversion) else of
    return environment.once("warnings", lambda: _warnings(environment))


def _warnings(environment: EnvironmentMap) -> tuple[str, ...]:
    found = (repaired(environment), clipped(environment), upside_down(environment))
    return (*environment.warnings, *filter(None, found))


def repaired(environment: EnvironmentMap) -> str:
    """A sentence where repairs have changed the light noticeably, or are many; else ""."""
    repairs, added = environment.repairs, environment.repaired_share
    part = repairs.pixels / (environment.own_width * environment.own_height)
    if repairs.infinite:
        return (
            f"Where the map is infinite ({_pixels(repairs.infinite)}), its light is cut off: "
            "the real one gives more."
        )
    if part < MANY_REPAIRED and added < MUCH_REPAIRED:
        return ""
    verb = "was" if repairs.pixels == 1 else "were"
    return (
        f"{_pixels(repairs.pixels)} ({part:.2%}) held no light and {verb} repaired, which changed "
        f"all light by {added:.2%}: the map was damaged when it was made, resized or compressed."
    )


def clipped(environment: EnvironmentMap) -> str:
    """A sentence where the brightest light is flat instead of having a peak; else ""."""
    if environment.repairs.infinite:  # they are flat because they were repaired, and said to be so
        return ""
    if environment.reduction:
        brightest = environment.reduction.brightest
    else:
        brightest = brightest_of_map(environment.radiance)
    mean = environment.scalar_irradiance / (4 * np.pi)
    size = environment.own_width, environment.own_height
    found = {
        name: plateau
        for channel, name in enumerate(CHANNELS)
        if (plateau := _plateau(brightest, channel, mean[channel], *size))
    }
    return _clipped_sentence(found) if found else ""


@dataclass(frozen=True)
class _Plateau:
    """Pixels that are flat, the angular diameter in radians of a disc as large as the largest group
    of them, and their value."""

    pixels: int
    diameter: float
    value: float


def _clipped_sentence(found: dict[str, _Plateau]) -> str:
    largest = max(found.values(), key=lambda plateau: plateau.pixels)
    values = [f"{_number(plateau.value)} in {name}" for name, plateau in found.items()]
    if len(found) == 3 and len({plateau.value for plateau in found.values()}) == 1:
        values = [_number(largest.value)]
    return (
        f"The brightest {largest.pixels:,} pixels, {np.degrees(largest.diameter):.1f} degrees "
        f"wide, are flat at {' and '.join(values)}: unless that light is even, it was clipped when "
        "the map was made, and the real one gives more. Use a map that is not clipped, or make "
        "its suns stronger."
    )


def _plateau(
    brightest: Brightest, channel: int, mean: float, width: int, height: int
) -> _Plateau | None:
    """What is flat at the top of a channel, unless it is no light that was clipped."""
    top = float(brightest.highest[channel])
    if top < OWN_STEP * brightest.highest.max() or top < CONTRAST * mean:
        return None
    shines = (brightest.channels == channel) & (brightest.values > top / 2)
    pixels, values = brightest.pixels[shines], brightest.values[shines]
    flat = values >= top * (1 - STEP)
    solid = sphere.row_solid_angles(width, height)
    angle, least = solid[pixels // width], LEAST_FLAT * solid[height // 2]
    if angle[flat].sum() < least:  # nearly every map ends here
        return None
    group = sphere.touching(pixels, width, height)
    level, bright = np.bincount(group, angle * flat), np.bincount(group, angle)
    widest = 4 * np.pi * np.sin(WIDEST / 4) ** 2
    cut = (level >= least) & (level >= FLAT * bright) & (level <= widest)
    for one in np.flatnonzero(cut):
        cut[one] = not _is_box(pixels[flat & (group == one)], width)
    if not cut.any():
        return None
    diameter = 4 * np.arcsin(np.sqrt(level[cut].max() / (4 * np.pi)))
    return _Plateau(int((flat & cut[group]).sum()), float(diameter), top)


def _is_box(pixels: NDArray[np.intp], width: int) -> bool:
    """Whether pixels fill some rows and columns, as one does that was repeated to enlarge a map, or
    a drawn soft box; a disc leaves the corners out, except around a pole."""
    rows, columns = (len(np.unique(part)) for part in np.divmod(pixels, width))
    return len(pixels) == rows * columns and columns < width


def upside_down(environment: EnvironmentMap) -> str:
    """A sentence where the sky seems to lie below the horizon; else ""."""
    lum, size = environment.luminance, (environment.width, environment.height)
    solid, up = sphere.row_solid_angles(*size), np.cos(sphere.centroid_angles(*size)[1])
    light = lum.mean(axis=1)
    above, below = (_sum(solid * np.maximum(side * up, 0), light) for side in (1, -1))
    if below <= FROM_BELOW * above:
        return ""
    root = np.sqrt(lum[up > 0]).mean(axis=1)
    ground = (_sum(solid[up > 0], root) / solid[up > 0].sum()) ** 2
    bright = (lum[up < 0] > BRIGHTER_BELOW * ground).mean(axis=1)
    if _sum(solid[up < 0], bright) < MOST_OF_IT * solid[up < 0].sum():
        return ""
    return (
        f"{below / (above + below):.0%} of the light on level surfaces comes from below the "
        "horizon, and not only from lamps: if the map is stored upside down, turn it over."
    )


def _sum(weight: Floats, values: Floats) -> float:
    return float(weighted_sum(weight, values))


def _pixels(count: int) -> str:
    return f"{count:,} pixel" if count == 1 else f"{count:,} pixels"


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
