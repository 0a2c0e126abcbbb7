"""A radiance map of everything around the scene, and what had to be repaired in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .errors import UnusableInput
from .memo import Memo
from .pixels import HeldPixels, Pixels, planes_of
from .progress import Progress, silent
from .reduction import LUMINANCE_WEIGHTS, Reduction, narrowed, reduced
from .repairs import Repairs, repair
from .sums import weighted_sum

WIDE = 1024
"""Pixels of a map's width from which it is looked at narrowed: a third of a degree each, which is
less than the sun is wide, and each keeps where within it its light lies. Of four maps 4096 wide,
each with 1 to 32 lights, 15 of 16 got the same border of region A as with all pixels, one the
next."""


@dataclass(frozen=True, eq=False)
class EnvironmentMap(Memo):
    """An equirectangular radiance map.

    radiance: float32 (height, width, 3), linear Rec.709, rows downwards; finite, not negative. Of
    a map wider than WIDE it is the map narrowed, and `reduction` says what that came from.
    name: what to call the map and what is made of it.
    """

    radiance: NDArray[np.float32]
    name: str
    file: str = ""
    sha256: str = ""
    repairs: Repairs = field(default_factory=Repairs)
    warnings: tuple[str, ...] = ()
    reduction: Reduction | None = None

    @property
    def repaired_share(self) -> float:
        """What setting negative values to zero has added, as a part of all luminance."""
        added = LUMINANCE_WEIGHTS @ np.array(self.repairs.negative_energy)
        return float(added / (LUMINANCE_WEIGHTS @ self.scalar_irradiance))

    @cached_property
    def luminance(self) -> NDArray[np.float64]:
        """Of each pixel, (height, width)."""
        return luminance(self.radiance)

    def narrowed(self, width: int) -> NDArray[np.float32]:
        """The map at another width, (width // 2, width, 3), each pixel the mean of those that it
        replaces, weighted by solid angle: so each keeps the light of its part of the sphere.

        Raises UnusableInput where the width is no whole part of the map's.
        """
        if width == self.width:
            return self.radiance
        return self.once(("narrowed", width), lambda: self._narrowed(width))

    def _narrowed(self, width: int) -> NDArray[np.float32]:
        check_part(width, self.own_width)
        if self.width % width == 0:
            return narrowed(HeldPixels.of(self.radiance), width)
        return narrowed(self.pixels, width)

    @cached_property
    def scalar_irradiance(self) -> NDArray[np.float64]:
        """Integral of radiance over the whole sphere, (3,)."""
        if self.reduction:
            return self.reduction.scalar_irradiance
        return scalar_irradiance(self.radiance)

    @property
    def pixels(self) -> Pixels:
        """All pixels of the map, not narrowed."""
        return self.reduction.pixels if self.reduction else HeldPixels.of(self.radiance)

    @property
    def own_width(self) -> int:
        """Of the map before it was narrowed."""
        return self.pixels.width

    @property
    def own_height(self) -> int:
        return self.pixels.height

    @property
    def height(self) -> int:
        return self.radiance.shape[0]

    @property
    def width(self) -> int:
        return self.radiance.shape[1]


def environment_from_pixels(pixels: NDArray[np.floating], name: str) -> EnvironmentMap:
    """Check and repair pixels (height, width, 3), linear Rec.709, into an `EnvironmentMap`.

    Raises UnusableInput when the map is not 2:1 or holds no light.
    """
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"expected pixels of shape (height, width, 3), got {pixels.shape}")
    return environment_from_strips(HeldPixels.of(pixels), name)


def environment_from_strips(
    pixels: Pixels, name: str, file: str = "", progress: Progress = silent
) -> EnvironmentMap:
    """The same of pixels that may be too many to be held whole. Held ones must not change."""
    _check_shape(pixels.width, pixels.height, name)
    width = working_width(pixels.width)
    if width == pixels.width:
        planes = planes_of(next(pixels.strips(pixels.height)))
        repairs = repair(planes)
        radiance = np.stack([*planes], axis=-1)
        environment = EnvironmentMap(radiance, name, file, repairs=repairs)
    else:
        made = reduced(pixels, width, progress)
        environment = EnvironmentMap(
            made.radiance, name, file, repairs=made.repairs, reduction=made
        )
    if not environment.radiance.any():
        raise UnusableInput(f"{name} holds no light: every pixel is black.")
    return environment


def _check_shape(width: int, height: int, name: str) -> None:
    if width == 2 * height:
        return
    if width == height:
        guess = "A square map is probably an angular map (light probe)"
    elif width * 3 == height * 4 or height * 3 == width * 4 or width == 6 * height:
        guess = "These proportions are those of a cube map"
    else:
        guess = "It looks like an ordinary picture or a cropped panorama"
    raise UnusableInput(
        f"{name} is {width} x {height}, not 2:1. {guess}: "
        "convert it to an equirectangular (latitude-longitude) map first."
    )


def luminance(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Rec.709 luminance of linear RGB, float64, shape without the channels."""
    # numpy 1.26 would keep float32 here, numpy 2 would not: say it.
    out = np.multiply(radiance[..., 0], LUMINANCE_WEIGHTS[0], dtype=np.float64)
    out += np.multiply(radiance[..., 1], LUMINANCE_WEIGHTS[1], dtype=np.float64)
    out += np.multiply(radiance[..., 2], LUMINANCE_WEIGHTS[2], dtype=np.float64)
    return out


def scalar_irradiance(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Integral of radiance over the whole sphere, per channel, float64, shape (3,)."""
    height, width = radiance.shape[:2]
    # Channel by channel, which takes a tenth of the time of all at once.
    rows = [radiance[..., channel].sum(axis=1, dtype=np.float64) for channel in range(3)]
    return weighted_sum(sphere.row_solid_angles(width, height), np.stack(rows, axis=-1))


def whole_part(width: int, most: int) -> int:
    """The widest whole part of a width that is at most so wide and even, if there is one that is
    not narrower than half of that; else the width itself."""
    parts = (width // n for n in range(1, 2 * width // most + 1) if width % (2 * n) == 0)
    return next((part for part in parts if part <= most), width)


def whole_part_from(width: int, least: int) -> int:
    """The narrowest whole part of a width that is at least so wide and even, if there is one; else
    the width itself."""
    parts = (width // n for n in range(width // least, 1, -1) if width % (2 * n) == 0)
    return next(parts, width)


def working_width(width: int) -> int:
    """What a map of this width is narrowed to: WIDE or a little less; where that is no whole part
    of it, the least more that is."""
    part = whole_part(width, WIDE)
    return part if part <= WIDE else whole_part_from(width, WIDE)


def check_part(width: int, own: int) -> None:
    """Raise UnusableInput where a map cannot be narrowed to a width."""
    if width > own or own % width or width % 2:
        raise UnusableInput(
            f"A residual {width} pixels wide cannot be made of a map {own} wide: "
            "the width must be even and a whole part of the map's."
        )
