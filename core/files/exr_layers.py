"""Which channels of an OpenEXR file are the picture: a file may hold many layers and parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import UnusableInput

MAIN_LAYERS = ("", "combined", "rgba", "rgb", "beauty", "color", "colour", "c")
"""Layers that hold the picture itself, by the habit of the programs that write them: the last
word of the layer's name in lower case."""

MOST_LISTED, LONGEST_NAME = 8, 32
"""Names in a sentence for the user, and characters of each."""

COLOURS = (("r", "g", "b"), ("red", "green", "blue"))


@dataclass(frozen=True)
class Channel:
    """A channel's full name, and whether it has fewer pixels than the picture."""

    name: str
    subsampled: bool


@dataclass(frozen=True)
class Layer:
    """One colour picture in a file.

    part: index of the part. channels: full names of its R, G and B; for a grey picture thrice Y.
    """

    part: int
    name: str
    channels: tuple[str, str, str]

    @property
    def is_grey(self) -> bool:
        return len(set(self.channels)) == 1

    @property
    def is_main(self) -> bool:
        return self._last_word in MAIN_LAYERS

    @property
    def order(self) -> tuple[bool, bool, int]:
        """Sorts the picture itself before passes, colour before grey."""
        rank = MAIN_LAYERS.index(self._last_word) if self.is_main else 0
        return not self.is_main, self.is_grey, rank

    @property
    def _last_word(self) -> str:
        return self.name.rpartition(".")[2].lower()


def choose_layer(headers: Sequence[dict[str, Any]], name: str) -> tuple[Layer, list[str]]:
    """The layer to read, and warnings for the user. Raises UnusableInput when there is none.

    headers: of the file's parts, "channels" as a list of `Channel`. Alpha and all other
    channels are ignored.
    """
    flat = [index for index, header in enumerate(headers) if not _is_deep(header)]
    layers = [layer for index in flat for layer in _layers(headers, index)]
    if not layers:
        raise UnusableInput(f"{name} {_why_none(headers, flat)}")
    # Sorting is stable: among equals, the first in the file.
    chosen = min(layers, key=lambda layer: layer.order)
    if chosen.is_main or len(layers) == 1:
        return chosen, []
    others = _listed(layer.name for layer in layers if layer != chosen)
    taken = _shown(chosen.name)
    return chosen, [f'Layer "{taken}" is taken as the map; the file also has: {others}.']


def _is_deep(header: dict[str, Any]) -> bool:
    return "deep" in getattr(header.get("type"), "name", "")


def _layers(headers: Sequence[dict[str, Any]], index: int) -> Iterator[Layer]:
    header = headers[index]
    for prefix, channels in _by_layer(header).items():
        # In a file of many parts, the part is the layer.
        name = prefix or (str(header.get("name", "")) if len(headers) > 1 else "")
        for colours in COLOURS:
            if all(colour in channels for colour in colours):
                yield Layer(index, name, tuple(channels[colour] for colour in colours))
                break
        else:
            # With X it is a vector or CIE XYZ, with RY and BY it lacks its colours.
            if "y" in channels and not {"x", "ry", "by"} & set(channels):
                yield Layer(index, name, (channels["y"],) * 3)


def _by_layer(header: dict[str, Any]) -> dict[str, dict[str, str]]:
    """Full names of channels by layer and by short name in lower case; no subsampled ones."""
    layers: dict[str, dict[str, str]] = {}
    for channel in header["channels"]:
        prefix, _, short = channel.name.rpartition(".")
        # Chroma must be seen, or luminance alone would pass for a grey picture.
        if not channel.subsampled or short in ("RY", "BY"):
            layers.setdefault(prefix, {}).setdefault(short.lower(), channel.name)
    return layers


def _why_none(headers: Sequence[dict[str, Any]], flat: Sequence[int]) -> str:
    if not flat:
        return "is a deep image: flatten it to R, G and B first."
    names = {channel.name for index in flat for channel in headers[index]["channels"]}
    if {"RY", "BY"} & {name.rpartition(".")[2] for name in names}:
        return "stores luminance and chroma (Y, RY, BY): save it with R, G and B channels first."
    return f"has no colour channels (R, G, B or Y); it has: {_listed(names) or 'none'}."


def _listed(names: Iterable[str]) -> str:
    """Names for a sentence, no more of them than one reads."""
    shown = [_shown(name) for name in sorted(names)]
    more = [f"and {len(shown) - MOST_LISTED} more"] if len(shown) > MOST_LISTED else []
    return ", ".join(shown[:MOST_LISTED] + more)


def _shown(name: str) -> str:
    """A name as far as it can be printed: files may hold any bytes, and up to 255 of them."""
    text = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in name)
    return f"{text[:LONGEST_NAME]}…" if len(text) > LONGEST_NAME else text or "(unnamed)"
