"""What do spherical Voronoi cells and clustering cost?

    .venv-5.2/bin/python -m tests.benchmarks.voronoi [--small] [--rounds N] [-o FOLDER]

All rows in each round, one after the other, so that what else the machine does hits all alike; the
median of the rounds. The unit is one plain pass of a k-d tree over all pixels of a 1024 x 512 map
with 500 sites, in the same run, on one thread like all the rest.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sunsplit.core import sphere
from sunsplit.core.cluster import merge
from sunsplit.core.voronoi import cell_sums, label_map, voronoi_map

ASKED = 1.5
"""A label map of 4096 x 2048 with 500 sites may cost so many plain passes."""


@dataclass(frozen=True)
class Row:
    """Something to measure."""

    name: str
    run: Callable[[], object]


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def sites(count: int) -> np.ndarray:
    return unit(np.random.default_rng(count).normal(size=(count, 3)))


def samples(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half of them crowded around 20 lamps, with energies over some decades, and areas."""
    rng = np.random.default_rng(count)
    lamps = rng.normal(size=(20, 3))[rng.integers(0, 20, count // 2)]
    places = rng.normal(size=(count, 3))
    places[: count // 2] = lamps + 0.003 * places[: count // 2]
    return unit(places), rng.pareto(1.2, count), rng.uniform(0.1, 1, count)


def plain_pass(count: int, width: int) -> Callable[[], object]:
    """Nearest sites by a k-d tree, pixel after pixel."""
    from scipy.spatial import cKDTree

    height = width // 2
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    pixels = sphere.to_directions(u, v[:, None]).reshape(-1, 3)
    return lambda: cKDTree(sites(count)).query(pixels)


def rows(shrink: int) -> list[Row]:
    """The plain pass first, then what is asked for. shrink: divides widths and counts."""

    def labels(count: int, width: int) -> Row:
        name = f"label map {width} x {width // 2}, {count:,} sites"
        return Row(name, lambda: label_map(sites(count), width, width // 2))

    many, wide = 20_000 // shrink, 4096 // shrink
    found = [
        Row(
            f"k-d tree, {1024 // shrink} x {512 // shrink}, {500 // shrink} sites",
            plain_pass(500 // shrink, 1024 // shrink),
        ),
        *(labels(count // shrink, wide) for count in (500, 100, 5_000, 20_000)),
        *(labels(count // shrink, 2 * wide) for count in (500, 20_000)),
    ]
    cells = label_map(sites(500 // shrink), wide, wide // 2)
    light = np.random.default_rng(0).random((*cells.shape, 3), dtype=np.float32)
    sums = cell_sums(light, cells, 500 // shrink)
    found += [
        Row(f"sums of its cells, {wide} x {wide // 2}", lambda: cell_sums(light, cells, 500)),
        Row("its Voronoi map", lambda: voronoi_map(sums.mean_radiance, cells)),
    ]
    given, pixel = samples(many), 2 * np.pi / 1024
    for frequency in ("one", "energy", "mean"):
        for name, reach, left in [("nearer than a pixel", pixel, None), ("down to", 0, 500)]:
            left = left and left // shrink
            found.append(
                Row(
                    f"clusters, {many:,} samples, F = {frequency}, {name} {left or ''}".rstrip(),
                    lambda f=frequency, r=reach, d=left: merge(*given, f, r, d),
                )
            )
    return found


def measure(rows: list[Row], rounds: int) -> list[float]:
    """Median seconds of each row, of the processor: what else the machine does is not counted."""
    seconds = np.zeros((rounds, len(rows)))
    for taken in seconds:
        for number, row in enumerate(rows):
            started = time.process_time()
            row.run()
            taken[number] = time.process_time() - started
    return np.median(seconds, axis=0).tolist()


def table(rows: list[Row], seconds: list[float]) -> list[str]:
    """Markdown."""
    lines = ["| work | cpu s | plain passes |", "| --- | --- | --- |"]
    lines += [
        f"| {row.name} | {taken:.3f} | {taken / seconds[0]:.2f} |"
        for row, taken in zip(rows, seconds, strict=True)
    ]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", action="store_true", help="a sixteenth of all, for CI")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    options = parser.parse_args()
    found = rows(16 if options.small else 1)
    seconds = measure(found, options.rounds)
    lines = [f"Median of {options.rounds} rounds, {os.cpu_count()} cores, one thread.", ""]
    lines += table(found, seconds)
    lines += ["", f"Asked: at most {ASKED} plain passes. Measured: {seconds[1] / seconds[0]:.2f}."]
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "voronoi.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
