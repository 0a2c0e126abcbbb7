"""Sizes in names: `sky_4k.exr` and `4k/sky.exr` are `sky`, 4096 pixels wide."""

from __future__ import annotations

import re

_TOKEN = r"(?P<thousands>\d{1,2})k|(?P<width>\d{3,5})(?:x(?P<height>\d{3,5}))?"
_IN_NAME = re.compile(rf"(?:^|[-_. (\[])(?:{_TOKEN})(?=$|[-_. )\]])", re.IGNORECASE)
_WHOLE = re.compile(_TOKEN, re.IGNORECASE)
_LEFT_OVER = re.compile(r"^[-_. ]+|[-_. ]+$|(?<=[-_. ])[-_. ]+")
"""What is left of separators where a size was taken out."""


def name_without_size(stem: str, width: int) -> str:
    """A file's stem without the size in it, if that is the map's; else the stem.

    width: of the map in pixels. A number that is not its width is a part of the name, like the 05
    of `kloppenheim_05`.
    """
    for found in reversed(list(_IN_NAME.finditer(stem))):
        if _is_width(found, width):
            in_brackets = stem[found.start()] in "([" and stem[found.end() :][:1] in ")]"
            rest = stem[: found.start()] + stem[found.end() + in_brackets :]
            return _LEFT_OVER.sub("", rest) or stem
    return stem


def is_size(folder: str, width: int) -> bool:
    """Whether a folder's name is nothing but the width of a map in it."""
    found = _WHOLE.fullmatch(folder)
    return found is not None and _is_width(found, width)


def size_name(width: int) -> str:
    """4096 is 4k; what is no whole number of thousands is its number."""
    return f"{width // 1024}k" if width % 1024 == 0 else str(width)


def width_of(text: str) -> int | None:
    """The width that a user has named, 4k or 4096; None where that is none."""
    found = _WHOLE.fullmatch(text.strip())
    if found is None or found["height"]:
        return None
    return 1024 * int(found["thousands"]) if found["thousands"] else int(found["width"])


def _is_width(found: re.Match[str], width: int) -> bool:
    if found["thousands"]:
        # Makers call 4000 and 4096 pixels 4k.
        return int(found["thousands"]) in (width / 1024, width / 1000)
    return int(found["width"]) == width
