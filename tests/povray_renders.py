"""Renders of exports by POV-Ray, where it is installed."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import TypeVar

import numpy as np
import OpenEXR

from tests.installed import not_installed
from tests.plates import ALBEDO

NUMBERS = count(1)
"""In names of files, so that several renders can write into one folder at a time."""

HEAD = """#version 3.7;
global_settings { assumed_gamma 1.0 }
#default { finish { ambient 0 diffuse 1 } }
"""


T = TypeVar("T")


def together(render: Callable[[T], np.ndarray], things: Iterable[T]) -> list[np.ndarray]:
    """Renders of some things at once: of a small picture POV-Ray sleeps through half a second."""
    with ThreadPoolExecutor() as pool:
        return list(pool.map(render, things))


def renderer() -> str:
    """POV-Ray's command; skips where there is none."""
    command = shutil.which("povray")
    if command is None:
        not_installed("The program povray is not installed.")
    return command


def picture(scene: Path, width: int, height: int, *options: str) -> np.ndarray:
    """Of a scene's file, linear, float64 (height, width, 3). options: of POV-Ray's command line."""
    out = scene.with_name(f"picture.{next(NUMBERS)}.exr")
    size = [f"+W{width}", f"+H{height}"]
    command = [renderer(), f"+I{scene.name}", "-D", *size, "+FE", f"+O{out.name}", *options]
    # Where it runs is where Debian's lets it read.
    done = subprocess.run(command, cwd=scene.parent, capture_output=True, check=False)
    said = done.stderr.decode(errors="replace")
    assert done.returncode == 0, said[-2000:]
    # A scene of nothing but sky is what some tests want.
    warnings = [line for line in said.splitlines() if "Warning:" in line]
    assert not [line for line in warnings if "No objects in scene" not in line]
    with OpenEXR.File(str(out)) as file:
        return file.channels()["RGB"].pixels.astype(np.float64)


def vector(values: np.ndarray) -> str:
    return "<" + ", ".join(f"{value:.15g}" for value in values) + ">"


def camera(place: np.ndarray, frame: np.ndarray, width: float) -> str:
    """A square one. frame: right, up and backwards as columns, in the file's axes. width: of what
    it sees a unit away."""
    right, up, back = frame.T
    return (
        f"camera {{ location {vector(place)} direction {vector(-back)} "
        f"right {vector(right * width)} up {vector(up * width)} }}\n"
    )


def looking(normal: np.ndarray) -> np.ndarray:
    """A frame whose back is a unit vector, in Sunsplit's axes."""
    aside = np.eye(3)[np.argmin(np.abs(normal))]
    right = np.cross(aside, normal)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(normal, right), normal], axis=-1)


def sky_seen(lights: Path, backwards: np.ndarray, to_axes: Callable, side: int) -> np.ndarray:
    """What lies around the scene, seen by a camera with a right angle, (side, side, 3)."""
    frame = to_axes(looking(backwards).T).T
    scene = lights.with_name(f"sky.{next(NUMBERS)}.pov")
    scene.write_text(f'{HEAD}{camera(np.zeros(3), frame, 2)}#include "{lights.name}"\n')
    return picture(scene, side, side)


def directions_seen(backwards: np.ndarray, side: int) -> np.ndarray:
    """Of the middles of that camera's pixels, in Sunsplit's axes, (side, side, 3)."""
    x = (2 * np.arange(side) + 1) / side - 1
    inner = np.stack([*np.broadcast_arrays(x[None, :], -x[:, None], -1.0)], axis=-1)
    return inner @ looking(backwards).T


def plate(
    lights: Path, normal: np.ndarray, to_axes: Callable, before: str = "", more: str = ""
) -> np.ndarray:
    """A white plate two metres wide under exported lights, (16, 16, 3): the middle of it.

    to_axes: from Sunsplit's to the file's. before, more: of the scene, before and after the lights.
    """
    frame = looking(normal)
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]]) @ frame.T
    points = ", ".join(vector(corner) for corner in to_axes(corners))
    scene = lights.with_name(f"plate.{next(NUMBERS)}.pov")
    scene.write_text(
        f"{HEAD}{before}\n"
        f"{camera(to_axes(4 * normal), to_axes(frame.T).T, 0.2)}"
        f'#include "{lights.name}"\n{more}\n'
        f"polygon {{ 5, {points} pigment {{ rgb {ALBEDO} }} }}\n"
    )
    return picture(scene, 16, 16)
