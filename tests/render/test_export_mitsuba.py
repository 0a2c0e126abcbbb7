"""Mitsuba's renders of what is exported for it, against Cycles under the plain HDRI."""

from __future__ import annotations

import numpy as np
import pytest

from sunsplit.core import ExportSettings, export_conversion, mitsuba_dict, read_skylight
from sunsplit.core.export.axes import Y_UP, Z_UP
from tests.exporting import MEAN, exported, shadows_agree
from tests.mitsuba_renders import picture, plate, renderer
from tests.plates import ALBEDO, ORIENTATIONS, irradiance, unit
from tests.render.compare import estimate_of, means_agree, pixels_agree


@pytest.fixture(scope="module", autouse=True)
def mitsuba():
    return renderer()


@pytest.mark.parametrize(
    "options",
    [(), ("--up", "z"), ("--discs", "map"), ("--discs", "lights")],
    ids=["usual", "z up", "all suns in the map", "all suns as lights"],
)
def test_the_scene_that_comes_with_it(tmp_path, sunrise, usual_lights, wanted, options):
    folder = exported(usual_lights, tmp_path, "mitsuba", *options)
    scene = folder / f"{sunrise.stem}.scene.xml"
    height, width = wanted.ground.shape
    found = estimate_of([picture(scene, width, height, 48, seed) for seed in range(4)])
    means_agree(wanted.picture, found, tmp_path, MEAN)
    pixels_agree(wanted.picture, found, tmp_path, slack=0.05, outliers=0.02)
    shadows_agree(wanted, found.mean)


@pytest.fixture(scope="module")
def by_axis(lights, tmp_path_factory):
    """Exports of one conversion: a folder for each axis that is up."""
    folder = tmp_path_factory.mktemp("exports")
    return {up: exported(lights, folder / up, "mitsuba", "--up", up) for up in ("usual", "z")}


@pytest.mark.parametrize("normal", ORIENTATIONS.values(), ids=ORIENTATIONS.keys())
def test_a_white_plate(sunrise, by_axis, normal):
    normal = unit(normal)
    for up, axes in (("usual", Y_UP), ("z", Z_UP)):
        folder = by_axis[up]
        found = plate(folder / f"{sunrise.stem}.lights.xml", normal, axes.of, 400, 1)
        expected = ALBEDO / np.pi * irradiance(sunrise, normal)
        print(f"{up}: ratio - 1 {found.mean((0, 1)) / expected - 1}")
        assert found.mean((0, 1)) == pytest.approx(expected, rel=MEAN)


def test_the_dict_gives_what_the_files_give(tmp_path, sunrise, lights, mitsuba):
    """In a direction of the sky, and on a plate."""
    folder = exported(lights, tmp_path, "mitsuba")
    from_files = plate(folder / f"{sunrise.stem}.lights.xml", unit((1, 1, 1)), Y_UP.of, 64, 1)
    scene = mitsuba.load_file(str(folder / "plate.xml"))
    emitters = mitsuba_dict(read_skylight(lights))
    own = {
        "type": "scene",
        "integrator": {"type": "path"},
        "sensor": scene.sensors()[0],
        "plate": scene.shapes()[0],
        **emitters,
    }
    found = np.array(mitsuba.render(mitsuba.load_dict(own), spp=64, seed=1), float)
    assert len(emitters) == len(scene.emitters())
    assert found.mean((0, 1)) == pytest.approx(from_files.mean((0, 1)), rel=1e-3)


def test_turned_light(tmp_path, sunrise, lights, mitsuba):
    """A sky that is turned about no axis in particular: suns and map turn together."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", (20, -35, 110), degrees=True).as_matrix()
    sky = read_skylight(lights)
    export_conversion(sky.turned(turn), tmp_path, ExportSettings("mitsuba"))
    for normal in (unit((0, 0, 1)), unit((1, 1, 1))):
        found = plate(tmp_path / f"{sky.name}.lights.xml", normal, Y_UP.of, 400, 1)
        expected = ALBEDO / np.pi * irradiance(sunrise, turn.T @ normal)
        assert found.mean((0, 1)) == pytest.approx(expected, rel=MEAN)
