"""The scene of an export as glTF: meshes, matt materials and a camera."""

from __future__ import annotations

import numpy as np

from ..axes import Axes
from ..stage import Camera, Stage, Thing, mesh_of
from .document import Document, numbers_of, quaternion

SPECULAR = "KHR_materials_specular"

NEAR, FAR = 0.1, 1000.0
"""Metres from the camera that are shown."""


def add_stage(document: Document, stage: Stage, axes: Axes) -> None:
    """Every thing of a stage, and its camera."""
    for name, thing in stage.things.items():
        _add_thing(document, name, thing, axes)
    _add_camera(document, stage.camera, axes)


def _add_thing(document: Document, name: str, thing: Thing, axes: Axes) -> None:
    document.use(SPECULAR)
    material = {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*thing.colour, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        # Without it everything would have the sheen of plastic.
        "extensions": {SPECULAR: {"specularFactor": 0.0}},
    }
    mesh = mesh_of(thing)
    primitive = {
        "attributes": {
            "POSITION": document.add_vectors(axes.of(mesh.points), with_bounds=True),
            "NORMAL": document.add_vectors(axes.of(mesh.normals)),
        },
        "indices": document.add_indices(mesh.triangles),
        "material": document.add("materials", material),
    }
    index = document.add("meshes", {"name": name, "primitives": [primitive]})
    document.add_node(name, {"mesh": index})


def _add_camera(document: Document, camera: Camera, axes: Axes) -> None:
    perspective = {
        "yfov": float(np.radians(camera.field_of_view_of_height)),
        "aspectRatio": camera.width / camera.height,
        "znear": NEAR,
        "zfar": FAR,
    }
    index = document.add("cameras", {"type": "perspective", "perspective": perspective})
    place = {
        "translation": numbers_of(axes.of(np.array(camera.place))),
        # A camera of glTF looks along its own -Z as the stage's does.
        "rotation": quaternion(axes.matrix @ camera.frame),
    }
    document.add_node("camera", {"camera": index, **place})
