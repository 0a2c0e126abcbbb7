from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from sunsplit.core import cli, sphere
from sunsplit.core.errors import CannotWrite
from sunsplit.core.figure_settings import FigureSettings
from sunsplit.core.files.figures import (
    draw_figures,
    even_samples,
    parts_of_strata,
    save_figures,
)
from sunsplit.core.files.maps import load
from sunsplit.core.files.sheet import (
    DOT,
    HEIGHT,
    RIM,
    SHEET,
    WIDTH,
    Panel,
    borders,
    dot_pixels,
    dotted,
    draw_sheet,
)
from sunsplit.core.samples import map_of_samples
from sunsplit.core.settings import BadSetting
from sunsplit.core.strata import stratify
from tests.files import noise, sunny, write_exr
from tests.maps import direction, environment, paint_disc, sky

NAMES = [f"map.figure{number}.png" for number in (1, 2, 3)]
FEW = FigureSettings(samples=6, lights=2, residual_samples=8, even_samples=20)
TOP, LEFT = 37, 10
"""Where the first panel begins on a sheet with one line above it."""


def run(*arguments):
    return cli.main([os.fspath(argument) for argument in arguments])


def names(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def sun_on_the_seam(width=64):
    pixels = sky(width)
    paint_disc(pixels, direction(180, 20), 8, 500)
    return pixels


def one_pixel():
    pixels = np.zeros((16, 32, 3))
    pixels[4, 0] = 5
    return pixels


MAPS = {
    "constant": sky(64),
    "tiny": noise(4).astype(float),
    "seam": sun_on_the_seam(),
    "one pixel": one_pixel(),
    "huge": sky(32) * 1e38,
}


# The command


def test_three_pictures_of_a_real_map(sunrise, tmp_path, capfd):
    few = ["--samples", "20", "--lights", "8", "--residual-samples", "30"]
    assert run("figures", sunrise, "-o", tmp_path, *few) == 0
    said, complaints = capfd.readouterr()
    stem = "spruit_sunrise_1k"
    paths = [tmp_path / f"{stem}.figure{number}.png" for number in (1, 2, 3)]
    assert said == "".join(f"wrote {path}\n" for path in paths)
    assert complaints == ""
    assert names(tmp_path) == [path.name for path in paths]
    for path, rows in zip(paths, (1, 1, 3), strict=True):
        with Image.open(path) as picture:
            assert (picture.format, picture.mode) == ("PNG", "RGB")
            assert picture.width == SHEET
            assert rows * HEIGHT < picture.height < rows * (HEIGHT + 100)


def test_options_arrive_and_json_names_the_files(tmp_path, capfd):
    path = write_exr(tmp_path / "map.exr", sunny(64))
    out = tmp_path / "out"
    numbers = ["--samples", "9", "--lights", "2", "--residual-samples", "11", "--strata", "4"]
    assert run("figures", path, "-o", out, "--json", "--share", "auto", *numbers) == 0
    said, complaints = capfd.readouterr()
    assert json.loads(said) == {"files": [str(out / name) for name in NAMES]}
    assert complaints == ""
    options = cli._parser().parse_args(["figures", "map.exr", "--share", "auto", *numbers])
    settings = cli.figure_settings_from(options)
    assert settings == FigureSettings(
        samples=9, lights=2, share=None, strata=4, residual_samples=11
    )


def test_the_defaults_are_the_papers():
    settings = cli.figure_settings_from(cli._parser().parse_args(["figures", "map.exr"]))
    assert settings == FigureSettings()
    assert (settings.samples, settings.lights, settings.residual_samples) == (124, 64, 493)
    assert (settings.share, settings.method, settings.even_samples) == (0.5, "penrose", 1024)


@pytest.mark.parametrize(
    "arguments",
    [["--method", "edge"], ["--samples", "0"], ["--share", "2"], ["--strata", "3"], ["--preview"]],
)
def test_wrong_usage_is_status_two(arguments, capfd):
    assert cli.main(["figures", "map.exr", *arguments]) == 2
    assert capfd.readouterr().err.startswith("usage: sunsplit")


@pytest.mark.parametrize(
    "wrong", [{"method": "edge"}, {"samples": 0}, {"lights": 0}, {"strata": 3}]
)
def test_settings_have_limits(wrong):
    with pytest.raises(BadSetting, match=next(iter(wrong))):
        FigureSettings(**wrong)


def test_a_bad_map_is_one_line_and_nothing_is_written(tmp_path, capfd):
    out = tmp_path / "out"
    (tmp_path / "text.hdr").write_text("no picture")
    write_exr(tmp_path / "black.exr", np.zeros((16, 32, 3), np.float32))
    write_exr(tmp_path / "square.exr", np.ones((16, 16, 3), np.float32))
    Image.fromarray(np.full((16, 32, 3), 90, np.uint8)).save(tmp_path / "ldr.png")
    for name in ("text.hdr", "black.exr", "square.exr", "ldr.png", "missing.exr"):
        assert run("figures", tmp_path / name, "-o", out, "--json") == 1
        said, complaints = capfd.readouterr()
        assert said == ""
        assert complaints.startswith("sunsplit: ")
        assert complaints.count("\n") == 1
    assert not out.exists()


def test_ldr_is_taken_when_allowed(tmp_path):
    Image.fromarray(np.full((8, 16, 3), 90, np.uint8)).save(tmp_path / "map.png")
    few = ["--samples", "9", "--lights", "3", "--residual-samples", "9"]
    assert run("figures", tmp_path / "map.png", "-o", tmp_path / "out", "--allow-ldr", *few) == 0
    assert names(tmp_path / "out") == NAMES


def test_help_waits_for_no_library():
    code = (
        "import sys; from sunsplit.core.cli import main; status = main(['figures', '--help']);"
        "heavy = {'numpy', 'scipy', 'skimage', 'OpenEXR', 'PIL', 'tqdm'};"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr); sys.exit(status)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (0, "[]\n")


# Writing


def test_all_or_nothing(tmp_path):
    pictures = [Image.new("RGB", (4, 4))] * 3
    (tmp_path / "file").write_text("mine")
    with pytest.raises(CannotWrite):
        save_figures(pictures, "map", tmp_path / "file" / "below")
    out = tmp_path / "out"
    (out / NAMES[2]).mkdir(parents=True)
    (out / NAMES[0]).write_text("old")
    with pytest.raises(CannotWrite):
        save_figures(pictures, "map", out)
    assert names(out) == [NAMES[0], NAMES[2]]
    assert (out / NAMES[0]).read_text() == "old"


# What is drawn


@pytest.mark.parametrize("name", MAPS)
def test_any_map_has_figures(name):
    for settings in (FEW, FigureSettings(1, 1, None, 2, 1, even_samples=1)):
        sizes = [picture.size for picture in draw_figures(environment(MAPS[name]), settings)]
        assert [width for width, _ in sizes] == [SHEET] * 3


@pytest.mark.parametrize("share", [0, 1])
@pytest.mark.parametrize("strata", [2, 60])
def test_one_region_may_be_empty(share, strata):
    settings = FigureSettings(3, 3, share, strata, 5, even_samples=5)
    draw_figures(environment(sun_on_the_seam()), settings)


@pytest.mark.parametrize("method", ["median-cut", "variance", "kmeans"])
def test_every_method_has_figures(method):
    settings = FigureSettings(4, 2, residual_samples=5, method=method, even_samples=8)
    draw_figures(environment(sun_on_the_seam()), settings)


def test_any_name_can_be_drawn():
    for name in ("x" * 250, "\udcff\udcfe 空"):
        draw_figures(environment(MAPS["one pixel"], name), FEW)


def test_the_same_twice(tmp_path):
    first, second = (draw_figures(environment(MAPS["seam"], "map"), FEW) for _ in range(2))
    assert [a.tobytes() for a in first] == [b.tobytes() for b in second]
    for number, pictures in enumerate((first, second)):
        save_figures(pictures, "map", tmp_path / str(number))
    for name in NAMES:
        assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "1" / name).read_bytes()


