"""Makes core/placement/penrose_table.py: how far samples move away from the tiling's points.

    python -m tools.relax_penrose [-o FILE] [--small]

Ostromoukhov, Donohue, Jodoin 2004 move the points of the tiling by vectors found once by Lloyd
relaxation. For each phase of importance a uniform field of some thousand points is taken; all
points of one structure move alike, by the mean of their steps to the centroids of their Voronoi
cells. There is no chance in it: the same numbers come out each time.

Each phase starts from the one before, and a pull holds the vectors short: without it they come out
twice as long without a lower spectrum, and where importance changes, points bump into each other.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sunsplit.core.placement import penrose

TABLE = Path(__file__).resolve().parent.parent / "core" / "placement" / "penrose_table.py"

ITERATIONS = 30

STEP = 1.3
"""How much farther than to the centroid a point goes: relaxation converges sooner."""

PULL = 0.05
"""Part of its length that each vector loses at each iteration."""

MARGIN = 6.0
"""Width of the border whose points do not count, in scales of the deepest tiles: their cells
reach out of the field."""

LEVEL, SMALL_LEVEL = 11, 8
"""Level of the tiling in the field: 1,800 to 4,600 points, or 100 to 260."""

Floats = NDArray[np.float64]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=TABLE)
    parser.add_argument("--small", action="store_true", help="a small field: quick and rough")
    options = parser.parse_args()
    level = SMALL_LEVEL if options.small else LEVEL
    table = all_phases(level)
    options.output.write_text(as_source(table), encoding="utf-8")
    lengths = np.hypot(*np.moveaxis(table, -1, 0))
    print(
        f"{options.output}: lengths {lengths.mean():.3f} in the mean, {lengths.max():.3f} at most"
    )


def all_phases(level: int) -> Floats:
    """The table, (PHASES, STRUCTURES, 2), in scales."""
    table = np.zeros((penrose.PHASES, penrose.STRUCTURES, 2))
    for phase in range(penrose.PHASES):
        table[phase] = relaxed(phase, table[max(phase - 1, 0)], level)
    return table


def relaxed(phase: int, start: Floats, level: int = LEVEL) -> Floats:
    """The vectors of one phase, (STRUCTURES, 2), by an even field in the middle of the phase."""
    table = np.zeros((penrose.PHASES, penrose.STRUCTURES, 2))
    table[phase] = start
    importance = (penrose.PHI ** (2 * level + (2 * phase + 1) / penrose.PHASES) - 1) / np.sqrt(5)
    field = penrose.ImportanceField.of(np.ones((1, 1)))
    points = field.points(importance)
    places = penrose.locate(points, np.full(len(points), importance))
    scale = field.scale * places.scale[0]
    for _ in range(ITERATIONS):
        moved = points.position + field.scale * places.offset(table)
        inner = np.minimum(
            np.minimum(moved.real, 1 - moved.real), np.minimum(moved.imag, 1 - moved.imag)
        )
        counts = inner > MARGIN * scale
        steps = (centroids(moved) - moved)[counts] / (scale * places.direction[counts])
        structure = places.structure[counts]
        found = np.bincount(structure, minlength=penrose.STRUCTURES)
        for axis, along in enumerate((steps.real, steps.imag)):
            total = np.bincount(structure, along, minlength=penrose.STRUCTURES)
            table[phase, :, axis] += STEP * total / np.maximum(found, 1)
        table[phase] *= 1 - PULL
    return table[phase]


def centroids(sites: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Of the Voronoi cells, (n,); what is given for cells without an end is of no use.

    Every edge of the diagram makes one triangle with each of the two sites beside it.
    """
    from scipy.spatial import Voronoi

    diagram = Voronoi(np.stack([sites.real, sites.imag], axis=-1))
    ends = np.array(diagram.ridge_vertices)
    finite = (ends >= 0).all(axis=1)
    corners = diagram.vertices @ np.array([1, 1j])
    first, last = corners[ends[finite]].T
    area, moment = np.zeros(len(sites)), np.zeros(len(sites), np.complex128)
    for owner in diagram.ridge_points[finite].T:
        site = sites[owner]
        part = np.abs(((first - site).conj() * (last - site)).imag) / 2
        mean = (site + first + last) / 3
        area += np.bincount(owner, part, len(sites))
        moment.real += np.bincount(owner, part * mean.real, len(sites))
        moment.imag += np.bincount(owner, part * mean.imag, len(sites))
    return moment / np.where(area > 0, area, 1)


def as_source(table: Floats) -> str:
    """The module that holds the table."""
    rows = np.rint(table * 1e4).astype(int).reshape(penrose.PHASES, 3, -1)
    lines = [" ".join(f"{number:5d}" for number in row) for phase in rows for row in phase]
    return HEADER + "\n".join(lines) + FOOTER


HEADER = '''\
"""Made by `python -m tools.relax_penrose`: do not edit.

Three lines for each phase of importance, seven structures in each: the movement along the tile's
direction and along the next but four, in ten thousandths of the scale of the deepest tiles.
"""

from __future__ import annotations

import numpy as np

_TABLE = """
'''

FOOTER = '''
"""

CORRECTIONS = np.array(_TABLE.split(), dtype=np.float64).reshape(21, 21, 2) / 10_000
"""float64 (phase, structure, 2)."""
'''


if __name__ == "__main__":
    main()
