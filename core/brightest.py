"""The brightest numbers of a map, found while its rows pass by: what a clipped light shows in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pixels import Strip

NEAR = 0.25
"""Of the highest number of a map: what is above is kept. Of a channel half as high as the highest
it is still all that lies above a half of its own."""

MOST = 1 << 17
"""Numbers that are kept of one strip or of one narrow map: three channels of a light 12 degrees
wide on the horizon of a map 8192 wide, of which a strip has 128 rows. Where there are more, it is
no light that is bright there but a sky, and none are kept."""


@dataclass(frozen=True, eq=False)
class Brightest:
    """Of a map or of some of its rows, the numbers above NEAR of the highest.

    highest: of each channel, (3,), whether kept or not. pixels: their flat indices in the map.
    channels: 0 to 2. values: float32. All (n,), none where there are more than MOST.
    """

    highest: NDArray[np.float32]
    pixels: NDArray[np.intp]
    channels: NDArray[np.intp]
    values: NDArray[np.float32]

    def near(self, highest: NDArray[np.float32]) -> Brightest:
        """What of it counts in a map whose highest numbers are these."""
        kept = self.values > np.float32(NEAR) * highest.max()
        return Brightest(highest, self.pixels[kept], self.channels[kept], self.values[kept])


def brightest_of_map(radiance: NDArray[np.float32]) -> Brightest:
    """Of a whole map, (height, width, 3), that is all light."""
    numbers = radiance.ravel()
    bright = numbers > np.float32(NEAR) * numbers.max()
    few = np.count_nonzero(bright) <= MOST
    places = np.flatnonzero(bright) if few else np.empty(0, np.intp)
    pixels, channels = np.divmod(places, 3)
    values = numbers[places]
    highest = np.zeros(3, np.float32)
    np.maximum.at(highest, channels, values)
    return Brightest(highest, pixels, channels, values)


def brightest_of_strip(first: int, strip: Strip, highest: NDArray[np.float32]) -> Brightest:
    """Of some rows that are all light, the first pixel of which has this flat index.

    Which are kept hangs on these rows alone: the same whatever was looked at before.
    """
    masks, count = [], 0
    for plane in strip:
        masks.append(_above(plane, np.float32(NEAR) * highest.max()))
        count += np.count_nonzero(masks[-1])
        if count > MOST:
            return nothing_kept(highest)
    places = [np.flatnonzero(mask) for mask in masks]
    values = [plane.ravel()[place] for plane, place in zip(strip, places, strict=True)]
    channels = np.repeat(np.arange(3), [len(place) for place in places])
    pixels = np.concatenate(places) + first
    return Brightest(highest, pixels, channels, np.concatenate(values).astype(np.float32))


def nothing_kept(highest: NDArray[np.float32]) -> Brightest:
    """Of rows of which only this is known."""
    none = np.empty(0, np.intp)
    return Brightest(highest, none, none, np.empty(0, np.float32))


def joined(parts: list[Brightest], highest: NDArray[np.float32]) -> Brightest:
    """Of a map, from all its parts."""
    near = [part.near(highest) for part in parts]
    return Brightest(
        highest,
        np.concatenate([part.pixels for part in near]),
        np.concatenate([part.channels for part in near]),
        np.concatenate([part.values for part in near]),
    )


def _above(plane: NDArray[np.floating], level: np.float32) -> NDArray[np.bool_]:
    if plane.dtype == np.float16:  # as integers they are in the same order, and compared faster
        return plane.view(np.uint16) > np.float16(level).view(np.uint16)
    return plane > level
