"""A wide map as one that is narrow enough to be looked at as a whole.

Each pixel of the narrow map keeps the light of those that it stands for, and where within it that
light lies: a sun of a few small pixels keeps its place and its width. All pixels are looked at
once, a few rows at a time, on all cores.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from threading import local

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .pixels import Pixels, Planes, as_float32, highest_light, planes_of
from .progress import Progress, silent
from .repairs import RepairedPixels, Repairs, highest_finite, repair_planes, repaired_strips

Floats = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Rec.709, for the mean of directions."""

ROWS = 256
"""Read at a time, about: DWAB, the coarsest compression of OpenEXR, packs so many together."""

NONE = Repairs()

PIXELS = 1 << 20
"""In the hands of one thread at a time, about."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """A map, narrowed.

    radiance: mean over the pixels that each stands for, weighted by solid angle, float32 (h, w, 3).
    direction: mean of their directions, weighted by luminance, (h, w, 3): as long as they agree,
    at most 1; 0 where there is no light. scalar_irradiance: of all pixels, (3,). pixels: all of
    them, repaired; repairs: what that took.
    """

    radiance: NDArray[np.float32]
    direction: Floats
    scalar_irradiance: Floats
    pixels: RepairedPixels
    repairs: Repairs


def reduced(raw: Pixels, width: int, progress: Progress = silent) -> Reduction:
    """Narrow a map to a width that is a whole part of its own."""
    sums = _BlockSums(raw.width, raw.height, raw.width // width)
    highest, repairs, left_out = np.zeros(3, np.float32), Repairs(), set()
    for top, found in _on_all_cores(sums, raw, progress):
        highest = np.maximum(highest, found.highest)
        repairs += found.repairs
        if found.left_out:
            left_out.add(top)
    if left_out:  # what takes its neighbours and the highest of all to repair
        top = 0
        for planes, found in repaired_strips(raw, sums.rows, highest):
            if top in left_out:
                sums.add_light(top, planes)
                repairs += found
            top += planes.shape[1]
    return sums.reduction(RepairedPixels(raw, highest, repairs.pixels > 0), repairs)


def narrowed(pixels: Pixels, width: int) -> NDArray[np.float32]:
    """Only the radiance, (width // 2, width, 3), of pixels that are all light."""
    step = pixels.width // width
    solid = sphere.row_solid_angles(pixels.width, pixels.height)
    out = np.empty((width // 2, width, 3), np.float32)
    top = 0
    for strip in pixels.strips(rows_of(pixels, step)):
        planes = planes_of(strip)
        weight = solid[top * step :][: planes.shape[1]].reshape(-1, step)
        light = _light_of_blocks(planes, weight)
        means = light / (weight.sum(axis=1)[:, None] * step)
        out[top : top + len(weight)] = np.moveaxis(means, 0, -1)
        top += len(weight)
    return out


def rows_of(pixels: Pixels, step: int = 1) -> int:
    """To read at a time: a multiple of `step`."""
    least = int(np.lcm(step, pixels.least_rows))
    return least * max(round(ROWS / least), 1)


def total_light(strip: tuple[NDArray[np.floating], ...], solid: Floats) -> Floats:
    """Scalar irradiance that some rows give, (3,). solid: angle of a pixel of each row."""
    rows = np.stack([plane.sum(axis=1, dtype=np.float64) for plane in strip])
    return rows @ solid


def _light_of_blocks(planes: Planes, weight: Floats) -> Floats:
    """Sums over blocks of rows, (3, rows, width), times the weight of each row, (rows of blocks,
    rows in each): (3, rows of blocks, columns of blocks).

    By einsum: in float64 without a copy, and the same whatever the number of threads.
    """
    step = weight.shape[1]
    columns = np.einsum("cbrw,br->cbw", planes.reshape(3, *weight.shape, -1), weight)
    return columns.reshape(*columns.shape[:2], -1, step).sum(axis=-1)


@dataclass(frozen=True, eq=False)
class _Found:
    """Some rows: the highest finite value of each channel, what was repaired in them, and whether
    they were left out, as that takes more than these rows."""

    highest: NDArray[np.float32]
    repairs: Repairs = NONE
    left_out: bool = False


def _on_all_cores(
    sums: _BlockSums, raw: Pixels, progress: Progress
) -> Iterator[tuple[int, _Found]]:
    """Add all rows, while the next ones are read: the first row of each part, and what was found.

    No sum depends on the number of cores: each block is added up by one of them.
    """
    cores = os.cpu_count() or 1
    waiting: deque[tuple[int, Future[_Found]]] = deque()
    top = 0
    with ThreadPoolExecutor(cores) as pool:
        for strip in raw.strips(sums.rows * max(round(ROWS / sums.rows), 1)):
            progress("reading", top / raw.height)
            for first in range(0, len(strip[0]), sums.rows):
                part = tuple(plane[first : first + sums.rows] for plane in strip)
                waiting.append((top + first, pool.submit(sums.add, top + first, part)))
            top += len(strip[0])
            while len(waiting) > 2 * cores:
                begun, done = waiting.popleft()
                yield begun, done.result()
        for begun, done in waiting:
            yield begun, done.result()


class _BlockSums:
    """Of a map in blocks of step x step pixels: their light, (3, h, w), their luminous light,
    (h, w), and that along and across the direction of each block's middle and upwards, (3, h, w).
    """

    def __init__(self, width: int, height: int, step: int) -> None:
        self.width, self.height, self.step = width, height, step
        self.light = np.zeros((3, height // step, width // step))
        self.luminous = np.zeros_like(self.light[0])
        self.vector = np.zeros_like(self.light)
        # Rows that are added at a time: those of whole blocks.
        self.rows = step * max(PIXELS // width // step, 1)
        _, polar = sphere.centroid_angles(width, height)
        of_pixel = np.stack([np.ones_like(polar), np.sin(polar), np.cos(polar)])
        self._row_weights = sphere.row_solid_angles(width, height) * of_pixel
        turn = (np.arange(step) + 0.5 - step / 2) * (2 * np.pi / width)
        self._across = np.stack([np.cos(turn), -np.sin(turn)])
        self._own = local()

    def add(self, top: int, strip: tuple[NDArray[np.floating], ...]) -> _Found:
        """Add rows that begin with this one, unless they hold what is no light."""
        planes = self._buffer("planes", (3, *strip[0].shape))
        for plane, out in zip(strip, planes, strict=True):
            as_float32(plane, out)
        highest = np.array([highest_light(plane) for plane in strip], np.float32)
        repairs = Repairs()
        if np.isnan(highest).any():
            highest = highest_finite(planes)
            # Of halfs none is higher than what an infinite one becomes.
            halfs = all(plane.dtype == np.float16 for plane in strip)
            if np.isnan(planes).any() or not (halfs or np.isfinite(planes).all()):
                return _Found(highest, left_out=True)
            solid = self._row_weights[0, top : top + planes.shape[1]]
            repairs = repair_planes(planes, highest, solid)
        self.add_light(top, planes)
        return _Found(highest, repairs)

    def add_light(self, top: int, planes: Planes) -> None:
        """Add rows, (3, rows, width), that are all light."""
        rows = planes.shape[1]
        shape = rows // self.step, self.step
        weights = self._row_weights[:, top : top + rows].reshape(3, *shape)
        into = slice(top // self.step, (top + rows) // self.step)
        self.light[:, into] = _light_of_blocks(planes, weights[0])
        luminance = self._luminance(planes).reshape(*shape, self.width)
        level, aside, up = np.einsum("brw,kbr->kbw", luminance, weights)
        self.luminous[into] = self._by_blocks(level).sum(axis=-1)
        self.vector[:2, into] = np.einsum("bws,ks->kbw", self._by_blocks(aside), self._across)
        self.vector[2, into] = self._by_blocks(up).sum(axis=-1)

    def _by_blocks(self, columns: Floats) -> Floats:
        return columns.reshape(*columns.shape[:-1], -1, self.step)

    def _luminance(self, planes: Planes) -> NDArray[np.float32]:
        total, one = (self._buffer(name, planes.shape[1:]) for name in ("luminance", "one"))
        np.multiply(planes[0], LUMINANCE[0], out=total)
        for channel in (1, 2):
            np.multiply(planes[channel], LUMINANCE[channel], out=one)
            np.add(total, one, out=total)
        return total

    def _buffer(self, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Of each thread its own: new memory for every part would take as long as the sums."""
        kept = self._own.__dict__
        if name not in kept or kept[name].shape != shape:
            kept[name] = np.empty(shape, np.float32)
        return kept[name]

    def reduction(self, pixels: RepairedPixels, repairs: Repairs) -> Reduction:
        """What all rows came to."""
        solid = self._row_weights[0].reshape(-1, self.step).sum(axis=1) * self.step
        azimuth, _ = sphere.centroid_angles(self.width // self.step, self.height // self.step)
        cos, sin = np.cos(azimuth), np.sin(azimuth)
        along, across, up = self.vector / np.where(self.luminous > 0, self.luminous, 1)
        return Reduction(
            np.stack([*(self.light / solid[:, None])], axis=-1).astype(np.float32),
            np.stack([along * cos - across * sin, along * sin + across * cos, up], axis=-1),
            self.light.sum(axis=(1, 2)),
            pixels,
            repairs,
        )
