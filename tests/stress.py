"""Maps at the ends of what floats hold and of what a sphere allows, and choices of settings."""

from __future__ import annotations

from typing import get_args

import numpy as np
from hypothesis import strategies as st

from sunsplit.core import ConversionSettings
from sunsplit.core.settings import Target

FAINTEST = 2.0**-149
"""The smallest float32 above 0, a denormal."""

BRIGHTEST = float(np.finfo(np.float32).max)

WHITE, RED, BLUE = (1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)

CORNERS = {"top left": (0, 0), "top right": (0, -1), "low left": (-1, 0), "low right": (-1, -1)}
PLACES = {**CORNERS, "seam left": (4, 0), "seam right": (4, -1), "top": (0, 7), "low": (-1, 7)}


def even(width: int, value: float) -> np.ndarray:
    """One value everywhere, float32 (width / 2, width, 3)."""
    return np.full((width // 2, width, 3), value, np.float32)


def lit(sky: np.ndarray, value: object, *places: tuple) -> np.ndarray:
    """A sky with another value at some places: indices of rows and columns, slices too."""
    pixels = sky.copy()
    for place in places:
        pixels[place] = value
    return pixels


def checkerboard(width: int, dark: float, bright: float) -> np.ndarray:
    pixels = even(width, dark)
    pixels[::2, ::2] = pixels[1::2, 1::2] = bright
    return pixels


def spread(height: int, low: float, high: float, seed: int = 0) -> np.ndarray:
    """Random values even in logarithms, from 10^low to 10^high, each channel on its own."""
    random = np.random.default_rng(seed)
    return (10.0 ** random.uniform(low, high, (height, 2 * height, 3))).astype(np.float32)


def denormals(height: int, seed: int = 0) -> np.ndarray:
    """Random multiples of the smallest float, 0 among them."""
    random = np.random.default_rng(seed)
    return (random.integers(0, 9, (height, 2 * height, 3)) * FAINTEST).astype(np.float32)


def corpus() -> dict[str, np.ndarray]:
    """Maps by name, float32 (height, width, 3)."""
    ramp = (10.0 ** np.linspace(-12, 12, 32)).astype(np.float32)
    return {
        **{f"even {width}": even(width, 0.7) for width in (2, 4, 6, 16)},
        "even, faintest": even(16, FAINTEST),
        "even, brightest": even(16, BRIGHTEST),
        "checkerboard": checkerboard(16, 0, 1),
        "checkerboard, 24 decades": checkerboard(32, 1e-12, 1e12),
        **{f"one pixel, {name}": lit(even(16, 0), 1, at) for name, at in PLACES.items()},
        **{f"red, {name}": lit(even(16, 1e-6), (1e6, 0, 0), at) for name, at in CORNERS.items()},
        "blue sun": lit(even(64, 0.1), (0, 0, 1e5), (9, 0)),
        "antipodes": lit(even(64, 0.1), 1e4, (8, 5), (-9, 37)),
        "antipodes in the dark": lit(even(64, 0), 1e4, (8, 5), (-9, 37)),
        "ring at the pole": lit(even(32, 0.1), 100, (0,)),
        "ring around the pole": lit(even(32, 0.1), 100, (1,)),
        "rings around both poles": lit(even(32, 0), 100, (2,), (-3,)),
        "ramp": np.broadcast_to(ramp[:, None], (16, 32, 3)).copy(),
        "24 decades": spread(16, -12, 12),
        "all decades": spread(16, -45, 38.4),
        "all decades, three rows": spread(3, -45, 38.4, seed=5),
        "denormals": denormals(8),
        "one denormal": lit(even(16, 0), FAINTEST, (2, 3)),
        "one blue denormal": lit(even(16, 0), FAINTEST, (2, 3, 2)),
        "brightest in the dark": lit(even(16, 0), BRIGHTEST, (2, 3)),
        "brightest": lit(even(32, 1), BRIGHTEST, (2, 3)),
        "brightest in the bright": lit(
            even(32, BRIGHTEST / 2), BRIGHTEST, (slice(2, 5), slice(3, 9))
        ),
        "sun": lit(spread(32, -1, 0), 5e4, (slice(10, 12), slice(30, 32))),
        "three rows": spread(3, -3, 3),
        "one row": spread(1, -3, 3),
        "fifty rows": spread(50, -8, 0),
    }


EDGE = {
    **{f"target {target}": {"target": target} for target in get_args(Target)},
    **{f"share {share}": {"share": share} for share in (0, 0.01, 0.5, 0.95, 1)},
    "one light": {"lights": 1},
    "points": {"shape": "point", "share": 0.5},
    "black": {"fill": "black", "share": 0.5},
    "without the rest": {"residual": "none"},
    "narrower": {"residual_width": 2, "share": 0.5},
}

SAMPLED = {
    **{name: {"method": name} for name in ("penrose", "median-cut", "variance", "kmeans")},
    "each stratum": {"method": "penrose", "share": 0.5, "strata": 6, "per_stratum": True},
    "64 lights": {"method": "median-cut", "share": 1, "lights": 64},
    "means": {"method": "variance", "share": 1, "samples": 9, "frequency": "mean"},
    "at samples": {"method": "kmeans", "share": 0.5, "samples": 9, "position": "sample"},
    "surroundings": {"method": "kmeans", "share": 0.5, "fill": "surroundings"},
    "a Voronoi map": {"residual": "voronoi", "residual_samples": 5, "share": 0.5},
    "all in a Voronoi map": {"method": "kmeans", "residual": "voronoi", "share": 0},
}

CHOICES = {
    name: ConversionSettings(**{"lights": 4} | chosen) for name, chosen in (EDGE | SAMPLED).items()
}
"""With few lights, so that many maps can be converted."""


@st.composite
def extreme_maps(draw: st.DrawFn) -> np.ndarray:
    """Random maps: few values or many, over any decades, some pixels black, some lights added."""
    height = draw(st.sampled_from([1, 2, 3, 5, 8, 16]))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    low = draw(st.sampled_from([-45.0, -38, -12, -3, 0, 30]))
    high = min(low + draw(st.sampled_from([0.0, 1, 24, 84])), 38.5)
    exponent = random.uniform(low, high, (height, 2 * height, 3))
    if draw(st.booleans()):
        exponent[:] = exponent[..., :1]  # grey
    levels = draw(st.sampled_from([None, 1, 2, 5]))
    if levels:  # ties
        exponent = low + np.round((exponent - low) / max(high - low, 1) * levels) * (
            max(high - low, 1) / levels
        )
    pixels = 10.0 ** np.minimum(exponent, 38.5)
    pixels *= random.random((height, 2 * height, 1)) >= draw(st.sampled_from([0.0, 0.5, 0.97]))
    for _ in range(draw(st.integers(0, 3))):
        at = draw(st.integers(0, height - 1)), draw(st.integers(0, 2 * height - 1))
        tint = np.array(draw(st.sampled_from([WHITE, RED, BLUE])))
        pixels[at] += tint * 10.0 ** draw(st.integers(-45, 38))
    pixels = np.minimum(pixels, BRIGHTEST).astype(np.float32)
    if not pixels.any():
        pixels[0, 0] = FAINTEST
    return pixels


@st.composite
def any_choices(draw: st.DrawFn) -> ConversionSettings:
    """Any settings, with few lights."""
    return ConversionSettings(
        target=draw(st.sampled_from(get_args(Target))),
        lights=draw(st.integers(1, 8)),
        tolerance=draw(st.none() | st.floats(0.01, 10)),
        share=draw(st.none() | st.sampled_from([0, 0.01, 0.5, 0.95, 1]) | st.floats(0, 1)),
        strata=draw(st.sampled_from([2, 4, 6])),
        method=draw(st.sampled_from(["edge", "penrose", "median-cut", "variance", "kmeans"])),
        samples=draw(st.none() | st.integers(1, 20)),
        per_stratum=draw(st.booleans()),
        shape=draw(st.sampled_from(["disc", "point"])),
        position=draw(st.sampled_from(["centroid", "sample"])),
        frequency=draw(st.sampled_from(["one", "energy", "mean"])),
        residual=draw(st.sampled_from(["map", "voronoi", "none"])),
        residual_width=draw(st.sampled_from([None, 2])),
        residual_samples=draw(st.integers(1, 20)),
        fill=draw(st.sampled_from([None, "surroundings", "black"])),
    )
