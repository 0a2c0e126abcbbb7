from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core.sampling import (
    WorldSampling,
    choose_sampling,
    contrast,
    needs_light_tree,
)
from sunsplit.core.suns import point_sun
from tests.maps import direction, sky


def test_contrast_of_a_constant_map():
    assert contrast(sky(64, 0.7).astype(np.float32)) == pytest.approx((1, 1), rel=1e-6)


def test_contrast_of_one_lit_pixel_is_the_sphere_over_the_pixel():
    pixels = np.zeros((32, 64, 3), np.float32)
    pixels[16, 5] = 3
    solid = 2 * np.pi / 64 * 2 * np.sin(np.pi * 16.5 / 32) * np.sin(np.pi / 64)
    assert contrast(pixels) == pytest.approx((4 * np.pi / solid,) * 2, rel=1e-9)


@pytest.mark.parametrize(("part", "method"), [(0.7, "NONE"), (0.02, "MANUAL"), (1e-4, "AUTOMATIC")])
def test_the_more_peaked_the_larger_the_table(part, method):
    """A band of this part of the sphere shines; the rest is black."""
    pixels = np.zeros((256, 512, 3), np.float32)
    lit = np.random.default_rng(0).random((256, 512)) < part
    pixels[lit] = 1
    assert choose_sampling(pixels, 0).method == method


def test_what_little_suns_leave_adds_little_noise():
    pixels = np.full((64, 128, 3), 0.01, np.float32)
    pixels[20:22, 5:9] = 1
    assert choose_sampling(pixels, 0.1).method == "MANUAL"
    assert choose_sampling(pixels, 0.9).method == "NONE"


def test_without_a_residual_there_is_nothing_to_sample():
    assert choose_sampling(None, 0).method == "NONE"


def test_cells_get_a_table_as_wide_as_their_map():
    pixels = np.full((64, 128, 3), 0.01, np.float32)
    pixels[20:22, 5:9] = 900
    assert choose_sampling(pixels, 0, cells=True) == WorldSampling("MANUAL", 128)
    assert choose_sampling(sky(64, 0.7).astype(np.float32), 0, cells=True).method == "NONE"


def some_suns(strengths):
    around = np.linspace(0, 5, len(strengths))
    return [
        point_sun(np.full(3, strength), direction(np.degrees(turn), 30), 2)
        for strength, turn in zip(strengths, around, strict=True)
    ]


@pytest.mark.parametrize(("strengths", "needed"), [([1], False), ([1] * 12, False), ([9, 1], True)])
def test_suns_that_are_alike_need_no_light_tree(strengths, needed):
    assert needs_light_tree(some_suns(strengths), sum(strengths) * 1.5) is needed


def test_dozens_of_suns_are_drawn_by_lot_if_the_tree_costs_more_than_noise():
    strengths = np.linspace(1, 2, 60)
    assert not needs_light_tree(some_suns(strengths), strengths.sum())


def test_a_noisy_residual_makes_it_matter_less_how_suns_are_chosen():
    strengths = [4, 1, 1, 1, 1, 1, 1, 1]
    assert needs_light_tree(some_suns(strengths), 15)
    assert not needs_light_tree(some_suns(strengths), 15, beside=3.0)


def test_one_strong_sun_of_dozens_needs_the_light_tree():
    strengths = np.linspace(1, 2, 60)
    strengths[0] = 60
    assert needs_light_tree(some_suns(strengths), strengths.sum())
