"""A picture of a sky for the Asset Browser: what its light does to a matt ball, to a mirror
and to a pole that casts a shadow, with the sky behind them."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector
from numpy.typing import NDArray

from ...core import sphere
from ...core.environment import LUMINANCE_WEIGHTS, luminance
from ...core.errors import UnusableInput
from ...core.files.written import WrittenConversion
from .sky import Sky

SAMPLES, WITHOUT_DENOISER = 16, 192
"""Of a pixel; a denoiser makes up for the difference."""

GROUND, SHOWN = 0.4, 0.3
"""The ground's albedo, and how bright a picture shows it where all light reaches it: a third of
what the film takes for white, so that the sky has room above."""

ASIDE = np.radians(115)
"""How far from the camera's view the brightest sun stands: over its shoulder, so that the balls are
lit and shadows fall into the picture."""


def picture_of(sky: Sky, size: int) -> NDArray[np.float32]:
    """A square picture of a sky's light, for the display: (size * size * 4,) from the bottom up.

    The scene that it is rendered in stays in the file. Raises UnusableInput where there is no
    Cycles.
    """
    scene = _stage(sky, size)
    with tempfile.TemporaryDirectory(prefix="sunsplit-") as folder:
        path = Path(folder) / "preview.png"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(str(path))
        pixels = np.empty(size * size * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    return pixels


def _stage(sky: Sky, size: int) -> bpy.types.Scene:
    scene = bpy.data.scenes.new("Preview")
    scene.world = sky.world
    scene.collection.children.link(sky.collection)
    _set_render(scene, size)
    scene.view_settings.exposure = _exposure(sky.conversion)
    turn = Matrix.Rotation(_view(sky.conversion), 4, "Z")
    matt, mirror = _surface("Matt", 0.5, 1.0, 0.0), _surface("Mirror", 0.9, 0.04, 1.0)
    _add(scene, _disc(3.0), _surface("Ground", GROUND, 1.0, 0.0), turn)
    for mesh, surface, x, y in (
        (_ball(0.68), matt, 0.55, 0.82),
        (_ball(0.68), mirror, 0.15, -0.78),
        (_pole(0.05, 1.25), matt, -1.0, 0.95),
    ):
        _add(scene, mesh, surface, turn @ Matrix.Translation((x, y, 0)))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.angle = np.radians(37)
    upright = Euler((np.radians(80), 0, np.radians(-90))).to_matrix().to_4x4()
    camera.matrix_world = turn @ Matrix.Translation((-5.4, 0, 1.8)) @ upright
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def _set_render(scene: bpy.types.Scene, size: int) -> None:
    try:
        scene.render.engine = "CYCLES"
    except TypeError:
        raise UnusableInput(
            "This Blender has no Cycles, which renders the previews: ask for none."
        ) from None
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.use_compositing = scene.render.use_sequencer = False
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.max_bounces = 4
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.samples = SAMPLES
    cycles.use_denoising = True
    try:
        cycles.denoiser = "OPENIMAGEDENOISE"
    except TypeError:  # this Blender was built without it
        cycles.use_denoising, cycles.samples = False, WITHOUT_DENOISER


def _view(conversion: WrittenConversion) -> float:
    """Where the camera looks, an azimuth: with the brightest sun over its shoulder, or without a
    sun at the middle of the map."""
    if not conversion.suns:
        return 0.0
    x, y, _ = conversion.suns[0].to_light
    return float(np.arctan2(y, x) - ASIDE)


def _exposure(conversion: WrittenConversion) -> float:
    """In stops: the ground is as bright under every sky."""
    up = sum(
        float(s.irradiance @ LUMINANCE_WEIGHTS) * s.to_light[2].clip(0) for s in conversion.suns
    )
    if conversion.radiance is not None:
        height, width = conversion.radiance.shape[:2]
        upright = sphere.to_directions(np.zeros(height), (np.arange(height) + 0.5) / height)[:, 2]
        weights = sphere.row_solid_angles(width, height) * upright.clip(0)
        up += float(weights @ luminance(conversion.radiance).sum(axis=1))
    # A light from below leaves the ground dark: then the balls shall be seen.
    mean = float(conversion.account.source @ LUMINANCE_WEIGHTS) / 4
    light = max(up, mean / 2)
    return float(np.clip(np.log2(SHOWN * np.pi / (GROUND * light)), -30, 30)) if light else 0.0


def _surface(name: str, grey: float, roughness: float, metallic: float) -> bpy.types.Material:
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    shader = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (grey, grey, grey, 1)
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Specular IOR Level"].default_value = 0.5 if metallic else 0.0
    return made


def _add(
    scene: bpy.types.Scene, mesh: bpy.types.Mesh, surface: bpy.types.Material, matrix: Matrix
) -> None:
    mesh.materials.append(surface)
    thing = bpy.data.objects.new(mesh.name, mesh)
    thing.matrix_world = matrix
    scene.collection.objects.link(thing)


def _ball(radius: float) -> bpy.types.Mesh:
    """Stands on the ground."""
    shape = bmesh.new()
    raised = Matrix.Translation(Vector((0, 0, radius)))
    bmesh.ops.create_uvsphere(shape, u_segments=64, v_segments=32, radius=radius, matrix=raised)
    return _mesh("Ball", shape, smooth=True)


def _pole(radius: float, height: float) -> bpy.types.Mesh:
    """Stands on the ground."""
    shape = bmesh.new()
    bmesh.ops.create_cone(
        shape,
        cap_ends=True,
        segments=32,
        radius1=radius,
        radius2=radius,
        depth=height,
        matrix=Matrix.Translation((0, 0, height / 2)),
    )
    return _mesh("Pole", shape)


def _disc(radius: float) -> bpy.types.Mesh:
    shape = bmesh.new()
    bmesh.ops.create_circle(shape, cap_ends=True, segments=128, radius=radius)
    return _mesh("Ground", shape)


def _mesh(name: str, shape: bmesh.types.BMesh, smooth: bool = False) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    if smooth:
        mesh.shade_smooth()
    return mesh
