"""Nothing is made twice, and nothing is taken for something else."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from sunsplit.core import patches
from sunsplit.core.conversion import convert
from sunsplit.core.settings import ConversionSettings
from tests.maps import direction, environment, paint_disc, sky


def sunny():
    pixels = sky(256, 0.3)
    paint_disc(pixels, direction(40, 35), 3, (900, 800, 700))
    paint_disc(pixels, direction(140, 15), 6, (90, 80, 170))
    return environment(pixels)


CHOICES = [
    {},
    {"lights": 3},
    *({"lights": lights} for lights in (4, 5, 9, 12, 16, 17, 2, 12)),
    {"lights": 6, "shape": "point"},
    *({"lights": lights, "share": 0.9} for lights in (40, 6, 70, 20)),
    {"lights": 3, "share": 0.4},
    {"tolerance": 3},
    {"share": 0.7},
    {"lights": 5, "target": "eevee"},
    {"lights": 5, "strata": 4, "method": "penrose", "per_stratum": True},
    {"fill": "black", "residual_width": 64},
    {"residual": "voronoi", "residual_samples": 50},
]


@pytest.mark.parametrize("order", [1, -1])
def test_a_map_that_was_converted_before_is_converted_as_if_it_were_not(order):
    world = sunny()
    for choice in CHOICES[::order]:
        settings = ConversionSettings(**choice)
        again, fresh = convert(world, settings), convert(sunny(), settings)
        assert len(again.suns) == len(fresh.suns)
        for one, other in zip(again.suns, fresh.suns, strict=True):
            assert (one.irradiance == other.irradiance).all()
            assert (one.to_light == other.to_light).all()
            assert one.angular_diameter == other.angular_diameter
        assert np.array_equal(again.residual, fresh.residual)
        assert again.notes == fresh.notes
        assert again.predicted_error == fresh.predicted_error


def test_another_number_of_lights_makes_no_patches_again(monkeypatch):
    world = sunny()
    convert(world, ConversionSettings(lights=1, share=0.8))
    monkeypatch.setattr(patches, "_pixels", None)  # would raise
    assert len(convert(world, ConversionSettings(lights=2, share=0.8)).suns) == 2


def test_light_is_not_summed_again_for_another_number_of_patches(monkeypatch):
    world = sunny()
    few, many = ({"lights": lights, "share": 0.9} for lights in (3, 40))
    convert(world, ConversionSettings(**few))
    counts = set()
    for one in (few, many):
        counts.add(len(convert(world, ConversionSettings(**one)).cells.taken.squares))
        monkeypatch.setattr(patches, "_pyramid", None)  # would raise
    assert len(counts) == 2


def test_what_is_kept_of_a_map_goes_with_the_map():
    world = sunny()
    convert(world)
    gone = weakref.ref(world)
    del world
    gc.collect()
    assert gone() is None
