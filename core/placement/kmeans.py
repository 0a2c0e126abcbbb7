"""Spherical k-means weighted by light, as LightGen places lights (Kollig and Keller 2003)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..moments import Moments
from ..region import RegionLight
from .placement import Placement

Floats = NDArray[np.float64]

ROUNDS = 40
"""Lloyd's steps at most: what is left to gain by then is below `GAIN` a step on real maps."""

GAIN = 1e-3
"""Part of the cost that a step must win, or it is the last."""

DRAWS = 20
"""Pixels drawn in proportion to their light for each site to start with."""

CAREFUL = 2000
"""Sites up to which k-means++ chooses among the draws; its time grows with the square."""


def kmeans(light: RegionLight, count: int, seed: int = 0) -> Placement:
    """Sites in the mean of their cells' light, of small sum of flux times squared distance.

    Started by k-means++ on pixels drawn by their light. As many sites as were asked for, or one
    for each pixel that shines.
    """
    lit = np.flatnonzero(light.luminous_flux > 0)
    if len(lit) <= count:
        own = sphere.pixel_directions(light.pixels[lit], light.width, light.height)
        return Placement(own, light)
    sites = _first_sites(light, lit, count, np.random.default_rng(seed))
    cost = np.inf
    for _ in range(ROUNDS):
        placement = Placement(sites, light)
        moments = Moments(light, placement.owner, count)
        before, cost = cost, _cost(moments)
        empty = np.flatnonzero(moments.luminous_flux == 0)
        if not len(empty) and before - cost <= GAIN * cost:
            break
        sites = moments.to_light
        if len(empty):
            sites[empty] = _farthest(light, placement, moments, len(empty))
    return placement


def _cost(moments: Moments) -> float:
    """Sum of flux times half the squared distance from the mean: flux - |sum of vectors|."""
    length = np.linalg.norm(moments.vector, axis=1)
    return float(moments.luminous_flux.sum() - length.sum())


def _first_sites(
    light: RegionLight, lit: NDArray[np.intp], count: int, random: np.random.Generator
) -> Floats:
    """k-means++ (Arthur and Vassilvitskii 2007) on a sample of the pixels."""
    chance = light.luminous_flux[lit] / light.luminous_flux[lit].max()
    steps = np.cumsum(chance)
    drawn = np.searchsorted(
        steps, random.random(max(DRAWS * min(count, CAREFUL), 3 * count)) * steps[-1]
    )
    # A light that is drawn ever again counts as often, and the faintest pixels count too.
    chosen, weight = np.unique(np.minimum(drawn, len(lit) - 1), return_counts=True)
    if len(chosen) < count:
        rest = np.setdiff1d(np.arange(len(lit)), chosen)
        more = rest[np.argsort(-chance[rest], kind="stable")][: count - len(chosen)]
        chosen, weight = np.append(chosen, more), np.append(weight, np.ones(len(more)))
    directions = sphere.pixel_directions(light.pixels[lit[chosen]], light.width, light.height)
    if count > CAREFUL:
        return directions[random.choice(len(chosen), count, False, weight / weight.sum())]
    picked = np.empty(count, np.intp)
    apart = np.full(len(chosen), 4.0)
    for number in range(count):
        steps = np.cumsum(weight * apart)
        picked[number] = min(np.searchsorted(steps, random.random() * steps[-1]), len(chosen) - 1)
        distance = ((directions - directions[picked[number]]) ** 2).sum(axis=1)
        apart = np.minimum(apart, distance)
    return directions[picked]


def _farthest(light: RegionLight, placement: Placement, moments: Moments, count: int) -> Floats:
    """Centres of the pixels that their sites serve worst: where an empty cell is of use."""
    directions = sphere.pixel_directions(light.pixels, light.width, light.height)
    away = ((directions - moments.to_light[placement.owner]) ** 2).sum(axis=1)
    worst = np.argsort(-light.luminous_flux * away, kind="stable")[:count]
    return directions[worst]
