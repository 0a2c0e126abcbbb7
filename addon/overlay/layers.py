"""From marks on a screen to what is drawn: rims, colours, names."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .draw import Areas, Colour, Lines, Word, sizes_of
from .marks import Marks
from .screen import Frame, arrow_head, place_labels
from .suns import ShownSuns, label_of

Floats = NDArray[np.float64]

RIM: Colour = (0.0, 0.0, 0.0, 0.75)
RING = 9.0
"""Radius in pixels at scale 1 below which a disc becomes a ring with a dot in it."""

DOT = 2.5
WIDTH, RIM_WIDTH, HALO_WIDTH = 2.0, 4.5, 7.0
FAINT = 0.45
"""How strong what lies behind the globe is drawn."""

NAMED = 4
"""So many of the brightest have their names beside them, others only their rank."""

LABELS = 64
"""Of suns with a label at all: hundreds could not be read."""

ARROWS = 3
"""Of suns out of sight: the brightest ones, and those that are selected, have an arrow."""

LETTERS = 12.0


def sun_layers(suns: ShownSuns, marks: Marks, halo: Floats, scale: float) -> list[Lines | Areas]:
    """Outlines in the suns' own colours with dark rims, dots in the middle, arrows at the frame.

    halo: colours around those that are selected, (n, 4). scale: of the interface.
    """
    strength = np.where(marks.behind, FAINT, 1.0)
    colour = np.column_stack([suns.colour, strength])
    rim = np.column_stack([np.tile(RIM[:3], (len(suns), 1)), RIM[3] * strength])
    lines, owner = marks.lines, marks.owner
    chosen = suns.selected[owner]
    layers: list[Lines | Areas] = [
        Lines(lines[chosen], _both(halo, owner[chosen]), HALO_WIDTH * scale),
        Lines(lines, _both(rim, owner) if marks.behind.any() else RIM, RIM_WIDTH * scale),
        Lines(lines, _both(colour, owner), WIDTH * scale),
    ]
    inside = np.flatnonzero(~marks.aside)
    for radius, of_suns in ((DOT + 1.25, rim), (DOT, colour)):
        dots = marks.place[inside, None, None] + radius * scale * _DISC
        layers.append(Areas(dots.reshape(-1, 3, 2), of_suns[inside].repeat(len(_DISC), axis=0)))
    return layers


def arrow_layers(
    suns: ShownSuns, marks: Marks, frame: Frame, halo: Floats, scale: float
) -> list[Lines | Areas]:
    """At the frame, the way to suns that are out of sight."""
    layers: list[Lines | Areas] = []
    for number in arrows(suns, marks):
        place = marks.place[number]
        way = place - frame.middle
        unit = way / max(float(np.linalg.norm(way)), 1e-9)
        shells = [(2.0, RIM), (0.0, (*suns.colour[number], 1.0))]
        if suns.selected[number]:
            shells.insert(0, (5.0, tuple(halo[number])))
        for wider, colour in shells:
            # By so much the tip goes ahead, and the base back, of a triangle that is wider all
            # around.
            tip = place + unit * (9 + 2.44 * wider) * scale
            head = arrow_head(tip, way, (16 + 3.44 * wider) * scale)
            layers.append(Areas(head[None], np.array([colour])))
    return layers


def arrows(suns: ShownSuns, marks: Marks) -> list[int]:
    """Which suns have an arrow."""
    wanted = suns.selected | (np.arange(len(suns)) < ARROWS)
    return np.flatnonzero(marks.aside & wanted).tolist()


def ray_layers(
    rays: list[tuple[int, Floats]], suns: ShownSuns, scale: float
) -> list[Lines | Areas]:
    """From what is lit towards suns, with a head that points the way of the light."""
    if not rays:
        return []
    number = [sun for sun, _ in rays]
    pieces = np.array([ray for _, ray in rays])
    colour = np.ones((len(rays), 2, 4))
    colour[..., :3] = suns.colour[number][:, None]
    colour[..., 3] = 0.95, 0.35
    heads = np.array([arrow_head(ray[0], ray[0] - ray[1], 14 * scale) for ray in pieces])
    return [
        Lines(pieces, (0, 0, 0, 0.35), 3.5 * scale),
        Lines(pieces, colour, 1.5 * scale),
        Areas(heads, colour[:, 0]),
    ]


def words(
    suns: ShownSuns, marks: Marks, halo: Floats, frame: Frame, scale: float, ranks_only: bool
) -> list[Word]:
    """Names beside suns, so far as they can be read."""
    shown = ~marks.aside & frame.holds(marks.place)
    shown[arrows(suns, marks)] = True
    # Those that are selected come first, then the brightest.
    found = np.flatnonzero(shown)
    found = found[np.argsort(~suns.selected[found], kind="stable")][:LABELS]
    full = suns.selected | (np.arange(len(suns)) < NAMED)
    full &= not ranks_only
    texts = [label_of(suns.lamps[n], suns.rank[n], bool(full[n])) for n in found]
    colours = np.column_stack([suns.colour, np.ones(len(suns))])
    colours[suns.selected] = halo[suns.selected]
    away = np.where(marks.aside, 2.2, 1.2) * RING * scale
    sizes = sizes_of(texts, LETTERS * scale)
    corners = place_labels(marks.place[found], sizes, away[found], frame)
    return [
        Word(text, *corner, *size, tuple(colour))
        for text, corner, size, colour in zip(
            texts, corners, sizes.tolist(), colours[found].tolist(), strict=True
        )
        if corner
    ]


def _both(colour: Floats, owner: NDArray[np.intp]) -> NDArray[np.float32]:
    """The colour, (n, 4), of each piece's sun for both of its ends, (m, 2, 4)."""
    return colour.astype(np.float32)[owner.repeat(2)].reshape(-1, 2, 4)


_TURN = np.linspace(0, 2 * np.pi, 13)
_RIM = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1)
_DISC = np.stack([np.zeros_like(_RIM[1:]), _RIM[:-1], _RIM[1:]], axis=1)
"""A disc of radius 1 as triangles, (12, 3, 2)."""
