"""What is written for pbrt-v4, read by the rules of its format and added up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sunsplit.core import (
    ConversionSettings,
    ExportSettings,
    convert,
    export_conversion,
    load,
    skylight_of,
    sphere,
)
from sunsplit.core.environment import scalar_irradiance
from sunsplit.core.export.axes import Y_UP, Z_UP
from sunsplit.core.export.emitters import emitters_of
from sunsplit.core.export.lookup import look_up
from sunsplit.core.export.octahedral import from_sphere, light_of_octahedral, octahedral, to_sphere
from tests.pbrt_files import infinite_of, pixels_of, read_lights, read_scene, tokens
from tests.pbrt_files import irradiance as irradiance_by_pbrt
from tests.plates import ORIENTATIONS, irradiance, unit

HALF = 5e-4
"""What a half float may be wrong by."""


@pytest.fixture(scope="module")
def conversion(sunrise):
    return convert(load(sunrise), ConversionSettings(tolerance=0.4))


@pytest.fixture(scope="module")
def sky(conversion):
    return skylight_of(conversion)


@pytest.fixture(scope="module")
def written(sky, tmp_path_factory):
    """By which axis is up: the statements, the pixels of the map and the lights' file."""
    found = {}
    for up in ("usual", "y"):
        folder = tmp_path_factory.mktemp(up)
        files = export_conversion(sky, folder, ExportSettings("pbrt", up))
        statements = read_lights(files.lights)
        map_of_lights = folder / infinite_of(statements).parameters["filename"]
        assert map_of_lights == files.map
        found[up] = statements, pixels_of(map_of_lights), files.lights
    return found


def directions(count, seed=1):
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def light_from(statements, radiance, to_light):
    """Radiance that pbrt's infinite light has in directions of the world, (n, 3): its pixels are
    not blended."""
    inner = to_light @ infinite_of(statements).transform[:3, :3]
    s, t = from_sphere(inner)
    side = len(radiance)
    column, row = (np.minimum((p * side).astype(int), side - 1) for p in (s, t))
    return radiance[row, column]


def test_the_square_covers_the_sphere_evenly():
    """Each place comes back, areas are equal, and the known corners are where pbrt has them."""
    found = directions(1000)
    s, t = from_sphere(found)
    assert to_sphere(s, t) == pytest.approx(found, abs=1e-9)
    assert to_sphere(0.5, 0.5) == pytest.approx(np.array([0, 0, 1]))
    for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
        assert to_sphere(*corner) == pytest.approx(np.array([0, 0, -1]), abs=1e-12)
    assert to_sphere(1, 0.5) == pytest.approx(np.array([1, 0, 0]), abs=1e-12)
    assert to_sphere(0.5, 1) == pytest.approx(np.array([0, 1, 0]), abs=1e-12)
    places = (np.arange(512) + 0.5) / 512
    even = to_sphere(places[None, :], places[:, None]).reshape(-1, 3)
    assert even.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    assert even.T @ even / len(even) == pytest.approx(np.eye(3) / 3, abs=1e-5)
    # By Archimedes heights are even, too; from one diagonal to the next they differ by 4 / 512.
    heights = np.sort(even[:, 2])
    assert heights == pytest.approx(np.linspace(-1, 1, len(heights)), abs=4 / 512)


def test_the_octahedral_map_holds_the_map_s_light(sky):
    made = octahedral(sky.radiance, has_cells=False)
    assert light_of_octahedral(made) == pytest.approx(scalar_irradiance(sky.radiance), rel=1e-6)


def test_a_constant_map_stays_constant():
    made = octahedral(np.full((64, 128, 3), 0.3, np.float32), has_cells=False)
    assert made == pytest.approx(np.full_like(made, 0.3), rel=1e-5)


def test_a_thousand_directions(written, sky):
    """Each is within what the map has around it, by the width of a pixel, and all are unbiased."""
    statements, radiance, _ = written["usual"]
    emitters = emitters_of(sky, "many rays", "auto")
    seen = directions(1000)
    found = light_from(statements, radiance, seen)
    expected = look_up(emitters.radiance, seen, has_cells=False)
    spread = 1.5 * np.pi / emitters.radiance.shape[0]
    first, second = sphere.tangents(seen)
    around = [expected]
    for away in spread * np.linspace(0.2, 1, 5):
        for turn in np.arange(16) * (np.pi / 8):
            aside = np.cos(turn) * first + np.sin(turn) * second
            around.append(look_up(emitters.radiance, seen + away * aside, False))
    around = np.stack(around)
    low, high = around.min(axis=0), around.max(axis=0)
    assert (found >= low * (1 - 2 * HALF)).all()
    assert (found <= high * (1 + 2 * HALF)).all()
    assert np.median(np.abs(found / expected - 1)) < 0.01
    assert found.mean(axis=0) == pytest.approx(expected.mean(axis=0), rel=0.005)


