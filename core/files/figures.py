"""Figures 1, 2 and 3 of the paper for any map: samples, their cells, and the two regions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .. import sphere
from ..conversion import Conversion, convert
from ..environment import EnvironmentMap, luminance
from ..figure_settings import FigureSettings
from ..placement.placement import method_named
from ..progress import Progress, silent
from ..region import RegionLight, light_of_map
from ..samples import MapOfSamples, map_of_samples, no_samples
from ..settings import Method
from ..strata import Strata
from ..voronoi import label_map
from .atomic import written_together
from .preview import INK, PAPER, REGION, middle_of, most, outline, tone_mapped
from .sheet import (
    HEIGHT,
    WIDTH,
    Colour,
    Panel,
    averaged,
    borders,
    dotted,
    draw_sheet,
    key,
    picked,
    stamped,
)

Floats = NDArray[np.float64]

EVEN = (150, 150, 155)
"""What the constant map of Figure 1 looks like."""

DARKENED = 0.3
"""How bright region B is where region A is shown."""

DETAIL = 176
"""Pixels of the square in which a small region A is shown again."""

SMALL = 0.01
"""Part of the picture below which region A is."""

BORDER = (0, 0, 0)


def draw_figures(
    environment: EnvironmentMap,
    settings: FigureSettings | None = None,
    progress: Progress = silent,
) -> tuple[Image.Image, Image.Image, Image.Image]:
    """The three sheets, sRGB."""
    settings = settings or FigureSettings()
    progress("figure 1", 0.0)
    first = _draw_even(settings)
    progress("figure 2", 0.1)
    looks = _Looks(environment)
    samples, _ = map_of_samples(environment.radiance, settings.of_map)
    second = _draw_samples(looks, samples, settings)
    progress("figure 3", 0.4)
    third = _draw_regions(looks, convert(environment, settings.of_conversion), settings)
    progress("done", 1.0)
    return first, second, third


def save_figures(pictures: Sequence[Image.Image], name: str, folder: str | Path) -> list[Path]:
    """Write `<name>.figure1.png` and so on: all of them, or none. Raises CannotWrite."""
    folder = Path(folder)
    names = [f"{name}.figure{number}.png" for number in range(1, len(pictures) + 1)]
    with written_together(folder, names) as drafts:
        for picture, draft in zip(pictures, drafts, strict=True):
            picture.save(draft)
    return [folder / name for name in names]


def even_samples(method: Method, count: int, by_area: bool) -> Floats:
    """Samples of a constant map, unit vectors (count, 3): as dense on the sphere, or on the map."""
    width, height = WIDTH // 2, HEIGHT // 2  # fine enough, and quick with every method
    if by_area:
        light = light_of_map(np.ones((height, width, 3), np.float32))
    else:
        light = RegionLight(np.arange(height * width), np.ones((height * width, 3)), width, height)
    return method_named(method)(light, count).sites


def parts_of_strata(strata: Strata) -> tuple[Floats, Floats]:
    """The part of all light and of the sphere's area in each stratum, both (strata,)."""
    height, width = strata.luminance.shape
    solid = sphere.row_solid_angles(width, height)
    number = np.searchsorted(strata.bounds, strata.luminance).ravel()
    light = np.bincount(number, (strata.luminance * solid[:, None]).ravel(), strata.count)
    area = np.bincount(number, np.repeat(solid, width), strata.count)
    return light / light.sum(), area / area.sum()


