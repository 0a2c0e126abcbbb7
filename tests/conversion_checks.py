"""What must hold of any conversion, whatever the map and the settings."""

from __future__ import annotations

import hashlib
import sys

import numpy as np

from sunsplit.core import ConversionSettings, convert
from sunsplit.core.conversion import Conversion
from sunsplit.core.tolerances import ACCOUNT, UNDERFLOW, UNIT
from tests.maps import environment
from tests.stress import CHOICES, spread


def converted(pixels: np.ndarray, chosen: ConversionSettings) -> Conversion:
    """A map's conversion, checked."""
    conversion = convert(environment(pixels), chosen)
    check_conversion(conversion)
    return conversion


def check_conversion(conversion: Conversion) -> None:
    """All of what follows."""
    check_account(conversion)
    check_suns(conversion)
    check_residual(conversion)
    for error in (conversion.predicted_error, conversion.ground_error):
        assert np.isfinite(error)
        assert error >= 0
    assert -ACCOUNT <= conversion.visible_share <= 1 + ACCOUNT


def check_account(conversion: Conversion) -> None:
    """Suns and residual hold the light of each channel, or no more where the rest is left out."""
    account, rounded = conversion.account, UNDERFLOW if _of_means(conversion) else 0.0
    missing = account.source - account.suns - account.residual
    for part in (account.source, account.suns, account.residual):
        assert np.isfinite(part).all()
        assert (part >= 0).all()
    assert (missing >= -ACCOUNT * account.source - rounded).all()
    if conversion.residual is not None or conversion.settings.share == 1:
        assert (missing <= ACCOUNT * account.source + rounded).all()


def check_suns(conversion: Conversion) -> None:
    assert len(conversion.suns) <= conversion.settings.most_lights
    for sun in conversion.suns:
        assert abs(np.linalg.norm(sun.to_light) - 1) <= UNIT
        assert 0 <= sun.angular_diameter <= np.pi
        assert np.isfinite(sun.scalar_irradiance).all()
        assert (sun.irradiance >= 0).all()
        assert (sun.irradiance <= sun.scalar_irradiance).all()
        assert sun.scalar_irradiance.any()
        assert 1 <= sun.stratum <= conversion.settings.strata


def check_residual(conversion: Conversion) -> None:
    """Light, of the size that was asked for, and never more than the map's where it is of the
    map's own pixels."""
    residual, source = conversion.residual, conversion.environment.radiance
    assert (residual is not None) == conversion.settings.leaves_residual
    if residual is None:
        return
    width = conversion.settings.residual_width or source.shape[1]
    assert residual.shape == (width // 2, width, 3)
    assert residual.dtype == np.float32
    assert np.isfinite(residual).all()
    assert (residual >= 0).all()
    if not _of_means(conversion):
        assert (residual <= source).all()


def _of_means(conversion: Conversion) -> bool:
    """Whether the residual's pixels are means of the map's."""
    own = conversion.settings.residual_width in (None, conversion.environment.width)
    return conversion.samples is not None or not own


def fingerprint(conversion: Conversion) -> str:
    """The same for the same conversion, to the last bit of everything in it."""
    account = conversion.account
    found = [account.source, account.suns, account.residual, conversion.strata.bounds]
    found += [np.array([conversion.predicted_error, conversion.ground_error])]
    for sun in conversion.suns:
        found += [sun.to_light, sun.irradiance, sun.scalar_irradiance, sun.angular_diameter]
    if conversion.residual is not None:
        found.append(conversion.residual)
    parts = b"".join(np.ascontiguousarray(one).tobytes() for one in found)
    return hashlib.sha256(parts + repr(conversion.notes).encode()).hexdigest()


THREADED = ("share 0.5", "variance")


def write_fingerprints() -> None:
    """To the standard output, of a map large enough for BLAS to use threads."""
    for name in THREADED:
        conversion = convert(environment(spread(128, -3, 3)), CHOICES[name])
        sys.stdout.write(f"{name}: {fingerprint(conversion)}\n")
