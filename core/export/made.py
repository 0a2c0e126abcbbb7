"""What a format makes of a sky: files before they are written, and what is lost."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..version import version
from .axes import Axes
from .emitters import Emitters
from .names import Names, shown


@dataclass(frozen=True, eq=False)
class Made:
    """names: of the files. lights, scene: their content. radiance: of the map, float32, None where
    there is none. axes: of all of it. losses: what the format cannot carry, in sentences."""

    names: Names
    lights: str | bytes
    scene: str | bytes
    radiance: NDArray[np.float32] | None
    axes: Axes
    losses: tuple[str, ...]


def heading(emitters: Emitters, axes: Axes, losses: tuple[str, ...]) -> list[str]:
    """What every file says of itself, in lines without the signs of a comment."""
    # No line break in it ends a comment, and no two dashes one of XML.
    name = re.sub("-(?=-)", "- ", shown(emitters.name))
    return [
        f'The light of "{name}", by Sunsplit {version()}.',
        f"Axes: {axes.name}. Units: metres; radiance as in the HDRI, linear Rec.709.",
        *losses,
    ]


def number(value: float) -> str:
    """With all digits that a float32 has, and some more."""
    return f"{float(value):.10g}"


def numbers(values: NDArray[np.floating] | tuple[float, ...]) -> str:
    """In a row, with spaces between them."""
    return " ".join(number(value) for value in np.ravel(values))
