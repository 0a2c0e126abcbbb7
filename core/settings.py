"""What a user may choose about a conversion, with defaults and limits."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

from .errors import SunsplitError

ResidualKind = Literal["map", "none"]


class BadSetting(SunsplitError):
    """A setting outside its limits."""


@dataclass(frozen=True)
class ConversionSettings:
    """How to split a map.

    lights: at most so many suns.
    share: the part of all light in region A, above 0 up to 1, or None: chosen for the map.
        1 turns the whole map into suns and leaves no residual.
    strata: how many strata of luminance, an even number; half of them make up region A.
    residual: "map", or "none" to leave the rest of the light out.
    residual_width: pixels, a whole part of the map's width, or None for the map's own.
    """

    lights: int = 16
    share: float | None = None
    strata: int = 2
    residual: ResidualKind = "map"
    residual_width: int | None = None

    def __post_init__(self) -> None:
        if self.lights < 1:
            raise BadSetting(f"lights must be at least 1, not {self.lights}.")
        if self.share is not None and not 0 < self.share <= 1:
            raise BadSetting(f"share must be above 0 and at most 1, not {self.share:g}.")
        if self.strata < 2 or self.strata % 2:
            raise BadSetting(f"strata must be an even number from 2 up, not {self.strata}.")
        if self.residual not in ("map", "none"):
            raise BadSetting(f'residual must be "map" or "none", not "{self.residual}".')

        if self.residual_width is not None and self.residual_width < 2:
            raise BadSetting(f"residual_width must be at least 2, not {self.residual_width}.")

    def as_dict(self) -> dict[str, object]:
        return asdict(self)