def test_cells_of_a_voronoi_map_are_not_blended(sunrise):
    conversion = convert(load(sunrise), ConversionSettings(residual="voronoi"))
    made = octahedral(conversion.residual, has_cells=True)
    shades = {tuple(pixel) for pixel in conversion.residual.reshape(-1, 3)}
    assert light_of_octahedral(made) == pytest.approx(
        scalar_irradiance(conversion.residual), rel=1e-6
    )
    assert len(shades) < 600
    # Most of its pixels lie within a cell: they have that cell's radiance, but for the factor that
    # keeps the whole.
    cells = np.array(sorted(shades))
    near = np.abs(made.reshape(-1, 1, 3)[::4001] / np.maximum(cells, 1e-9) - 1).max(-1).min(-1)
    assert (near < 1e-3).mean() > 0.7


@pytest.mark.parametrize("normal", ORIENTATIONS.values(), ids=ORIENTATIONS.keys())
@pytest.mark.parametrize("up", ["usual", "y"])
def test_a_plate_gets_what_the_hdri_gives(written, sunrise, normal, up):
    """From the files alone: every distant light and every pixel of the infinite one."""
    axes = Z_UP if up == "usual" else Y_UP
    normal = unit(normal)
    found = irradiance_by_pbrt(written[up][2], axes.of(normal))
    expected = irradiance(sunrise, normal)
    print(found / expected - 1)
    assert found == pytest.approx(expected, rel=0.005)


def test_the_scene_is_by_the_rules(tmp_path, sky):
    export_conversion(sky, tmp_path, ExportSettings("pbrt"))
    statements = read_scene(tmp_path / f"{sky.name}.scene.pbrt")
    kinds = [(s.directive, s.kind) for s in statements if s.kind]
    assert kinds.count(("Shape", "trianglemesh")) == 3
    assert kinds.count(("Shape", "sphere")) == 1
    assert kinds.count(("LightSource", "infinite")) == 1
    assert kinds.index(("LightSource", "infinite")) > kinds.index(("Film", "rgb"))
    for shape in (s for s in statements if s.kind == "trianglemesh"):
        corners = shape.parameters["P"].reshape(-1, 3)
        triangles = shape.parameters["indices"].reshape(-1, 3)
        assert triangles.max() < len(corners)
        # All sides look outwards: away from the middle, or up.
        a, b, c = corners[triangles].transpose(1, 0, 2)
        outwards = (a + b + c) / 3 - (corners.mean(axis=0) - (0, 0, 1e-3))
        assert (np.sum(np.cross(b - a, c - a) * outwards, axis=-1) > 0).all()


@pytest.mark.parametrize("name", ['a "quoted" sky', "back\\slash", "Himmel über Köln", "a # b"])
def test_any_name(tmp_path, sky, name):
    small = replace(sky, name=name, radiance=np.ones((4, 8, 3), np.float32))
    export_conversion(small, tmp_path, ExportSettings("pbrt"))
    statements = read_scene(tmp_path / f"{name}.scene.pbrt")
    assert (tmp_path / infinite_of(statements).parameters["filename"]).is_file()


def test_the_reader_refuses_what_pbrt_would():
    """So that the tests above can fail."""
    with pytest.raises(ValueError, match="no token"):
        tokens('Include "never ends')


@pytest.mark.parametrize(
    "text",
    [
        'LightSource "sun"',
        'LightSource "distant" "rgb colour" [ 1 1 1 ]',
        'LightSource "distant" "rgb L" [ 1 1 ]',
        'LightSource "distant" "float from" [ 0 ]',
        'LightSource "distant" "rgb L" [ nan 1 1 ]',
        'Camera "perspective"',
        "AttributeBegin",
        "Transform [ 1 2 3 ]",
    ],
)
def test_and_what_it_would_not_understand(tmp_path, text):
    path = tmp_path / "wrong.pbrt"
    path.write_text(text)
    with pytest.raises((ValueError, IndexError)):
        read_lights(path)
