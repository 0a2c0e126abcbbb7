"""The account: where every bit of the map's light went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .environment import LUMINANCE_WEIGHTS, EnvironmentMap, scalar_irradiance
from .suns import Sun

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Account:
    """Scalar irradiances per channel, (3,): integrals of radiance over the sphere."""

    source: Floats
    suns: Floats
    residual: Floats

    @property
    def relative_error(self) -> Floats:
        """|suns + residual - source| / source per channel; 0 where a channel has no light."""
        missing = np.abs(self.suns + self.residual - self.source)
        return np.divide(missing, self.source, out=missing.copy(), where=self.source > 0)

    @property
    def share(self) -> float:
        """Part of the map's luminance that the suns give."""
        return float(self.suns @ LUMINANCE_WEIGHTS / (self.source @ LUMINANCE_WEIGHTS))


def settle(
    environment: EnvironmentMap, suns: Sequence[Sun], residual: NDArray[np.float32] | None
) -> Account:
    """Add up a conversion. A residual of None counts as no light."""
    given = [sun.scalar_irradiance for sun in suns]
    return Account(
        source=environment.scalar_irradiance,
        suns=np.sum(given, axis=0) if given else np.zeros(3),
        residual=np.zeros(3) if residual is None else scalar_irradiance(residual),
    )