class _Looks:
    """How a map and what is made of it look, at one exposure.

    pixels: sRGB bytes of the map (H, W, 3). map: the same as a panel.
    """

    def __init__(self, environment: EnvironmentMap) -> None:
        # A file's name may hold bytes that are no text, and those cannot be drawn.
        name = environment.name.encode(errors="replace").decode()
        name = name if len(name) <= 60 else f"{name[:59]}…"
        self.name = f"{name}, {environment.own_width} x {environment.own_height}"
        self.middle = middle_of(luminance(environment.radiance))
        self.pixels = tone_mapped(environment.radiance, self.middle)
        self.map = averaged(self.pixels)

    def cells(self, samples: MapOfSamples) -> Image.Image:
        """The Voronoi map with the borders of its cells and its sites."""
        height, width = samples.radiance.shape[:2]
        picture = Image.fromarray(tone_mapped(picked(samples.radiance), self.middle))
        if len(samples.sites):
            labels = picked(label_map(samples.sites, width, height))
            picture.paste(BORDER, mask=borders(labels))
        return dotted(picture, samples.sites, 0.7)

    def region_a(self, strata: Strata, suns: Floats) -> Image.Image:
        """Region A in its colours with suns (n, 3), the rest darkened.

        The brightest part of a small one is shown again, enlarged, in the corner where that
        hides least of it.
        """
        dark = (self.pixels * DARKENED).astype(np.uint8)
        pixels = np.where(strata.region_a[..., None], self.pixels, dark)
        picture = averaged(pixels)
        picture.paste(REGION, mask=outline(strata.region_a, WIDTH))
        picture = dotted(picture, suns)
        inside = most(strata.region_a, WIDTH)
        detail = _detail(pixels, strata, suns) if inside.mean() < SMALL else None
        if detail:
            corners = [(x, y) for y in (0, HEIGHT - DETAIL) for x in (0, WIDTH - DETAIL)]
            hidden = [inside[y : y + DETAIL, x : x + DETAIL].sum() for x, y in corners]
            picture.paste(detail, corners[int(np.argmin(hidden))])
        return picture

    def region_b(self, strata: Strata) -> Image.Image:
        """The map with region A black."""
        return averaged(np.where(strata.region_a[..., None], np.uint8(0), self.pixels))


def _draw_even(settings: FigureSettings) -> Image.Image:
    """Figure 1: what the correction by area changes."""
    count, plain = settings.even_samples, Image.new("RGB", (WIDTH, HEIGHT), EVEN)
    titles = {
        False: "(a) importance constant on the map",
        True: "(b) importance corrected by area: times each pixel's solid angle",
    }
    panels = [
        Panel(dotted(plain, even_samples(settings.method, count, by_area)), title)
        for by_area, title in titles.items()
    ]
    heading = f"Figure 1. {count} samples of a constant map, placed by {settings.method}."
    return draw_sheet(heading, panels)


def _draw_samples(looks: _Looks, samples: MapOfSamples, settings: FigureSettings) -> Image.Image:
    """Figure 2: samples of the whole map, and their cells."""
    left = _left(len(samples.sites), settings.samples, "samples")
    panels = [
        Panel(dotted(looks.map, samples.sites), f"(a) {left}"),
        Panel(
            looks.cells(samples), "(b) their Voronoi cells on the sphere, each its mean radiance"
        ),
    ]
    heading = f"Figure 2. {looks.name}: sampled by luminance x solid angle, {settings.method}."
    return draw_sheet(heading, panels)


