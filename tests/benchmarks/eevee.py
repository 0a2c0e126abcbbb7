"""Does EEVEE show after a conversion what Cycles shows? Errors and seconds of a frame.

    .venv-5.2/bin/python -m tests.benchmarks.eevee MAP ... [-o FOLDER] [--scenes shadows plate]
        [--analytic "one sun" "two opposite suns" "one unclipped sun"] [--samples 16]

EEVEE with the plain HDRI as it comes, at sun threshold 0, and converted for EEVEE, each against
Cycles with the plain HDRI, direct light only: on three maps whose light is known in closed form
and on those given, a plate in eight orientations and a scene with shadows.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sunsplit.core import sphere
from sunsplit.core.files import exr
from sunsplit.core.files.maps import load
from tests.benchmarks import eevee_report
from tests.maps import direction, paint_disc, sky

WAYS = ("default", "zero", "converted")

ANALYTIC = {
    "one sun": [(40, 40, 2, 1000)],
    "two opposite suns": [(0, 30, 2, 1000), (180, 30, 2, 1000)],
    "one unclipped sun": [(40, 68, 0.5, 5e5)],
}
"""Azimuth, elevation and radius of discs in degrees, and their radiance, in a sky of 0.5. The last
is beyond half floats."""


@dataclass(frozen=True, eq=False)
class Result:
    """One map in one scene. images: by way, (height, width, 4). truth: of the eight plates in
    closed form, (n, 3), else None. The rest as in `eevee_renders.Renders`."""

    map: str
    scene: str
    blender: str
    samples: int
    lamps: int
    share: float
    predicted: float
    seconds: dict[str, float]
    images: dict[str, np.ndarray]
    truth: np.ndarray | None = None

    @property
    def surfaces(self) -> np.ndarray:
        """Where a picture shows nothing but surfaces, (height, width)."""
        return np.all([image[..., 3] > 0.999 for image in self.images.values()], axis=0)

    @property
    def reference(self) -> np.ndarray:
        """Cycles with the plain HDRI; from two renders."""
        return (self.images["cycles"] + self.images["cycles again"]) / 2

    def wrong(self, way: str) -> float:
        """Root mean square over surfaces and channels against Cycles, as a part of the mean, what
        the reference's own noise adds to it taken off."""
        on = self.surfaces
        wanted = self.reference[on][:, :3]
        apart = _rms(self.images[way][on][:, :3] - wanted) / wanted.mean()
        return float(np.sqrt(max(apart**2 - self.noise**2, 0.0)))

    def mean(self, way: str) -> float:
        """Of the surfaces, against Cycles."""
        on = self.surfaces
        return float(self.images[way][on][:, :3].mean() / self.reference[on][:, :3].mean())

    @property
    def noise(self) -> float:
        """Of the reference, as it adds to what pictures are apart from it."""
        on = self.surfaces
        apart = self.images["cycles"][on][:, :3] - self.images["cycles again"][on][:, :3]
        return _rms(apart) / 2 / self.reference[on][:, :3].mean()

    @property
    def gain(self) -> float:
        """How many times less wrong than the plain HDRI at its best setting."""
        return min(self.wrong("default"), self.wrong("zero")) / self.wrong("converted")


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def analytic_map(folder: Path, name: str) -> Path:
    """One of `ANALYTIC`, written as a file."""
    pixels = sky(1024, 0.5)
    for azimuth, elevation, radius, radiance in ANALYTIC[name]:
        paint_disc(pixels, direction(azimuth, elevation), radius, radiance)
    path = folder / f"{name}.exr"
    exr.write(path, pixels.astype(np.float32))
    return path


def plates_of(path: Path, normals: np.ndarray) -> np.ndarray:
    """Reflected radiance of white plates with these normals, (n, 3): the map summed up, (n, 3)."""
    environment = load(path)
    height, width = environment.height, environment.width
    v, u = (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width
    directions = sphere.to_directions(u[None, :], v[:, None])
    light = environment.radiance * sphere.row_solid_angles(width, height)[:, None, None]
    cosines = [np.maximum(directions @ normal, 0) for normal in normals]
    return np.array([np.einsum("ijk,ij->k", light, one) for one in cosines]) / np.pi


def measure(path: Path, scene: str, options: argparse.Namespace) -> Result:
    """Render in a process of its own. Raises RuntimeError where that ends early."""
    with tempfile.TemporaryDirectory(prefix="eevee-") as name:
        command = [sys.executable, "-m", "tests.benchmarks.eevee_renders", str(path), name]
        command += ["--scene", scene, "--samples", str(options.samples)]
        command += ["--reference", str(options.reference), "--plates", str(options.plates)]
        if options.size and scene == "shadows":
            command += ["--size", str(options.size)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        report = Path(name) / "renders.json"
        if done.returncode or not report.exists():
            said = (done.stdout + done.stderr)[-2000:]
            raise RuntimeError(f"{path.stem}: Blender ended with {done.returncode}: {said}")
        if "Shadow buffer full" in done.stdout + done.stderr:
            print(f"{path.stem}: the shadow buffer was full", file=sys.stderr)
        images = {one.stem: np.load(one) for one in sorted(Path(name).glob("*.npy"))}
        return Result(**json.loads(report.read_text(encoding="utf-8")), images=images)


def without_eevee() -> str:
    """Why EEVEE cannot render here, or nothing: without a vendor's EGL it ends the process."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return "EEVEE needs libEGL.so.1 (Debian: libegl1)"
    egl.eglGetDisplay.restype = ctypes.c_void_p
    if not egl.eglGetDisplay(None):
        return "EEVEE needs EGL of some vendor (Debian: libegl-mesa0, libgl1-mesa-dri)"
    return ""


def main(arguments: Sequence[str] | None = None) -> list[Result]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="*", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--name", default="eevee", help="of the files")
    parser.add_argument("--analytic", nargs="*", choices=ANALYTIC, help="maps of closed form")
    parser.add_argument("--scenes", nargs="*", default=["shadows"], help="for each given map")
    parser.add_argument("--size", type=int)
    parser.add_argument("--plates", type=int, default=8, help="orientations of the plate")
    parser.add_argument("--samples", type=int, default=16, help="of EEVEE")
    parser.add_argument("--reference", type=int, default=512, help="samples of Cycles, twice")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results: list[Result] = []
    with tempfile.TemporaryDirectory(prefix="eevee-maps-") as name:
        known = [(analytic_map(Path(name), one), "plate") for one in options.analytic or ()]
        for path, scene in known + [(p, s) for s in options.scenes for p in options.maps]:
            result = measure(path, scene, options)
            if scene == "plate":
                normals = eevee_report.NORMALS[: options.plates]
                result = eevee_report.with_truth(result, plates_of(path, normals))
            results.append(result)
            print(eevee_report.line(result), flush=True)
            eevee_report.write(results, options.output, options.name)
    return results


if __name__ == "__main__":
    main()
