"""A wide map as one that is narrow enough to be looked at as a whole.

Each pixel of the narrow map keeps the light of those that it stands for, and where within it that
light lies: a sun of a few small pixels keeps its place and its width. All pixels are looked at
once, a few rows at a time, on all cores.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .brightest import NEAR, Brightest, brightest_of_strip, joined, nothing_kept
from .cores import usable
from .pixels import Pixels, Strip, copy_as_float64, highest_light, planes_of
from .progress import Progress, silent
from .repairs import RepairedPixels, Repairs, highest_finite, repair_planes, repaired_strips
from .sums import weighted_sum

Floats = NDArray[np.float64]

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
"""Rec.709 luminance of linear RGB (ITU-R BT.709)."""

ROWS = 128
"""Read at a time, about: OpenEXR keeps Python's lock meanwhile, and a window waits. 512 rows of a
map 4,096 wide take it for 40 ms, so many for 24, and the whole map takes as long."""

PACKS = 2
"""At least so many of what a file packs together, to keep two cores busy: DWAB packs 256 rows."""

ROWS_ON_ONE_CORE = 256
"""The same where one core works on them, and needs several copies."""

NUMBERS = 1 << 16
"""That are copied and summed at a time, about."""

PIXELS = 1 << 20
"""In the hands of one thread at a time, about."""

NOTHING_REPAIRED = Repairs()


@dataclass(frozen=True, eq=False)
class Reduction:
    """A map, narrowed.

    radiance: mean over the pixels that each stands for, weighted by solid angle, float32 (h, w, 3).
    direction: mean of their directions, weighted by luminance, (h, w, 3): as long as they agree,
    at most 1; 0 where there is no light. scalar_irradiance: of all pixels, (3,). pixels: all of
    them, repaired; repairs: what that took. brightest: of all pixels.
    """

    radiance: NDArray[np.float32]
    direction: Floats
    scalar_irradiance: Floats
    pixels: RepairedPixels
    repairs: Repairs
    brightest: Brightest


def reduced(raw: Pixels, width: int, progress: Progress = silent) -> Reduction:
    """Narrow a map to a width that is a whole part of its own."""
    sums = _BlockSums(raw.width, raw.height, raw.width // width)
    highest, repairs, left_out = np.zeros(3, np.float32), NOTHING_REPAIRED, set()
    bright: list[Brightest] = []
    for top, found in _on_all_cores(sums, raw, progress):
        highest = np.maximum(highest, found.highest)
        repairs += found.repairs
        bright = [*(part for part in bright if _counts(part, highest)), found.brightest]
        if found.left_out:
            left_out.add(top)
    if left_out:  # what takes its neighbours and the highest of all to repair
        top = 0
        for planes, found in repaired_strips(raw, sums.rows, highest):
            if top in left_out:
                sums.add_light(top, tuple(planes))
                repairs += found
                bright.append(sums.brightest(top, tuple(planes), planes.max(axis=(1, 2))))
            top += planes.shape[1]
    pixels = RepairedPixels(raw, highest, repairs.pixels > 0)
    return sums.reduction(pixels, repairs, joined(bright, highest))


def narrowed(pixels: Pixels, width: int) -> NDArray[np.float32]:
    """Only the radiance, (width // 2, width, 3), of pixels that are all light."""
    step = pixels.width // width
    solid = sphere.row_solid_angles(pixels.width, pixels.height)
    out = np.empty((width // 2, width, 3), np.float32)
    alike = np.ones((step, 1))
    top = 0
    for strip in pixels.strips(rows_of(pixels, step)):
        for first, sums in _sums_of_columns(strip, alike, step):
            weight = solid[top + first :][: sums.shape[1]].reshape(-1, step)
            light = np.einsum("cbrw,br->bwc", sums.reshape(3, *weight.shape, width), weight)
            row = (top + first) // step
            out[row : row + len(weight)] = light / (weight.sum(axis=1) * step)[:, None, None]
        top += len(strip[0])
    return out


def rows_of(pixels: Pixels, step: int = 1) -> int:
    """To read at a time: a multiple of `step`."""
    least = int(np.lcm(step, pixels.least_rows))
    return least * max(round(max(ROWS_ON_ONE_CORE, pixels.packed_rows) / least), 1)


def total_light(strip: Strip, solid: Floats) -> Floats:
    """Scalar irradiance that some rows give, (3,). solid: angle of a pixel of each row."""
    rows = [plane.sum(axis=1, dtype=np.float64) for plane in strip]
    return weighted_sum(solid, np.stack(rows, axis=-1))


def _sums_of_columns(strip: Strip, weights: Floats, step: int) -> Iterator[tuple[int, Floats]]:
    """Of a few rows at a time, over each `step` columns: the first row, and (3, rows, width / step,
    k), the same array each time.

    weights: of each of those columns, (step, k). In float64, and so few rows at a time that they
    stay near the processor, and that no library divides a product among threads: the same sums
    whatever their number.
    """
    rows, width = strip[0].shape
    most = step * max(NUMBERS // (step * width), 1)
    out = np.empty((3, most, width // step, weights.shape[1]))
    some = np.empty((most, width))
    for top in range(0, rows, most):
        count = min(most, rows - top)
        for plane, sums in zip(strip, out, strict=True):
            copy_as_float64(plane[top : top + count], some[:count])
            np.matmul(some[:count].reshape(count, -1, step), weights, out=sums[:count])
        yield top, out[:, :count]


def _counts(part: Brightest, highest: NDArray[np.float32]) -> bool:
    """Whether anything in some rows is near numbers as high as these."""
    return bool(part.highest.max() > NEAR * highest.max())


@dataclass(frozen=True, eq=False)
class _Found:
    """Some rows: the highest finite value of each channel and the brightest numbers, what was
    repaired in them, and whether they were left out, as that takes more than these rows."""

    highest: NDArray[np.float32]
    brightest: Brightest
    repairs: Repairs = NOTHING_REPAIRED
    left_out: bool = False


def _on_all_cores(
    sums: _BlockSums, raw: Pixels, progress: Progress
) -> Iterator[tuple[int, _Found]]:
    """Add all rows, while the next ones are read: the first row of each part, and what was found.

    No sum depends on the number of cores: each block is added up by one of them.
    """
    cores = usable()
    waiting: deque[tuple[int, Future[_Found]]] = deque()
    top = 0
    with ThreadPoolExecutor(cores) as pool:
        wanted = max(ROWS, PACKS * raw.packed_rows)
        for strip in raw.strips(sums.rows * max(round(wanted / sums.rows), 1)):
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
        self.seen = np.zeros(3, np.float32)
        self.light = np.zeros((3, height // step, width // step))
        self.luminous = np.zeros_like(self.light[0])
        self.vector = np.zeros_like(self.light)
        # Rows that are added at a time: those of whole blocks.
        self.rows = step * max(PIXELS // width // step, 1)
        _, polar = sphere.centroid_angles(width, height)
        self.solid = sphere.row_solid_angles(width, height)
        self._ring, self._up = self.solid * np.sin(polar), self.solid * np.cos(polar)
        turn = (np.arange(step) + 0.5 - step / 2) * (2 * np.pi / width)
        # Of each column of a block: itself, along the direction of the middle and across it.
        self._columns = np.stack([np.ones(step), np.cos(turn), -np.sin(turn)], axis=-1)

    def add(self, top: int, strip: Strip) -> _Found:
        """Add rows that begin with this one, unless they hold what is no light."""
        highest = np.array([highest_light(plane) for plane in strip], np.float32)
        if not np.isnan(highest).any():
            self.add_light(top, strip)
            return _Found(highest, self.brightest(top, strip, highest))
        planes = planes_of(strip)
        highest = highest_finite(planes)
        # Of halfs none is higher than what an infinite one becomes.
        halfs = all(plane.dtype == np.float16 for plane in strip)
        if np.isnan(planes).any() or not (halfs or np.isfinite(planes).all()):
            return _Found(highest, nothing_kept(highest), left_out=True)
        repairs = repair_planes(planes, highest, self.solid[top : top + planes.shape[1]])
        self.add_light(top, tuple(planes))
        return _Found(highest, self.brightest(top, tuple(planes), highest), repairs)

    def brightest(self, top: int, strip: Strip, highest: NDArray[np.float32]) -> Brightest:
        """Of rows that are all light; none where brighter ones were seen before, so that most of a
        map costs nothing. Threads that see them a little later only do more."""
        self.seen = np.maximum(self.seen, highest)
        if highest.max() <= NEAR * self.seen.max():
            return nothing_kept(highest)
        return brightest_of_strip(top * self.width, strip, highest)

    def add_light(self, top: int, strip: Strip) -> None:
        """Add rows that are all light."""
        light, luminous, vector = self.light, self.luminous, self.vector
        for first, sums in _sums_of_columns(strip, self._columns, self.step):
            rows = slice(top + first, top + first + sums.shape[1])
            into = slice(rows.start // self.step, rows.stop // self.step)
            light[:, into] = self._sums_of_rows(sums[..., 0], self.solid[rows])
            level, along, across = np.moveaxis(np.tensordot(LUMINANCE_WEIGHTS, sums, 1), -1, 0)
            luminous[into] = self._sums_of_rows(level, self.solid[rows])
            vector[0, into] = self._sums_of_rows(along, self._ring[rows])
            vector[1, into] = self._sums_of_rows(across, self._ring[rows])
            vector[2, into] = self._sums_of_rows(level, self._up[rows])

    def _sums_of_rows(self, values: Floats, weight: Floats) -> Floats:
        """Over the rows of each block, (..., rows, w), by the weight of each row, (rows,)."""
        in_blocks = values.reshape(*values.shape[:-2], -1, self.step, values.shape[-1])
        return np.einsum("...brw,br->...bw", in_blocks, weight.reshape(-1, self.step))

    def reduction(
        self, pixels: RepairedPixels, repairs: Repairs, brightest: Brightest
    ) -> Reduction:
        """What all rows came to."""
        solid = self.solid.reshape(-1, self.step).sum(axis=1) * self.step
        azimuth, _ = sphere.centroid_angles(self.width // self.step, self.height // self.step)
        cos, sin = np.cos(azimuth), np.sin(azimuth)
        along, across, up = self.vector / np.where(self.luminous > 0, self.luminous, 1)
        return Reduction(
            np.stack([*(self.light / solid[:, None])], axis=-1).astype(np.float32),
            np.stack([along * cos - across * sin, along * sin + across * cos, up], axis=-1),
            self.light.sum(axis=(1, 2)),
            pixels,
            repairs,
            brightest,
        )
