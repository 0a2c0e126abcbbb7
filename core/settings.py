"""What a user may choose about a conversion, with defaults and limits."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal, get_args

from .errors import SunsplitError

Method = Literal["edge", "penrose", "median-cut", "variance", "kmeans"]
Shape = Literal["disc", "point"]
Position = Literal["centroid", "sample"]
Frequency = Literal["one", "energy", "mean"]
"""F of the paper: 1; the integral of L over the sample's cell; that by the cell's area."""
ResidualKind = Literal["map", "voronoi", "none"]
ResidualWidth = int | Literal["own", "lighting"] | None
Fill = Literal["surroundings", "black"]
Target = Literal["cycles", "eevee", "both", "export"]

MOST = {"lights": 10_000, "samples": 50_000, "residual_samples": 20_000}
"""The largest numbers, for which every method is done in a minute or so on a map 1024 wide."""


TOLERANCE = 1.0
"""Predicted error, in percent of the mean irradiance, that the program allows by itself: side by
side, eyes tell about so much apart."""

OF_OWN_LIGHT = 0.05
"""And as a part of what the suns give: a few faint lights must not become one wide one."""

MOST_BY_ITSELF = {"cycles": 256, "eevee": 32, "both": 32, "export": 256}
"""So many lights at most are chosen by themselves. In EEVEE each draws and searches a shadow map of
its own, in every frame."""


class BadSetting(SunsplitError):
    """A setting outside its limits."""


@dataclass(frozen=True)
class ConversionSettings:
    """How to split a map.

    target: what the result is for. "cycles" shows the residual with its shadows; "eevee" and
        "export" (game engines) light with it from everywhere, so that more of the map becomes
        suns, and what is predicted counts the shadows that the residual lacks. "both" is Cycles
        and EEVEE with the same suns, so that the worse of the two is right.
    lights: at most so many suns, used up where they help, or None: as few as `tolerance` allows.
    tolerance: predicted error in percent of the mean irradiance (see `prediction`), at which no
        more lights are added; None: 1, and a twentieth of what the suns give, where `lights` is
        None; nothing to stop at otherwise. What a residual without shadows is wrong by, no number
        of lights mends: where the program allows an error by itself, that comes on top.
    share: the part of all light in region A, 0 to 1, or None: chosen for the map.
        0 leaves the whole map in region B; 1 turns all of it into suns and leaves no residual.
    strata: how many strata of luminance, an even number; half of them make up region A.
    method: how lights are placed in region A. "edge": in cells for the truest shadows. "penrose"
        (the paper's), "median-cut", "variance", "kmeans": samples of region A by importance, and
        a light for the cell of each.
    samples: so many are placed and clustered down to `lights`; None: as few as leave `lights` once
        those nearer than a pixel are clustered.
    per_stratum: each bright stratum is sampled on its own, and no cell reaches into another.
    shape: "disc", as wide as the light that it replaces, or "point", of no width.
    position: of a light, in the "centroid" of its cell's light or at the "sample" (paper, 2.2).
    frequency: what weighs samples that are clustered (paper, section 3): "one", the "energy" of
        their cells or its "mean" over the cell.
    residual: "map", a "voronoi" map of samples (paper, 2.3), or "none": leave the rest out.
    residual_width: pixels, a whole part of the map's width, "own" for all of them, "lighting" for
        as few as shadows and rough surfaces need, see `lighting_width`, or None: about 1,024;
        mirrors and backgrounds may show that it is not sharp.
    residual_samples: how many samples a Voronoi map is made of.
    mirrors: whether something may show the residual sharply. Where nothing does, suns in EEVEE may
        hold all light, as what is left would be without shadows.
    fill: what the residual shows in region A: its "surroundings", with only what exceeds them
        given to suns, or "black" (the paper's), with all light given to them. None: surroundings
        with the method "edge", black with the others.
    """

    target: Target = "cycles"
    lights: int | None = None
    tolerance: float | None = None
    share: float | None = None
    strata: int = 2
    method: Method = "edge"
    samples: int | None = None
    per_stratum: bool = False
    shape: Shape = "disc"
    position: Position = "centroid"
    frequency: Frequency = "energy"
    residual: ResidualKind = "map"
    residual_width: ResidualWidth = None
    residual_samples: int = 500
    mirrors: bool = True
    fill: Fill | None = None

    def __post_init__(self) -> None:
        for name, most in MOST.items():
            value = getattr(self, name)
            if value is not None and not 1 <= value <= most:
                raise BadSetting(f"{name} must be 1 to {most:,}, not {value:,}.")
        if self.tolerance is not None and not 0 < self.tolerance <= 100:
            raise BadSetting(f"tolerance must be above 0 and at most 100, not {self.tolerance:g}.")
        if self.share is not None and not 0 <= self.share <= 1:
            raise BadSetting(f"share must be 0 to 1, not {self.share:g}.")
        if self.strata < 2 or self.strata % 2:
            raise BadSetting(f"strata must be an even number from 2 up, not {self.strata}.")
        if isinstance(self.residual_width, int) and self.residual_width < 2:
            raise BadSetting(f"residual_width must be at least 2, not {self.residual_width}.")
        for name, choice in _CHOICES.items():
            if (value := getattr(self, name)) not in choice:
                options = " or ".join(f'"{option}"' for option in choice if option)
                raise BadSetting(f'{name} must be {options}, not "{value}".')

    @property
    def shadowed_residual(self) -> bool:
        """Whether the target shows the residual with its shadows, and nothing else does."""
        return self.target == "cycles"

    @property
    def in_eevee(self) -> bool:
        """Whether EEVEE shows the result: the residual is a world, with light of two orders."""
        return self.target in ("eevee", "both")

    @property
    def chooses_border(self) -> bool:
        """Whether the border of region A is put where a path tracer sees least noise."""
        return self.share is None and self.shadowed_residual

    @property
    def takes_whole_lights(self) -> bool:
        """Whether specks of region A, and more lights than are allowed, stay in the residual."""
        return self.method == "edge" and self.chooses_border

    @property
    def cuts_for_gloss(self) -> bool:
        """Whether cells are cut where rough gloss shows them: discs by "edge", for Cycles."""
        return self.method == "edge" and self.shape == "disc" and self.shadowed_residual

    @property
    def leaves_residual(self) -> bool:
        """Whether there is a rest to show: not if all light goes to suns."""
        return self.residual != "none" and self.share != 1

    @property
    def filled(self) -> Fill:
        """What the residual shows in region A, with None resolved."""
        return self.fill or ("surroundings" if self.method == "edge" else "black")

    @property
    def most_lights(self) -> int:
        """The number of lights that must not be exceeded."""
        return MOST_BY_ITSELF[self.target] if self.lights is None else self.lights

    @property
    def tolerated(self) -> float:
        """The tolerance in percent, with None resolved: see `allowed_error`."""
        return TOLERANCE if self.tolerance is None else self.tolerance

    def allowed_error(self, share: float) -> float | None:
        """The tolerance in percent for suns with this share of all light, with None resolved; None
        still where as many lights as asked for are wanted."""
        if self.lights is None and self.tolerance is None:
            return min(TOLERANCE, 100 * OF_OWN_LIGHT * share)
        return self.tolerance

    def as_dict(self) -> dict[str, object]:
        return asdict(self)


_CHOICES = {
    "target": get_args(Target),
    "method": get_args(Method),
    "shape": get_args(Shape),
    "position": get_args(Position),
    "frequency": get_args(Frequency),
    "residual": get_args(ResidualKind),
    "fill": (*get_args(Fill), None),
}
