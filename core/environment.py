"""A radiance map of everything around the scene, and what had to be repaired in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .errors import UnusableInput
from .memo import Memo
from .tolerances import HALF_MAXIMUM

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
"""Rec.709 luminance of linear RGB (ITU-R BT.709)."""


@dataclass(frozen=True)
class Repairs:
    """Pixels whose values were no light, counted once each by the worst of their channels."""

    nan: int = 0
    infinite: int = 0
    negative: int = 0
    negative_energy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Scalar irradiance that setting negative values to zero has added, per channel."""

    @property
    def pixels(self) -> int:
        return self.nan + self.infinite + self.negative

    def __str__(self) -> str:
        counts = [(self.nan, "NaN"), (self.infinite, "infinite"), (self.negative, "negative")]
        return ", ".join(f"{count} {name}" for count, name in counts if count) or "none"


@dataclass(frozen=True, eq=False)
class EnvironmentMap(Memo):
    """An equirectangular radiance map.

    radiance: float32 (height, width, 3), linear Rec.709, rows downwards; finite, not negative.
    name: what to call the map and what is made of it.
    """

    radiance: NDArray[np.float32]
    name: str
    file: str = ""
    sha256: str = ""
    repairs: Repairs = field(default_factory=Repairs)
    warnings: tuple[str, ...] = ()

    @property
    def repaired_share(self) -> float:
        """What setting negative values to zero has added, as a part of all luminance."""
        added = LUMINANCE_WEIGHTS @ np.array(self.repairs.negative_energy)
        return float(added / (LUMINANCE_WEIGHTS @ self.scalar_irradiance))

    @cached_property
    def luminance(self) -> NDArray[np.float64]:
        """Of each pixel, (height, width)."""
        return luminance(self.radiance)

    def narrowed(self, width: int) -> NDArray[np.float64]:
        """The map at another width, (width // 2, width, 3); see `narrowed`."""
        return self.once(("narrowed", width), lambda: narrowed(self.radiance, width))

    @cached_property
    def scalar_irradiance(self) -> NDArray[np.float64]:
        """Integral of radiance over the whole sphere, (3,)."""
        return scalar_irradiance(self.radiance)

    @property
    def height(self) -> int:
        return self.radiance.shape[0]

    @property
    def width(self) -> int:
        return self.radiance.shape[1]


def environment_from_pixels(
    pixels: NDArray[np.floating],
    name: str,
    file: str = "",
    sha256: str = "",
    warnings: tuple[str, ...] = (),
) -> EnvironmentMap:
    """Check and repair pixels (height, width, 3), linear Rec.709, into an `EnvironmentMap`.

    Raises UnusableInput when the map is not 2:1 or holds no light.
    """
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"expected pixels of shape (height, width, 3), got {pixels.shape}")
    _check_shape(pixels.shape[1], pixels.shape[0], name)
    radiance, repairs = repair(pixels)
    if not radiance.any():
        raise UnusableInput(f"{name} holds no light: every pixel is black.")
    return EnvironmentMap(radiance, name, file, sha256, repairs, warnings)


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


def repair(pixels: NDArray[np.floating]) -> tuple[NDArray[np.float32], Repairs]:
    """Values that are no light become light that does no harm; says how many there were.

    NaN: the mean of the finite neighbours, over the seam too (0 where there are none).
    +Inf: the channel's largest finite value, but at least the largest half, because that is the
    bound that an overflowing half file has passed. Negative values and -Inf: 0.
    """
    radiance = np.array(pixels, dtype=np.float32, order="C")
    # min and max carry NaN along: one pass tells whether there is anything to do.
    if np.isfinite(radiance.max()) and radiance.min() >= 0:
        return radiance, Repairs()
    nan = np.isnan(radiance)
    infinite = np.isposinf(radiance)
    negative = radiance < 0
    # Widened last: to widen a signalling NaN is an invalid operation.
    lost = -np.where(np.isfinite(radiance) & negative, radiance, 0).astype(np.float64)
    solid = sphere.row_solid_angles(radiance.shape[1], radiance.shape[0])
    radiance[negative] = 0
    for channel in range(3):
        _repair_infinite(radiance[..., channel], infinite[..., channel])
        _repair_nan(radiance[..., channel], nan[..., channel])
    has_nan, has_inf = nan.any(axis=-1), infinite.any(axis=-1)
    has_negative = negative.any(axis=-1)
    return radiance, Repairs(
        nan=int(has_nan.sum()),
        infinite=int((has_inf & ~has_nan).sum()),
        negative=int((has_negative & ~has_inf & ~has_nan).sum()),
        negative_energy=tuple(float(x) for x in np.einsum("ijk,i->k", lost, solid)),
    )


def _repair_infinite(plane: NDArray[np.float32], infinite: NDArray[np.bool_]) -> None:
    if infinite.any():
        finite = plane[np.isfinite(plane)]
        plane[infinite] = max(finite.max() if finite.size else 0.0, HALF_MAXIMUM)


def _repair_nan(plane: NDArray[np.float32], nan: NDArray[np.bool_]) -> None:
    rows, columns = np.nonzero(nan)
    if not len(rows):
        return
    height, width = plane.shape
    total = np.zeros(len(rows))
    count = np.zeros(len(rows))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            near = plane[np.clip(rows + down, 0, height - 1), (columns + right) % width]
            good = ~np.isnan(near)
            total += np.where(good, near, 0.0)
            count += good
    plane[rows, columns] = total / np.maximum(count, 1)


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
    rows = radiance.sum(axis=1, dtype=np.float64)
    return sphere.row_solid_angles(width, height) @ rows


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


def narrowed(radiance: NDArray[np.float32], width: int) -> NDArray[np.float64]:
    """A map of another width, each pixel the mean of those it replaces.

    Means are weighted by solid angle, so that every pixel keeps the light of its part of the
    sphere and the account closes. Raises UnusableInput where the width is no whole part of the
    map's.
    """
    height, own = radiance.shape[:2]
    if width > own or own % width or width % 2:
        raise UnusableInput(
            f"A residual {width} pixels wide cannot be made of a map {own} wide: "
            "the width must be even and a whole part of the map's."
        )
    step = own // width
    weight = sphere.row_solid_angles(own, height).reshape(width // 2, step, 1, 1)
    rows = radiance.reshape(width // 2, step, width, step, 3).sum(axis=3, dtype=np.float64)
    return (rows * weight).sum(axis=1) / (step * weight.sum(axis=1))
