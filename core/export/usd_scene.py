"""The scene that every export comes with, as USD: meshes, matt materials, a camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .axes import Axes
from .skylight import Floats
from .stage import Camera, Stage, Thing, Vector, mesh_of

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom, UsdShade

SCENE = "/Scene"

FILM = 0.36
"""Tenths of a metre, the unit of USD's cameras: the width of the camera's film, 36 mm."""


def add_scene(stage: Usd.Stage, made: Stage, axes: Axes) -> None:
    """All but the light. axes: the stage's."""
    from pxr import UsdGeom

    root = UsdGeom.Xform.Define(stage, SCENE).GetPrim()
    stage.SetDefaultPrim(root)
    _camera(UsdGeom.Camera.Define(stage, f"{SCENE}/Camera"), made.camera, axes)
    UsdGeom.Scope.Define(stage, f"{SCENE}/Materials")
    for name, thing in made.things.items():
        _thing(stage, name, thing, axes)


def _camera(to: UsdGeom.Camera, camera: Camera, axes: Axes) -> None:
    from pxr import Gf

    to.CreateHorizontalApertureAttr(FILM)
    to.CreateVerticalApertureAttr(FILM * camera.height / camera.width)
    to.CreateFocalLengthAttr(FILM / 2 / float(np.tan(np.radians(camera.field_of_view) / 2)))
    to.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1000.0))
    place_in_stage(to, axes.matrix @ camera.frame, axes.of(np.array(camera.place)))


def _thing(stage: Usd.Stage, name: str, thing: Thing, axes: Axes) -> None:
    from pxr import UsdGeom, UsdShade, Vt

    mesh, to = mesh_of(thing), UsdGeom.Mesh.Define(stage, f"{SCENE}/{name}")
    points = axes.of(mesh.points).astype(np.float32)
    to.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    to.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    to.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.triangles), 3))
    to.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.triangles.astype(np.int32).ravel()))
    to.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(axes.of(mesh.normals).astype(np.float32)))
    to.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    to.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    material = _matt(stage, f"{SCENE}/Materials/{name}", thing.colour)
    UsdShade.MaterialBindingAPI.Apply(to.GetPrim()).Bind(material)


def _matt(stage: Usd.Stage, path: str, colour: Vector) -> UsdShade.Material:
    """As near to Lambert's surface as UsdPreviewSurface goes: one that is as dense as air, whose
    surface reflects nothing."""
    from pxr import Sdf, UsdShade

    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(colour)
    for name, value in (("roughness", 1.0), ("metallic", 0.0), ("ior", 1.0)):
        shader.CreateInput(name, Sdf.ValueTypeNames.Float).Set(value)
    surface = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(surface)
    return material


def place_in_stage(
    thing: UsdGeom.Xformable, rotation: Floats, place: Floats | tuple[float, ...] = (0, 0, 0)
) -> None:
    """rotation: (3, 3), place: (3,), in the stage's axes."""
    from pxr import Gf

    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, place
    thing.AddTransformOp().Set(Gf.Matrix4d(matrix.T.tolist()))  # for vectors that are rows