def dots(picture):
    """How many dots there are, none of which touch: groups of pixels of their colour."""
    filled = (np.asarray(picture) == DOT).all(axis=-1)
    return sphere.connected_groups(filled)[1]


@pytest.mark.parametrize("background", [(0, 0, 0), (255, 255, 255), (150, 150, 155)])
def test_dots_are_where_their_directions_are(background):
    places = [direction(a, e) for a in range(-160, 180, 40) for e in (-60, -25, 0, 40, 75)]
    places = np.array([*places, direction(180, 10)])
    picture = np.asarray(dotted(Image.new("RGB", (WIDTH, HEIGHT), background), places))
    columns, rows = dot_pixels(places)
    assert (picture[rows, columns] == DOT).all()
    assert dots(picture) == len(places)
    # Each has a rim around it, and only there is anything else than the background.
    assert (picture[rows, columns - 4] == RIM).all()
    rest = (picture == background).all(axis=-1).sum()
    assert rest > WIDTH * HEIGHT - len(places) * 100
    u, v = sphere.to_image(places)
    assert np.abs((columns + 0.5) / WIDTH - u)[:-1].max() <= 0.51 / WIDTH
    assert np.abs((rows + 0.5) / HEIGHT - v).max() <= 0.51 / HEIGHT


def test_a_dot_on_the_seam_is_on_both_sides():
    plain = Image.new("RGB", (WIDTH, HEIGHT))
    picture = np.asarray(dotted(plain, direction(180, 0)[None]))
    assert (picture[HEIGHT // 2, [0, -1]] == DOT).all()
    assert picture[:, 10:-10].max() == 0


def test_a_dot_at_a_pole_is_drawn():
    plain = Image.new("RGB", (WIDTH, HEIGHT))
    for elevation, row in ((90, 0), (-90, HEIGHT - 1)):
        picture = np.asarray(dotted(plain, direction(0, elevation)[None]))
        assert (picture[row] == DOT).all(axis=-1).any()


def test_even_samples_lie_as_dense_on_the_map_or_on_the_sphere():
    def near_poles(by_area):
        sites = even_samples("penrose", 1024, by_area)
        assert sites.shape == (1024, 3)
        return (np.abs(sites[:, 2]) > np.sin(np.radians(60))).mean()

    # A third of the map's rows, but 1 - sin 60 of the sphere.
    assert near_poles(False) == pytest.approx(1 / 3, abs=0.02)
    assert near_poles(True) == pytest.approx(1 - np.sin(np.radians(60)), abs=0.02)


def test_figure_one_shows_each_sample():
    sheet = draw_figures(environment(MAPS["one pixel"]), FEW)[0]
    assert dots(sheet) >= 2 * FEW.even_samples - 2  # near poles two may touch


def panel(sheet, column=0):
    left = LEFT + column * (WIDTH + 12)
    return np.asarray(sheet)[TOP : TOP + HEIGHT, left : left + WIDTH]


def test_figure_two_shows_samples_and_cells_at_one_exposure():
    world = environment(sky(256, (0.2, 0.3, 0.5)))
    sheet = draw_figures(world, FEW)[1]
    samples, _ = map_of_samples(world.radiance, FEW.of_map)
    assert len(samples.sites) == FEW.samples
    columns, rows = dot_pixels(samples.sites)
    for column in (0, 1):
        assert (panel(sheet, column)[rows, columns] == DOT).all()
    # The mean of any part of a constant map looks as the map does.
    above, below = panel(sheet, 0), panel(sheet, 1)
    assert (above == above[0, 0]).all(axis=-1).mean() > 0.99
    assert (below == above[0, 0]).all(axis=-1).mean() > 0.98


def test_cells_border_where_labels_change_and_not_at_the_seam():
    labels = np.zeros((HEIGHT, WIDTH), np.int32)
    labels[:, 100:200] = 1
    edge = np.asarray(borders(labels))
    assert np.flatnonzero(edge.any(axis=0)).tolist() == [99, 199]
    labels[:, 500:] = 2  # up to the seam, where 0 begins
    edge = np.asarray(borders(labels))
    assert np.flatnonzero(edge.any(axis=0)).tolist() == [99, 199, 499, WIDTH - 1]


def test_figure_three_shows_a_in_colour_and_b_without_it():
    world = environment(sun_on_the_seam(256))
    sheet = draw_figures(world, FEW)[2]
    inside = stratify(world, 0.5, 2).region_a
    row, column = (place[len(place) // 2] for place in np.nonzero(inside))
    y, x = int((row + 0.5) / 128 * HEIGHT), int((column + 0.5) / 256 * WIDTH)
    assert panel(sheet, 1)[y, x].max() == 0
    middle = HEIGHT // 2, WIDTH // 2
    assert (panel(sheet)[middle] < panel(sheet, 1)[middle] / 2).all()
    assert panel(sheet)[y - 12 : y + 12, x].max() > 200


def test_parts_of_strata_add_up_to_the_share():
    strata = stratify(environment(noise(32).astype(float)), 0.3, 6)
    light, area = parts_of_strata(strata)
    assert light.sum() == pytest.approx(1)
    assert area.sum() == pytest.approx(1)
    assert light[3:].sum() == pytest.approx(strata.share)
    assert (np.diff(area) < 0).all()  # each holds about as much light, the brighter on less


def test_titles_stay_below_their_panels():
    plain = Image.new("RGB", (WIDTH, HEIGHT), (1, 2, 3))
    long = Panel(plain, "many words " * 40 + "x" * 400)
    picture = np.asarray(draw_sheet("heading", [long, Panel(plain), Panel(plain, "short")]))
    pixels = (picture == (1, 2, 3)).all(axis=-1)
    assert pixels.sum() == 3 * WIDTH * HEIGHT
    right = slice(LEFT + WIDTH, LEFT + WIDTH + 12)
    assert (picture[:, right] == picture[0, 0]).all()  # no line reaches the next panel


def test_the_shipped_map_has_its_sun_in_region_a(sunrise):
    world = load(sunrise)
    light, area = parts_of_strata(stratify(world, 0.5, 2))
    assert light[1] > 0.4
    assert area[1] < 0.01
