"""Compare two noisy renders: what is left when the noise of both is taken into account."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from tests.blender import renders

MEAN = 0.003
"""Relative difference of the means of each channel that a conversion may make (issue: 0.3 %)."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Mean of independent renders and its standard error per pixel, (height, width, 3); and the
    mean of each of the renders, (seeds, 3).
    """

    mean: np.ndarray
    error: np.ndarray
    means: np.ndarray


def estimate(scene, folder: Path, samples: int, seeds: int = 4) -> Estimate:
    """Render with several seeds, so that the renders themselves say how noisy they are."""
    return estimate_of(renders(scene, folder, samples, seeds))


def estimate_of(pictures: Sequence[np.ndarray]) -> Estimate:
    """Of at least two renders, (height, width, 3) each, by different seeds."""
    images, seeds = np.stack(pictures), len(pictures)
    error = images.std(axis=0, ddof=1) / np.sqrt(seeds)
    return Estimate(images.mean(axis=0), error, images.mean(axis=(1, 2)))


def means_agree(reference: Estimate, found: Estimate, folder: Path, limit: float = MEAN) -> None:
    """Fail, and leave the pictures, when the mean of a channel differs by more than `limit`."""
    wanted, got = reference.mean.mean(axis=(0, 1)), found.mean.mean(axis=(0, 1))
    # Pairs of renders share their seed and much of their noise, and within a render Cycles spreads
    # its samples so that pixels' errors cancel: only the differences of means tell how sure we are.
    differences = found.means - reference.means
    noise = differences.std(axis=0, ddof=1) / np.sqrt(len(differences))
    ratio = got / wanted - 1
    print(f"means: reference {wanted}, found {got}, ratio - 1 {ratio}, noise {noise / wanted}")
    # A comparison whose own noise is as large as its limit would prove nothing.
    assert (noise / wanted < limit / 2).all(), "too noisy to tell: render more samples"
    if (np.abs(ratio) > limit).any():
        pictures = keep(reference, found, folder)
        raise AssertionError(f"means differ by {ratio}; pictures in {pictures}")


def pixels_agree(
    reference: Estimate, found: Estimate, folder: Path, slack: float, outliers: float = 0.01
) -> None:
    """Fail when more than `outliers` of the pixels differ by over 4 standard errors and `slack`.

    slack: relative to the mean of the reference; room for what a disc does not do like the map.
    """
    scale = reference.mean.mean()
    noise = np.hypot(reference.error, found.error)
    # Four seeds tell the noise of a pixel only roughly; its neighbourhood's tells it better.
    noise = np.maximum(noise, _blurred(noise))
    beyond = np.abs(found.mean - reference.mean) > 4 * noise + slack * scale
    part = beyond.any(axis=-1).mean()
    print(f"pixels beyond the noise: {part:.3%}")
    if part > outliers:
        pictures = keep(reference, found, folder)
        raise AssertionError(f"{part:.2%} of the pixels differ; pictures in {pictures}")


def _blurred(plane: np.ndarray) -> np.ndarray:
    from scipy.ndimage import uniform_filter

    return uniform_filter(plane, size=(5, 5, 1))


def keep(reference: Estimate, found: Estimate, folder: Path) -> Path:
    """Save reference, found and difference side by side, tone-mapped alike."""
    folder = Path(os.environ.get("SUNSPLIT_FAILURES", folder))
    folder.mkdir(parents=True, exist_ok=True)
    scale = 0.5 / max(np.median(reference.mean), 1e-9)
    difference = 0.5 + (found.mean - reference.mean) * scale
    row = np.concatenate([reference.mean * scale, found.mean * scale, difference], axis=1)
    path = folder / "reference, found, difference.png"
    Image.fromarray((np.clip(row, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)).save(path)
    return path
