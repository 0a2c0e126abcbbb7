"""That what exports are held against tells shadows that are elsewhere, or not there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

pytest.importorskip("bpy")

from tests.exporting import LIKENESS, SHADOWS, Reference, shadows_of
from tests.render.compare import Estimate

HEIGHT, WIDTH = 135, 240


def picture(shadow: np.ndarray, seed: int = 1, noise: float = 0.01) -> np.ndarray:
    """A ground with a shadow, a third as bright, slightly soft and noisy."""
    light = 1 - 0.7 * gaussian_filter(shadow, 1)
    grain = np.random.default_rng(seed).normal(1, noise, light.shape)
    return np.repeat((light * grain)[..., None], 3, axis=-1)


def shapes() -> dict[str, np.ndarray]:
    rows, columns = np.indices((HEIGHT, WIDTH))
    return {
        "pole": (np.abs(columns - 90 - rows // 4) < 2).astype(float) * (rows > 40) * (rows < 100),
        "ball": (np.hypot(rows - 50, columns - 88) < 14).astype(float),
        "band": (np.abs(rows + columns - 180) < 30).astype(float),
    }


@pytest.fixture(params=["pole", "ball", "band"])
def shadow(request):
    return shapes()[request.param]


def found(shadow: np.ndarray, other: np.ndarray):
    mean = picture(shadow)
    wanted = Reference(Estimate(mean, mean, mean), np.ones((HEIGHT, WIDTH), bool))
    return shadows_of(wanted, picture(other, seed=2))


def agree(shadows) -> bool:
    return shadows.shift < SHADOWS and shadows.likeness > LIKENESS


def test_the_same(shadow):
    assert agree(found(shadow, shadow))
    assert found(shadow, shadow).shift < 0.2


@pytest.mark.parametrize("move", [(0.4, 0), (0, -0.5), (0.3, 0.3)])
def test_by_less_than_a_pixel(shadow, move):
    assert agree(found(shadow, shift(shadow, move, order=1)))


@pytest.mark.parametrize("move", [(0, 2), (0, -2), (2, 2), (0, 10), (30, -40)])
def test_elsewhere(shadow, move):
    assert not agree(found(shadow, shift(shadow, move, order=1)))


def test_not_there(shadow):
    assert not agree(found(shadow, np.zeros_like(shadow)))


def test_no_shadow_is_no_proof():
    nothing = np.zeros((HEIGHT, WIDTH))
    assert np.isnan(found(nothing, nothing).shift)
