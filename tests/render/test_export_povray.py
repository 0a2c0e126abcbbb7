"""POV-Ray's renders of what is exported for it, against Cycles under the plain HDRI."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ExportSettings, export_conversion, read_skylight
from sunsplit.core.export.axes import Y_UP_LEFT, Z_UP
from tests.core.test_export_povray import TURN
from tests.exporting import MEAN, exported, shadows_agree
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.povray_renders import picture, plate, renderer, together
from tests.render.compare import estimate_of, means_agree, pixels_agree

SMOOTH = ["+A0.05", "+R3", "-J"]
"""Nine rays in a pixel where it needs them, as in the comment at the top of an exported scene."""


@pytest.fixture(scope="module", autouse=True)
def povray():
    return renderer()


@pytest.mark.parametrize(
    "options",
    [(), ("--up", "z"), ("--discs", "lights")],
    ids=["usual", "z up", "all suns as lights"],
)
def test_the_scene_that_comes_with_it(tmp_path, sunrise, usual_lights, wanted, options):
    folder = exported(usual_lights, tmp_path, "povray", *options)
    height, width = wanted.ground.shape
    found = picture(folder / f"{sunrise.stem}.scene.pov", width, height, *SMOOTH)
    # It has no noise to speak of that another seed would change.
    found = estimate_of([found] * len(wanted.picture.means))
    means_agree(wanted.picture, found, tmp_path, MEAN)
    pixels_agree(wanted.picture, found, tmp_path, slack=0.05, outliers=0.02)
    shadows_agree(wanted, found.mean)


@pytest.fixture(scope="module")
def by_axis(lights, tmp_path_factory):
    """Exports of one conversion: a folder for each axis that is up."""
    folder = tmp_path_factory.mktemp("exports")
    return {up: exported(lights, folder / up, "povray", "--up", up) for up in ("usual", "z")}


@pytest.mark.parametrize("normal", ORIENTATIONS.values(), ids=ORIENTATIONS.keys())
def test_a_white_plate(sunrise, by_axis, normal):
    normal = unit(normal)
    expected = ALBEDO / np.pi * irradiance(sunrise, normal)
    axes = {"usual": Y_UP_LEFT.of, "z": Z_UP.of}

    def seen(up):
        return plate(by_axis[up] / f"{sunrise.stem}.lights.inc", normal, axes[up])

    for up, found in zip(axes, together(seen, axes), strict=True):
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
