"""What exports are held against: Cycles' renders of their scene under the plain HDRI."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from scipy.ndimage import binary_erosion, gaussian_filter

from sunsplit.core.export.stage import STAGE, Camera, mesh_of
from tests.blender import add_mesh, fresh_scene, hdri_world, material_of_colour
from tests.files import sunsplit
from tests.render.compare import Estimate, estimate

WIDTH, HEIGHT = 240, 135

SHADOWS = 1.0
"""Pixels that shadows may be elsewhere (issue: within a pixel)."""

LIKENESS = 0.8
"""Correlation of a window's pictures, at least. Where a shadow is missing or far away it is below a
half; of faint edges, which noise and the steps of many lights blur, it was .93. Shadows that are a
few pixels elsewhere are told by their shift."""

ALONG = 0.2
"""A shift along an edge changes nothing but noise: a direction in which a window's picture changes
by a smaller part of what it does in another one is not asked about."""

MEAN = 0.005
"""Relative difference of the means of each channel that an export may make (issue: 0.5 %)."""


def add_stage(scene: bpy.types.Scene, width: int = WIDTH, height: int = HEIGHT) -> None:
    """The scene that every export comes with, made in Blender without any export."""
    for name, thing in STAGE.things.items():
        made, mesh = mesh_of(thing), bpy.data.meshes.new(name)
        mesh.from_pydata(made.points.tolist(), [], made.triangles.tolist())
        if name == "ball":
            mesh.normals_split_custom_set_from_vertices(made.normals.tolist())
        surface = material_of_colour(name, thing.colour)
        add_mesh(scene, mesh, surface, Matrix()).name = name
    add_camera(scene, STAGE.camera, width, height)


def add_camera(scene: bpy.types.Scene, camera: Camera, width: int, height: int) -> None:
    data = bpy.data.cameras.new("Camera")
    made = bpy.data.objects.new("Camera", data)
    data.sensor_fit, data.angle = "HORIZONTAL", np.radians(camera.field_of_view)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = camera.frame, camera.place
    made.matrix_world = Matrix(frame.tolist())
    scene.collection.objects.link(made)
    scene.camera = made
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100


@dataclass(frozen=True, eq=False)
class Reference:
    """picture: Cycles' of the stage. ground: where it shows the ground and no edge of a thing,
    (height, width)."""

    picture: Estimate
    ground: np.ndarray


def reference(hdri: Path, folder: Path, samples: int = 64, seeds: int = 4) -> Reference:
    """The stage under a plain HDRI."""
    scene = fresh_scene()
    hdri_world(scene, hdri)
    add_stage(scene)
    # As far as the exports' own scenes follow light.
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 7
    return Reference(estimate(scene, folder, samples, seeds), _ground(scene))


def _ground(scene: bpy.types.Scene) -> np.ndarray:
    """Which pixels of the camera's picture look at the ground, three pixels from all else."""
    camera, width, height = STAGE.camera, scene.render.resolution_x, scene.render.resolution_y
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    half = np.tan(np.radians(camera.field_of_view) / 2)
    seen = np.zeros((height, width), bool)
    for row in range(height):
        for column in range(width):
            x = (2 * (column + 0.5) / width - 1) * half
            y = (1 - 2 * (row + 0.5) / height) * half * height / width
            ray = camera.frame @ (x, y, -1)
            hit = scene.ray_cast(graph, Vector(camera.place), Vector(ray.tolist()))
            seen[row, column] = hit[0] and hit[4].name == "ground"
    return binary_erosion(seen, iterations=3, border_value=1)


@dataclass(frozen=True)
class Shadows:
    """shift: how many pixels they lie elsewhere at most. likeness: correlation of the pictures
    where they are least alike. Both nan where no shadow has an edge."""

    shift: float
    likeness: float


def shadows_of(wanted: Reference, found: np.ndarray, windows: int = 4) -> Shadows:
    """How shadows on the ground are other than Cycles has them, window by window of the picture.

    In each window that has edges: the correlation, which tells shadows that are missing or far
    away; and the shift that explains the difference best, by least squares, where a picture changes
    by its gradient times the shift (Lucas and Kanade 1981). Slightly blurred, so that noise does
    not count as edges.
    """
    before, after = (
        gaussian_filter(picture.mean(axis=-1), 1.5) for picture in (wanted.picture.mean, found)
    )
    down, right = np.gradient(before)
    height, width = before.shape
    shifts, likenesses = [], []
    for top in np.array_split(np.arange(height), windows):
        for left in np.array_split(np.arange(width), windows):
            at = np.ix_(top, left)
            inside = wanted.ground[at]
            slopes = np.stack([down[at][inside], right[at][inside]], axis=-1)
            # An edge: where the picture changes by a twentieth of its mean from pixel to pixel.
            if (np.hypot(*slopes.T) > 0.05 * before.mean()).sum() < 12:
                continue
            one, other = before[at][inside], after[at][inside]
            shifts.append(np.hypot(*np.linalg.lstsq(slopes, one - other, rcond=ALONG)[0]))
            with np.errstate(invalid="ignore"):  # where the other has no edges at all
                likenesses.append(np.nan_to_num(np.corrcoef(one, other)[0, 1]))
    if not shifts:
        return Shadows(np.nan, np.nan)
    return Shadows(float(max(shifts)), float(min(likenesses)))


def shadows_agree(wanted: Reference, found: np.ndarray) -> None:
    """Fail when shadows on the ground lie more than a pixel elsewhere, or are not there."""
    shadows = shadows_of(wanted, found)
    print(shadows)
    assert shadows.shift < SHADOWS
    assert shadows.likeness > LIKENESS


def converted(hdri: Path, folder: Path, *options: str) -> Path:
    """A conversion by the command line: its `<name>.lights.json`."""
    sunsplit("convert", hdri, "-o", folder, *options, check=True)
    return folder / f"{hdri.stem}.lights.json"


def exported(lights: Path, folder: Path, kind: str, *options: str) -> Path:
    """An export by the command line: its folder."""
    sunsplit("export", lights, "--format", kind, "-o", folder, *options, check=True)
    return folder
