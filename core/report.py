"""A conversion in lines for people."""

from __future__ import annotations

import numpy as np

from .conversion import Conversion
from .environment import LUMINANCE_WEIGHTS, EnvironmentMap
from .files.conversion import WrittenFiles, account_of_files
from .suspicions import map_warnings

LISTED = 32
"""Suns that are listed one by one; the files hold them all."""


def info_lines(conversion: Conversion) -> list[str]:
    """What a map holds, and what suns it would give."""
    mean = conversion.account.source @ LUMINANCE_WEIGHTS / (4 * np.pi)
    contrast = conversion.strata.luminance.max() / mean
    return [
        *_map_lines(conversion.environment),
        f"brightest pixel {contrast:,.0f} times the mean luminance",
        *_sun_lines(conversion),
    ]


def conversion_lines(conversion: Conversion, files: WrittenFiles) -> list[str]:
    """What was read, made and written; the account as computed and added up from the files."""
    paths = (files.lights, files.residual, files.samples, files.preview)
    return [
        *_map_lines(conversion.environment),
        *_sun_lines(conversion),
        _account_line(conversion, files),
        *(f"wrote {path}" for path in paths if path),
        *(f"removed {path}, which was of an older conversion" for path in files.removed),
    ]


def _map_lines(environment: EnvironmentMap) -> list[str]:
    lines = [f"{environment.file}: {environment.own_width} x {environment.own_height}"]
    if environment.repairs.pixels:
        added = environment.repaired_share
        lines.append(f"repaired pixels: {environment.repairs} (light changed by {added:.3%})")
    return lines + [f"warning: {warning}" for warning in map_warnings(environment)]


def _sun_lines(conversion: Conversion) -> list[str]:
    all_light = conversion.account.source @ LUMINANCE_WEIGHTS
    noun = "sun" if len(conversion.suns) == 1 else "suns"
    lines = [f"{len(conversion.suns)} {noun} with {conversion.account.share:.1%} of all light"]
    for rank, sun in enumerate(conversion.suns[:LISTED], start=1):
        part = sun.scalar_irradiance @ LUMINANCE_WEIGHTS / all_light
        x, y, z = sun.to_light
        elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
        azimuth = np.degrees(np.arctan2(y, x)) % 360
        lines.append(
            f"  {rank:3d}  {part:7.2%}  azimuth {azimuth:6.2f}°  elevation {elevation:+6.2f}°"
            f"  {np.degrees(sun.angular_diameter):6.2f}° wide"
        )
    if len(conversion.suns) > LISTED:
        lines.append(f"       and {len(conversion.suns) - LISTED} more")
    if conversion.suns:
        walls = conversion.standing_error
        lines.append(
            f"predicted to be right within {conversion.predicted_error:.2%} under shadows, "
            f"{conversion.ground_error:.2%} on level ground"
            + ("" if walls is None else f", {walls:.2%} on walls")
        )
    return [*lines, *conversion.notes]


def _account_line(conversion: Conversion, files: WrittenFiles) -> str:
    if files.residual is None:
        return (
            f"no residual map: {max(1 - conversion.account.share, 0):.1%} of all light is left out"
        )
    computed = conversion.account.relative_error.max()
    again = account_of_files(files.lights).relative_error.max()
    return (
        f"account: suns + residual = source within {computed:.1e}; "
        f"read again from the files {again:.1e}"
    )
