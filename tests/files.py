"""Map files made by hand, as other programs write them, and the command line as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

from tests.maps import direction, paint_disc, sky

COMMAND = [sys.executable, "-c", "import sys; from sunsplit.core.cli import main; sys.exit(main())"]


def noise(height: int = 16, seed: int = 1) -> np.ndarray:
    """A map in which no two pixels are alike, float32 (height, 2 height, 3), all above 0.1."""
    random = np.random.default_rng(seed)
    return random.random((height, 2 * height, 3), dtype=np.float32) + np.float32(0.1)


def sunny(width: int = 128, radiance: float = 20000.0) -> np.ndarray:
    """A sky with one sun 40 degrees up, float32."""
    pixels = sky(width)
    paint_disc(pixels, direction(60, 40), 6, radiance)
    return pixels.astype(np.float32)


def window(left: int, top: int, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """An OpenEXR window."""
    first = np.array([left, top], np.int32)
    return first, first + np.array([width - 1, height - 1], np.int32)


def planes(pixels: np.ndarray, names: str | list[str] = "RGB") -> dict[str, np.ndarray]:
    """Channels of these names, one for each plane of pixels."""
    return {name: pixels[..., k].copy() for k, name in enumerate(names)}


def write_exr(path: Path, channels: dict[str, np.ndarray] | np.ndarray, **header: object) -> Path:
    """One part, float or half or uint as the arrays are; pixels (h, w, 3) stand for R, G, B."""
    if isinstance(channels, np.ndarray):
        channels = planes(channels)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header
    with OpenEXR.File(header, dict(channels)) as file:  # it changes the dict that it is given
        file.write(str(path))
    return path


def write_parts(path: Path, parts: list[tuple[str, dict[str, np.ndarray]]]) -> Path:
    """A multi-part EXR of named parts."""
    with OpenEXR.File([OpenEXR.Part({"name": name}, c) for name, c in parts]) as file:
        file.write(str(path))
    return path


def to_rgbe(pixels: np.ndarray) -> np.ndarray:
    """Shared exponent bytes (h, w, 4) of pixels (h, w, 3)."""
    brightest = pixels.max(axis=-1)
    exponent = np.floor(np.log2(brightest)) + 1
    mantissas = np.floor(pixels * (256 / 2.0**exponent)[..., None])
    return np.concatenate([mantissas, exponent[..., None] + 128], axis=-1).astype(np.uint8)


def from_rgbe(stored: np.ndarray) -> np.ndarray:
    """What these bytes mean, float32 (h, w, 3)."""
    return (stored[..., :3] * 2.0 ** (stored[..., 3:].astype(float) - 136)).astype(np.float32)


def new_runs(stored: np.ndarray) -> bytes:
    """Scanlines (n, length, 4) in Radiance's runs per component."""
    out = bytearray()
    for line in stored:
        out += bytes([2, 2, *len(line).to_bytes(2, "big")])
        for component in line.T:
            values = component.tobytes()
            start = 0
            while start < len(values):
                end = start
                while end < len(values) and values[end] == values[start] and end - start < 127:
                    end += 1
                run = end - start
                out += bytes([128 + run, values[start]]) if run > 2 else bytes([1, values[start]])
                start += run if run > 2 else 1
    return bytes(out)


def old_runs(stored: np.ndarray) -> bytes:
    """Scanlines (n, length, 4) in the runs of Radiance 1: 1, 1, 1, count; lowest byte first."""
    out = bytearray()
    for line in stored:
        start = 0
        while start < len(line):
            end = start + 1
            while end < len(line) and (line[end] == line[start]).all():
                end += 1
            out += line[start].tobytes()
            repeats = end - start - 1
            while repeats:
                out += bytes([1, 1, 1, repeats & 255])
                repeats >>= 8
            start = end
    return bytes(out)


def radiance_head(resolution: str, *lines: str, form: str = "32-bit_rle_rgbe") -> bytes:
    """A Radiance header with more lines of its own."""
    return "\n".join(["#?RADIANCE", *lines, f"FORMAT={form}", "", resolution, ""]).encode()


def write_hdr(path: Path, pixels: np.ndarray, *lines: str) -> Path:
    """An upright .hdr in new runs; its pixels are `from_rgbe(to_rgbe(pixels))`."""
    height, width = pixels.shape[:2]
    head = radiance_head(f"-Y {height} +X {width}", *lines)
    path.write_bytes(head + new_runs(to_rgbe(pixels)))
    return path


def sunsplit(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    return subprocess.run(
        [*COMMAND, *map(os.fspath, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        **options,
    )
