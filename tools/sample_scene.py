"""Make `sample_scenes/courtyard.blend`: run with Blender 4.5, so that both Blenders open it.

    .venv-4.5/bin/python tools/sample_scene.py

A few things on a ground, lit by the HDRI beside it: columns for shadows, a mirror, glass and a
rough metal for reflections. Written by a script, so that nobody has to trust a binary file.
"""

from __future__ import annotations

from pathlib import Path

import bpy
from mathutils import Vector

FOLDER = Path(__file__).resolve().parent.parent / "sample_scenes"
HDRI = "spruit_sunrise_1k.hdr"

CAMERA = Vector((-8.2, 3.4, 2.4))
LOOKS_AT = Vector((0.3, -1.0, 1.35))


def main() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "courtyard.blend"), compress=True)
    add_world(scene)
    add_things()
    add_camera(scene)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 640, 360
    scene.cycles.samples = 64
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    # Both would cut off light, and more of it where a sampling is noisier: no basis to compare on.
    scene.cycles.sample_clamp_indirect = 0
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.exposure = -0.6
    bpy.ops.file.make_paths_relative()
    forget_home()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "courtyard.blend"), compress=True)
    (FOLDER / "courtyard.blend1").unlink(missing_ok=True)


def forget_home() -> None:
    """File browsers in the factory's screens remember the home folder of who made the file."""
    for screen in bpy.data.screens:
        for area in screen.areas:
            for space in area.spaces:
                if space.type == "FILE_BROWSER" and space.params:
                    space.params.directory = b"//"


def add_world(scene: bpy.types.Scene) -> None:
    world = bpy.data.worlds.new("Sunrise")
    world.use_nodes = True
    scene.world = world
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(FOLDER / HDRI))
    texture.location = -320, 300
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])


def add_things() -> None:
    bpy.ops.mesh.primitive_plane_add(size=60)
    paint("Ground", (0.42, 0.4, 0.38), Roughness=0.9)
    for place in ((3.2, 3.6), (4.2, 1.2), (4.4, -1.4), (3.4, -4.2), (0.4, -5.4)):
        bpy.ops.mesh.primitive_cylinder_add(
            radius=0.17, depth=2.8, location=(*place, 1.4), vertices=48
        )
        paint("Column", (0.75, 0.68, 0.58), Roughness=0.7)
    ball((0.6, 1.5, 0.8), 0.8, "Mirror", (0.95, 0.95, 0.95), Metallic=1.0, Roughness=0.0)
    ball((-0.6, -0.2, 0.6), 0.6, "Glass", (1, 1, 1), Transmission_Weight=1.0, Roughness=0.0)
    ball((0.9, -2.0, 0.85), 0.85, "Rough Metal", (0.9, 0.75, 0.5), Metallic=1.0, Roughness=0.35)
    ball((-2.2, 1.3, 0.35), 0.35, "Clay", (0.7, 0.25, 0.15), Roughness=0.9)


def ball(
    place: tuple[float, float, float],
    radius: float,
    name: str,
    colour: tuple[float, float, float],
    **inputs: float,
) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=place, segments=96, ring_count=48)
    bpy.ops.object.shade_smooth()
    paint(name, colour, **inputs)


def paint(name: str, colour: tuple[float, float, float], **inputs: float) -> None:
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (*colour, 1)
        for key, value in inputs.items():
            shader.inputs[key.replace("_", " ")].default_value = value
    bpy.context.object.name = name
    bpy.context.object.data.materials.append(material)


def add_camera(scene: bpy.types.Scene) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location = CAMERA
    camera.rotation_euler = (CAMERA - LOOKS_AT).to_track_quat("Z", "Y").to_euler()
    camera.data.lens = 38
    scene.camera = camera


if __name__ == "__main__":
    main()
