"""Scenes for tests in a real Blender: worlds, surfaces, renders."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from mathutils import Matrix, Vector

import sunsplit
from sunsplit.addon.rig import GUARD, TWIN


def fresh_scene() -> bpy.types.Scene:
    """An empty scene with the add-on registered."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if not hasattr(bpy.types.Scene, "sunsplit"):
        sunsplit.register()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    # Clamping and caustics' blur would change the energy that the tests compare.
    scene.cycles.sample_clamp_indirect = 0
    scene.cycles.blur_glossy = 0
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.dither_intensity = 0
    return scene


def write_map(path: Path, pixels: np.ndarray) -> Path:
    """A map as a float32 EXR file."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, dtype=np.float32)}) as file:
        file.write(str(path))
    return path


def empty_world(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """A new world with a Background and an output; its node tree."""
    world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    scene.world = world
    tree = world.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs[0])
    return tree


def node(tree: bpy.types.NodeTree, kind: str) -> bpy.types.Node:
    """The first node of a type."""
    return next(n for n in tree.nodes if n.type == kind)


def hdri_world(scene: bpy.types.Scene, path: Path) -> bpy.types.Node:
    """A world lit by a map; its environment texture."""
    tree = empty_world(scene)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(path))
    tree.links.new(texture.outputs[0], node(tree, "BACKGROUND").inputs["Color"])
    return texture


def add_mapping(texture: bpy.types.Node) -> bpy.types.Node:
    """A Mapping node and a Texture Coordinate node before an environment texture."""
    tree = texture.id_data
    mapping = tree.nodes.new("ShaderNodeMapping")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    return mapping


def suns(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The lamps of a conversion, in their order; not what guards Cycles' light tree,
    nor twins for mirrors."""
    lamps = [thing for thing in scene.sunsplit.collection.objects if thing.type == "LIGHT"]
    return [lamp for lamp in lamps if not (lamp.get(GUARD) or lamp.get(TWIN))]


def to_light(lamp: bpy.types.Object) -> np.ndarray:
    """Unit vector towards a lamp, from what a renderer reads: its world matrix."""
    bpy.context.view_layer.update()
    return np.array(lamp.matrix_world.to_3x3() @ Vector((0, 0, 1)))


def camera_towards(
    scene: bpy.types.Scene, direction: np.ndarray, field_of_view: float, size: int
) -> bpy.types.Object:
    """A square camera at the origin that looks along a direction; angle in degrees."""
    data = bpy.data.cameras.new("Camera")
    camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    data.angle = np.radians(field_of_view)
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (-Vector(direction)).to_track_quat("Z", "Y")
    scene.camera = camera
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    return camera


def material(name: str, colour: tuple[float, float, float], **inputs: float) -> bpy.types.Material:
    """A Principled material; inputs by name with underscores."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    shader = node(made.node_tree, "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*colour, 1)
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made


def diffuse(name: str, albedo: float) -> bpy.types.Material:
    """An exactly Lambertian material."""
    return material_of_colour(name, (albedo, albedo, albedo))


def material_of_colour(name: str, colour: tuple[float, float, float]) -> bpy.types.Material:
    """The same with an albedo for each channel."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*colour, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs[0])
    return made


def add_mesh(
    scene: bpy.types.Scene, mesh: bpy.types.Mesh, surface: bpy.types.Material, matrix: Matrix
) -> bpy.types.Object:
    thing = bpy.data.objects.new(mesh.name, mesh)
    mesh.materials.append(surface)
    thing.matrix_world = matrix
    scene.collection.objects.link(thing)
    return thing


def plate_mesh(half: float) -> bpy.types.Mesh:
    """A square that faces +Z."""
    mesh = bpy.data.meshes.new("Plate")
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    return mesh


def box_mesh(x: float, y: float, z: float) -> bpy.types.Mesh:
    """A box with these half sides that stands on the origin's plane."""
    mesh = bpy.data.meshes.new("Box")
    corners = [
        (i * x, j * y, k * z) for k in (0, 2) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    sides = [(0, 3, 2, 1), (4, 5, 6, 7)] + [
        (i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)
    ]
    mesh.from_pydata(corners, [], sides)
    return mesh


def ball_mesh(radius: float) -> bpy.types.Mesh:
    """A smooth ball."""
    import bmesh

    mesh = bpy.data.meshes.new("Ball")
    shape = bmesh.new()
    bmesh.ops.create_uvsphere(shape, u_segments=96, v_segments=48, radius=radius)
    shape.to_mesh(mesh)
    shape.free()
    mesh.shade_smooth()
    return mesh


def render(scene: bpy.types.Scene, folder: Path, samples: int, seed: int = 0) -> np.ndarray:
    """Render and give the linear pixels, float64 (height, width, 3)."""
    return timed_render(scene, folder, samples, seed)[0]


@contextmanager
def kept_by_cycles(scene: bpy.types.Scene) -> Iterator[None]:
    """Until the block ends, Cycles keeps what it has made of a scene from render to render, and
    makes anew what has changed: of a map alone that takes longer than a small picture does."""
    scene.render.use_persistent_data = True
    try:
        yield
    finally:
        # Blender lets go of it here: no later render can show what the scene is no more.
        scene.render.use_persistent_data = False


def renders(scene: bpy.types.Scene, folder: Path, samples: int, seeds: int) -> list[np.ndarray]:
    """Renders of one scene by so many seeds, as by `render`, bit for bit."""
    with kept_by_cycles(scene):
        return [render(scene, folder, samples, seed) for seed in range(seeds)]


def timed_render(
    scene: bpy.types.Scene, folder: Path, samples: int, seed: int
) -> tuple[np.ndarray, float]:
    """Linear pixels, float64 (height, width, 3 or 4), and wall seconds of the render call alone."""
    scene.cycles.samples, scene.cycles.seed = samples, seed
    path = folder / "render.exr"
    scene.render.filepath = str(path)
    started = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds = time.perf_counter() - started
    with OpenEXR.File(str(path)) as file:
        (channel,) = file.channels().values()
        return channel.pixels.astype(np.float64), seconds
