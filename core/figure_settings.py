"""What the figures of a map show, with the numbers of the paper as defaults."""

from __future__ import annotations

from dataclasses import dataclass

from .settings import BadSetting, ConversionSettings, Method


@dataclass(frozen=True)
class FigureSettings:
    """Figures 1, 2 and 3 of the paper, for any map.

    samples: of the whole map, Figure 2. lights, share: of region A, Figure 3 (a). strata: shown in
    Figure 3 (e); regions A and B do not depend on how many there are.
    residual_samples: of region B, Figure 3 (c). method: how all of them are placed; not "edge",
    which places no samples. even_samples: of a constant map, Figure 1.
    """

    samples: int = 124
    lights: int = 64
    share: float | None = 0.5
    strata: int = 8
    residual_samples: int = 493
    method: Method = "penrose"
    even_samples: int = 1024

    def __post_init__(self) -> None:
        if self.method == "edge":
            raise BadSetting('method must be one that places samples, which "edge" does not.')
        for name in ("samples", "even_samples"):
            if getattr(self, name) < 1:
                raise BadSetting(f"{name} must be at least 1, not {getattr(self, name)}.")
        _ = self.of_conversion, self.of_map  # making them checks the others

    @property
    def of_map(self) -> ConversionSettings:
        """For the samples and cells of the whole map."""
        return ConversionSettings(method=self.method, residual_samples=self.samples)

    @property
    def of_conversion(self) -> ConversionSettings:
        """The paper's way: lights without width where the samples are, a black region A."""
        return ConversionSettings(
            lights=self.lights,
            share=self.share,
            strata=self.strata,
            method=self.method,
            shape="point",
            position="sample",
            residual="voronoi",
            residual_samples=self.residual_samples,
            fill="black",
        )
