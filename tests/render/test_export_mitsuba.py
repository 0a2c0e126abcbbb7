"""Mitsuba's renders of what is exported for it, against Cycles under the plain HDRI."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core.export.axes import Y_UP, Z_UP
from tests.exporting import MEAN, converted, exported, reference, shadows_agree
from tests.mitsuba_renders import picture, plate, renderer
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.render.compare import estimate_of, means_agree, pixels_agree


@pytest.fixture(scope="module", autouse=True)
def mitsuba():
    return renderer()


@pytest.fixture(scope="module")
def wanted(sunrise, tmp_path_factory):
    return reference(sunrise, tmp_path_factory.mktemp("reference"))


@pytest.mark.parametrize("options", [(), ("--up", "z"), ("--discs", "map"), ("--discs", "lights")])
def test_the_scene_that_comes_with_it(tmp_path, sunrise, wanted, options):
    lights = converted(sunrise, tmp_path)
    scene = (
        exported(lights, tmp_path / "mitsuba", "mitsuba", *options) / f"{sunrise.stem}.scene.xml"
    )
    height, width = wanted.ground.shape
    found = estimate_of([picture(scene, width, height, 64, seed) for seed in range(2)])
    ratio = found.mean.mean((0, 1)) / wanted.picture.mean.mean((0, 1)) - 1
    print(ratio)
    shadows_agree(wanted, found.mean)