def _draw_regions(looks: _Looks, split: Conversion, settings: FigureSettings) -> Image.Image:
    """Figure 3: the map cut in two by luminance, and what becomes of either part."""
    strata = split.strata
    rest = split.samples or no_samples(split.environment.radiance)
    light, area = (part[strata.count // 2 :].sum() for part in parts_of_strata(strata))
    suns = np.array([sun.to_light for sun in split.suns]).reshape(-1, 3)
    lights = _left(len(suns), settings.lights, "lights")
    black = looks.region_b(strata)
    titles = (
        f"(a) region A: {_percent(light)} of the light on {_percent(area)} of the sphere. {lights}",
        f"(b) region B = map - A: {_percent(1 - light)} of the light on {_percent(1 - area)} of "
        "the sphere",
        f"(c) B: {_left(len(rest.sites), settings.residual_samples, 'samples')}",
        "(d) the Voronoi cells of B's samples, each its mean radiance",
    )
    pictures = (looks.region_a(strata, suns), black, dotted(black, rest.sites), looks.cells(rest))
    panels = [Panel(*pair) for pair in zip(pictures, titles, strict=True)]
    heading = f"Figure 3. {looks.name}: strata of luminance, samples by {settings.method}."
    return draw_sheet(heading, panels + _strata_panels(strata))


def _strata_panels(strata: Strata) -> list[Panel]:
    """Each stratum in a colour of its own, and what the colours mean."""
    light, area = parts_of_strata(strata)
    tones = [_tone(k, strata.count) for k in range(strata.count)]
    number = most(np.searchsorted(strata.bounds, strata.luminance), WIDTH)
    entries = []
    for k in reversed(range(strata.count)):
        region = "B" if k < strata.count // 2 else "A"
        text = f"E{k + 1} ({region}): {_percent(light[k])} of light, {_percent(area[k])} of area"
        entries.append((tones[k], text))
    picture = Image.fromarray(np.array(tones, np.uint8)[number])
    return [Panel(picture, f"(e) {strata.count} strata of luminance"), Panel(key(entries))]


def _detail(pixels: NDArray[np.uint8], strata: Strata, suns: Floats) -> Image.Image | None:
    """Region A around the brightest pixel, a square; None where that enlarges next to nothing.

    pixels: the map's, (H, W, 3). suns: (n, 3).
    """
    from scipy.ndimage import binary_dilation

    height, width = strata.luminance.shape
    row, column = divmod(int(np.argmax(strata.luminance)), width)
    labels, _ = sphere.connected_groups(strata.region_a)
    rows, columns = np.nonzero(labels == labels[row, column])
    around = (columns - column + width // 2) % width - width // 2
    side = 2 * max(int(np.abs(rows - row).max()), int(np.abs(around).max())) + 5
    zoom = DETAIL * width / (side * WIDTH)
    if not len(suns) or zoom < 2:
        return None
    top, left = min(max(row - side // 2, 0), height - side), column - side // 2
    window = np.ix_(top + np.arange(side), (left + np.arange(side)) % width)
    size, nearest = (DETAIL, DETAIL), Image.Resampling.NEAREST
    detail = Image.fromarray(pixels[window]).resize(size, nearest)
    inside = np.array(Image.fromarray(strata.region_a[window]).resize(size, nearest))
    detail.paste(REGION, mask=Image.fromarray(binary_dilation(inside) & ~inside))
    u, v = sphere.to_image(suns)
    x, y = (u * width - left) % width / side * DETAIL, (v * height - top) / side * DETAIL
    shown = (x < DETAIL) & (y >= 0) & (y < DETAIL)
    detail = stamped(detail, x[shown].astype(np.intp), y[shown].astype(np.intp), 3.5)
    draw = ImageDraw.Draw(detail)
    draw.rectangle((0, 0, DETAIL - 1, DETAIL - 1), outline=INK)
    font = ImageFont.load_default(15)
    draw.text((6, DETAIL - 24), f"{zoom:.0f} x", INK, font, stroke_width=2, stroke_fill=PAPER)
    return detail


def _tone(stratum: int, count: int) -> Colour:
    """Blues for the strata of B, red to yellow for those of A; the brighter the lighter."""
    half = count // 2
    part = (stratum % half + 1) / half
    low, high = (0, 0, 30), (140, 190, 250)
    if stratum >= half:
        low, high = (130, 20, 0), (255, 240, 90)
    red, green, blue = (round(a + (b - a) * part) for a, b in zip(low, high, strict=True))
    return red, green, blue


def _left(count: int, wanted: int, things: str) -> str:
    """How many there are of those that were wanted."""
    if count == wanted:
        return f"{count} {things}"
    return f"{count} of {wanted} {things}: there is no room for more a pixel apart"


def _percent(part: float) -> str:
    """0 and 100 stand for none and all only; sums may miss them by rounding."""
    part = round(part, 12)
    if part in (0, 1):
        return f"{100 * part:.0f} %"
    if part < 0.0001:
        return "< 0.01 %"
    if part > 0.9999:
        return "> 99.99 %"
    return f"{100 * part:.{2 if min(part, 1 - part) < 0.01 else 1}f} %"
