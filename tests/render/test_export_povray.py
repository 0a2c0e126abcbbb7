"""POV-Ray's renders of what is exported for it, against Cycles under the plain HDRI."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ExportSettings, export_conversion, read_skylight
from sunsplit.core.export.axes import Y_UP_LEFT, Z_UP
from tests.core.test_export_povray import TURN
from tests.exporting import MEAN, converted, exported, reference, shadows_agree
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.povray_renders import picture, plate, renderer
from tests.render.compare import estimate_of, means_agree, pixels_agree

SMOOTH = ["+A0.05", "+R3", "-J"]
"""Nine rays in a pixel where it needs them, as in the comment at the top of an exported scene."""


@pytest.fixture(scope="module", autouse=True)
def povray():
    return renderer()


@pytest.fixture(scope="module")
def wanted(sunrise, tmp_path_factory):
    return reference(sunrise, tmp_path_factory.mktemp("reference"))


@pytest.fixture(scope="module")
def lights(sunrise, tmp_path_factory):
    """A conversion whose plates are right within a tenth of what is asked here."""
    return converted(sunrise, tmp_path_factory.mktemp("conversion"), "--tolerance", "0.4")


@pytest.mark.parametrize(
    "options",
    [(), ("--up", "z"), ("--discs", "lights")],
    ids=["usual", "z up", "all suns as lights"],
)
def test_the_scene_that_comes_with_it(tmp_path, sunrise, wanted, options):
    lights = converted(sunrise, tmp_path)
    folder = exported(lights, tmp_path / "povray", "povray", *options)
    height, width = wanted.ground.shape
    found = picture(folder / f"{sunrise.stem}.scene.pov", width, height, *SMOOTH)
    # It has no noise to speak of that another seed would change.
    found = estimate_of([found] * len(wanted.picture.means))
    means_agree(wanted.picture, found, tmp_path, MEAN)
    pixels_agree(wanted.picture, found, tmp_path, slack=0.05, outliers=0.02)
    shadows_agree(wanted, found.mean)


@pytest.mark.parametrize("normal", ORIENTATIONS.values(), ids=ORIENTATIONS.keys())
def test_a_white_plate(tmp_path, sunrise, lights, normal):
    normal = unit(normal)
    for up, axes in (("usual", Y_UP_LEFT), ("z", Z_UP)):
        folder = exported(lights, tmp_path / up, "povray", "--up", up)
        found = plate(folder / f"{sunrise.stem}.lights.inc", normal, axes.of)
        expected = ALBEDO / np.pi * irradiance(sunrise, normal)
        print(f"{up}: ratio - 1 {found.mean((0, 1)) / expected - 1}")
        assert found.mean((0, 1)) == pytest.approx(expected, rel=MEAN)


def test_turned_light(tmp_path, sunrise, lights):
    """A sky that is turned about no axis in particular: suns and map turn together."""
    sky = read_skylight(lights)
    export_conversion(sky.turned(TURN), tmp_path, ExportSettings("povray"))
    for normal in (unit((0, 0, 1)), unit((1, 1, 1))):
        found = plate(tmp_path / f"{sky.name}.lights.inc", normal, Y_UP_LEFT.of)
        expected = ALBEDO / np.pi * irradiance(sunrise, TURN.T @ normal)
        assert found.mean((0, 1)) == pytest.approx(expected, rel=MEAN)
