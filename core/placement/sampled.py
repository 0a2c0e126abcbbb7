"""Suns from samples of region A: placed by importance, clustered, one light for each cell.

The paper's way: samples (2.1), their spherical Voronoi cells and a directional light for each
(2.2), after samples that lie too close have been clustered (section 3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..cells import Taken, squares_of_pixels
from ..cluster import merge
from ..environment import LUMINANCE_WEIGHTS
from ..moments import Moments
from ..region import RegionLight
from ..settings import ConversionSettings
from ..strata import Strata
from ..suns import Sun, disc_sun, point_sun
from .placement import ChosenSuns, Place, Placement, method_named

MOST_SAMPLES = 256
"""At most so many samples are tried for each light."""

LIMIT_OF_SAMPLES = 200_000
"""And so many in all: placing them takes some seconds."""

A_PIXEL = 0.99
"""Distance, in pixels as wide as they are there, below which samples are clustered: just less than
one, so that the means of two whole pixels stay two."""

FEW_PIXELS = 5000
"""Pixels up to which a sample in each of them is clustered: in about a second."""


def sampled_suns(
    light: RegionLight, strata: Strata, settings: ConversionSettings, lights: int
) -> ChosenSuns:
    """At most `lights` suns that hold all of the light, of which every pixel shines."""
    parts, notes = [light], []
    if settings.per_stratum:
        parts = _by_stratum(light, strata)
        if len(parts) > lights:
            notes.append(f"{len(parts)} strata want as many lights: placed in all of them at once.")
            parts = [light]
    suns, pixels, owner = [], [], []
    for part, count in zip(parts, _shared_out(parts, lights), strict=True):
        samples = settings.samples and max(round(count * settings.samples / lights), 1)
        placement = sample(part, int(count), settings, samples)
        pixels.append(part.pixels)
        owner.append(len(suns) + placement.owner)
        suns += _suns(part, placement, strata, settings)
    flux = np.array([sun.scalar_irradiance for sun in suns])
    order = np.argsort(-(flux @ LUMINANCE_WEIGHTS), kind="stable")
    squares = squares_of_pixels(np.concatenate(pixels), light.width)
    taken = Taken(squares, np.argsort(order)[np.concatenate(owner)])
    if settings.lights and len(suns) < lights:
        notes.append(_fewer(len(suns), light, settings, lights))
    brightest_first = tuple(suns[number] for number in order)
    return ChosenSuns(brightest_first, np.nan, tuple(notes), taken=taken)


def sample(
    light: RegionLight, count: int, settings: ConversionSettings, samples: int | None = None
) -> Placement:
    """At most `count` samples no nearer than a pixel to one another; what is, gets clustered.

    light: of pixels that all shine. samples: place so many, and cluster them down to `count`;
    None: as few as leave `count`. Each of the sites that come out has a cell that shines.
    """
    place = method_named("penrose" if settings.method == "edge" else settings.method)
    if samples:
        clustered = _clustered(place(light, samples), count, settings)
    else:
        clustered = _as_many(light, place, count, settings)
    if len(clustered.sites) > count:  # so far apart that they have no mean
        return _clustered(place(light, count), count, settings)
    return clustered


def _as_many(
    light: RegionLight, place: Place, count: int, settings: ConversionSettings
) -> Placement:
    """`count` samples after clustering, or as many as the region has room for."""
    wanted, most = count, None
    while True:
        placement = _enough(light, place, wanted)
        clustered = _clustered(placement, count, settings)
        if most is None or len(clustered.sites) > len(most.sites):
            most = clustered
        if len(most.sites) >= count:
            return most
        if _pixels_met(placement) < wanted:
            break
        wanted = max(wanted + count - len(most.sites), wanted * 5 // 4)
    if len(light.pixels) > max(FEW_PIXELS, 2 * count):
        return most
    # So much of the light in one place that no number of samples meets the rest of the pixels.
    each = _clustered(_each_pixel(light), count, settings)
    return max(most, each, key=lambda one: len(one.sites))


def _enough(light: RegionLight, place: Place, count: int) -> Placement:
    """The fewest samples, to a fiftieth, that meet `count` pixels, or as many as do.

    A peak draws many samples into one pixel (paper, section 3), and more go elsewhere only with
    a larger number of them all.
    """
    if len(light.pixels) <= count:  # and there are no more to meet
        return _each_pixel(light)
    placement = place(light, count)
    low = high = count
    while _pixels_met(placement) < count and high < min(count * MOST_SAMPLES, LIMIT_OF_SAMPLES):
        low, high = high, 2 * high
        placement = place(light, high)
    while high - low > 1 + low // 50:
        middle = (low + high) // 2
        fewer = place(light, middle)
        if _pixels_met(fewer) < count:
            low = middle
        else:
            high, placement = middle, fewer
    return placement


def _each_pixel(light: RegionLight) -> Placement:
    """A sample in each pixel."""
    return Placement(sphere.pixel_directions(light.pixels, light.width, light.height), light)


def _pixels_met(placement: Placement) -> int:
    """In how many pixels the samples lie: no fewer than are left when they are clustered."""
    light = placement.light
    return len(np.unique(sphere.pixels_at(placement.sites, light.width, light.height)))


def _clustered(placement: Placement, count: int, settings: ConversionSettings) -> Placement:
    """Without samples that have no light of their own, as another is nearer to each pixel; those
    that are nearer to one another than a pixel merged, and then down to `count`."""
    moments = Moments(placement.light, placement.owner, len(placement.sites))
    kept = np.flatnonzero(moments.luminous_flux > 0)
    number = np.zeros(len(placement.sites), np.intp)
    number[kept] = np.arange(len(kept))
    clusters = merge(
        placement.sites[kept],
        moments.luminous_flux[kept],
        moments.area[kept],
        settings.frequency,
        nearer_than=A_PIXEL * np.pi / placement.light.height,
        down_to=count,
        narrowed=sphere.pixel_narrowing,
    )
    owner = clusters.label[number[placement.owner]]
    return Placement(clusters.centres, placement.light, owner)


def _suns(
    light: RegionLight, placement: Placement, strata: Strata, settings: ConversionSettings
) -> list[Sun]:
    count = len(placement.sites)
    moments = Moments(light, placement.owner, count)
    brightest = np.zeros(count)
    np.maximum.at(brightest, placement.owner, strata.luminance.ravel()[light.pixels])
    to_light = placement.sites if settings.position == "sample" else moments.to_light
    return [
        point_sun(moments.flux[i], to_light[i], strata.stratum(brightest[i]))
        if settings.shape == "point"
        else disc_sun(
            moments.flux[i], to_light[i], moments.shortfall[i], strata.stratum(brightest[i])
        )
        for i in range(count)
    ]


def _by_stratum(light: RegionLight, strata: Strata) -> list[RegionLight]:
    """The light of each bright stratum that holds any, the darkest first."""
    number = np.searchsorted(strata.bounds, strata.luminance.ravel()[light.pixels]) + 1
    # The rim of a light may be darker than region A, but belongs to it.
    number = np.maximum(number, strata.count // 2 + 1)
    return [light.part(number == k) for k in np.unique(number)]


def _shared_out(parts: list[RegionLight], lights: int) -> NDArray[np.intp]:
    """Lights in proportion to each part's light; one at least, but no more than it has pixels."""
    weight = np.array([part.luminous_flux.sum() for part in parts])
    room = np.array([len(part.pixels) for part in parts])
    shares = np.ones(len(parts), np.intp)
    for _ in range(min(lights, room.sum()) - len(parts)):
        # The next light to where each of those there has the most to give (D'Hondt).
        shares[np.argmax(np.where(shares < room, weight / (shares + 1), -1))] += 1
    return shares


def _fewer(count: int, light: RegionLight, settings: ConversionSettings, lights: int) -> str:
    pixels = len(light.pixels)
    if pixels <= lights:
        shine = "1 pixel that shines" if pixels == 1 else f"{pixels} pixels that shine"
        why = f"region A has only {shine}"
    elif settings.samples and settings.samples < lights:
        why = f"{settings.samples} samples were placed"
    else:
        why = "samples nearer than a pixel were clustered"
    return f"{count} of {lights} lights: {why}."
