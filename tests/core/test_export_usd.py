"""Exports to USD, read by Pixar's own library: schema, numbers, axes, names."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade, UsdValidation

from sunsplit.core import (
    ConversionSettings,
    ExportSettings,
    convert,
    export_conversion,
    skylight_of,
    sphere,
)
from sunsplit.core.errors import UnusableInput
from sunsplit.core.export.axes import Y_UP, Z_UP
from sunsplit.core.export.skylight import Skylight
from sunsplit.core.export.stage import STAGE, mesh_of
from sunsplit.core.settings import BadSetting
from sunsplit.core.suns import Sun
from tests.files import noise, sunny, sunsplit
from tests.maps import direction, environment

AXES = {"z": Z_UP, "y": Y_UP}
WIDTHS = np.radians([0.0, 0.01, 0.53, 20.0, 120.0, 180.0])


def sun(to_light: np.ndarray, width: float, radiance: object) -> Sun:
    """A disc of a radiance, or for a point what it gives."""
    half = width / 2
    part = 2 * np.pi * (1 - np.cos(half)) if width else 1
    scalar = np.asarray(radiance, float) * part
    return Sun(to_light, scalar * (1 + np.cos(half)) / 2, scalar, width, 1)


def turned(seed: int) -> np.ndarray:
    """A rotation, (3, 3)."""
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


def sky(name: str = "sky", turn: int = 0) -> Skylight:
    """A sun of each width, one of them right above, and a map."""
    places = [direction(90 * n - 100, 90 - 35 * n) for n in range(len(WIDTHS))]
    suns = [sun(*pair, (7, 5, 0.5 * n)) for n, pair in enumerate(zip(places, WIDTHS, strict=True))]
    made = Skylight(name, tuple(suns), noise(), False, np.eye(3))
    return made.turned(turned(turn)) if turn else made


def bare(name: str = "bare") -> Skylight:
    return Skylight(name, sky().suns, None, False, np.eye(3))


def sunless(name: str = "sunless") -> Skylight:
    return Skylight(name, (), noise(), False, np.eye(3))


def opened(made: Skylight, folder, which: str = "lights", **settings: str) -> Usd.Stage:
    return Usd.Stage.Open(
        str(getattr(export_conversion(made, folder, ExportSettings("usd", **settings)), which))
    )


def lamps(stage: Usd.Stage) -> list[UsdLux.DistantLight]:
    return [UsdLux.DistantLight(prim) for prim in stage.Traverse() if prim.IsA(UsdLux.DistantLight)]


def the_map(stage: Usd.Stage) -> UsdLux.DomeLight:
    (dome,) = (UsdLux.DomeLight(prim) for prim in stage.Traverse() if prim.IsA(UsdLux.DomeLight))
    return dome


def to_world(thing: UsdGeom.Xformable) -> np.ndarray:
    """(4, 4), for vectors that are columns."""
    return np.array(thing.ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T


def facing_irradiance(lamp: UsdLux.DistantLight) -> np.ndarray:
    """Of a surface that faces a light, by what UsdLux says of intensity, exposure, colour, angle
    and normalize; of angles up to 180 degrees."""
    given = np.array(lamp.GetColorAttr().Get(), float) * lamp.GetIntensityAttr().Get()
    given *= 2 ** lamp.GetExposureAttr().Get()
    if lamp.GetNormalizeAttr().Get():  # then it is the irradiance, else the disc's radiance
        return given
    return given * np.pi * np.sin(np.radians(lamp.GetAngleAttr().Get()) / 2) ** 2


def complaints(stage: Usd.Stage) -> list[str]:
    """Of all validators that come with the library."""
    every = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return [
        error.GetErrorAsString() for error in UsdValidation.ValidationContext(every).Validate(stage)
    ]


@pytest.mark.parametrize("up", ["usual", "y", "z"])
@pytest.mark.parametrize("make", [sky, bare, sunless])
@pytest.mark.parametrize("which", ["lights", "scene"])
def test_the_checker_finds_nothing(tmp_path, make, up, which):
    assert not complaints(opened(make(), tmp_path, which, up=up))


@pytest.mark.parametrize("which", ["lights", "scene"])
def test_the_checker_would_find_a_missing_map(tmp_path, which):
    stage = opened(sky(), tmp_path, which)
    (tmp_path / "sky.usd.exr").unlink()
    assert complaints(stage)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("which", ["lights", "scene"])
def test_suns_by_the_specification(tmp_path, up, which):
    made = sky(turn=3)
    stage = opened(made, tmp_path, which, up=up)
    found = lamps(stage)
    assert [lamp.GetPrim().GetName() for lamp in found] == [f"Sun_{n}" for n in range(1, 7)]
    for lamp, sun in zip(found, made.suns, strict=True):
        assert facing_irradiance(lamp) == pytest.approx(sun.irradiance, rel=1e-6)
        assert np.radians(lamp.GetAngleAttr().Get()) == pytest.approx(
            sun.angular_diameter, rel=1e-6
        )
        matrix = to_world(lamp)
        assert AXES[up].of(sun.to_light) == pytest.approx(matrix[:3, 2], abs=1e-12)
        assert matrix[:3, :3] @ matrix[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1)


@pytest.mark.parametrize("which", ["lights", "scene"])
def test_suns_for_blenders_importer(tmp_path, which):
    """A quarter of the intensity, and half of the angle."""
    made = sky()
    stage = opened(made, tmp_path, which, reader="blender")
    found = lamps(stage)
    for lamp, sun in zip(found, made.suns, strict=True):
        strength = lamp.GetIntensityAttr().Get() * np.array(lamp.GetColorAttr().Get())
        assert 4 * strength == pytest.approx(sun.irradiance, rel=1e-6)
        width = 2 * np.radians(lamp.GetAngleAttr().Get())
        assert width == pytest.approx(sun.angular_diameter, rel=1e-6)


def test_the_reader_can_be_chosen_afterwards(tmp_path):
    stage = opened(sky(), tmp_path, "scene")
    before = [lamp.GetIntensityAttr().Get() for lamp in lamps(stage)]
    (root,) = (prim for prim in stage.Traverse() if prim.HasVariantSets())
    variants = root.GetVariantSets().GetVariantSet("reader")
    assert set(variants.GetVariantNames()) == {"usdlux", "blender"}
    assert variants.GetVariantSelection() == "usdlux"
    variants.SetVariantSelection("blender")
    assert [4 * lamp.GetIntensityAttr().Get() for lamp in lamps(stage)] == pytest.approx(before)


@pytest.mark.parametrize(("reader", "other"), [("usdlux", "blender"), ("blender", "usdlux")])
def test_whom_the_suns_are_not_for_is_said(tmp_path, reader, other):
    files = export_conversion(sky(), tmp_path, ExportSettings("usd", reader=reader))
    assert f'"{other}"' in files.losses[-1]
    assert files.losses[-1] in Usd.Stage.Open(str(files.scene)).GetRootLayer().documentation
    assert not export_conversion(sunless(), tmp_path, ExportSettings("usd", reader=reader)).losses


def test_an_unknown_reader():
    with pytest.raises(BadSetting, match="reader must be one of usdlux, blender"):
        ExportSettings("usd", reader="karma")


def test_a_black_sun(tmp_path):
    made = Skylight("black", (sun(direction(0, 30), 0.1, (0, 0, 0)),), None, False, np.eye(3))
    stage = opened(made, tmp_path)
    (lamp,) = lamps(stage)
    assert (facing_irradiance(lamp) == 0).all()


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("turn", [0, 5])
@pytest.mark.parametrize("which", ["lights", "scene"])
def test_how_the_map_lies(tmp_path, up, turn, which):
    """By OpenEXR's layout, which the schema of DomeLight quotes: latitude to +Y, longitude 0 at +Z
    in the image's middle, a quarter to the left of it +X."""
    made = sky(turn=turn)
    stage = opened(made, tmp_path, which, up=up)
    dome = the_map(stage)
    directions = np.random.default_rng(1).normal(size=(2000, 3))
    x, y, z = to_world(dome)[:3, :3].T @ AXES[up].of(directions).T
    u = 0.5 - np.arctan2(x, z) / (2 * np.pi)
    v = 0.5 - np.arctan2(y, np.hypot(x, z)) / np.pi
    wanted = np.array(sphere.to_image(directions @ made.turn))
    assert np.array([u, v]) == pytest.approx(wanted, abs=1e-12)
    assert dome.GetTextureFormatAttr().Get() == "latlong"
    assert dome.GetIntensityAttr().Get() == 1
    assert dome.GetExposureAttr().Get() == 0
    assert dome.GetColorAttr().Get() == Gf.Vec3f(1)


@pytest.mark.parametrize(("up", "axis"), [("usual", "Z"), ("y", "Y"), ("z", "Z")])
@pytest.mark.parametrize("which", ["lights", "scene"])
def test_the_stage(tmp_path, up, axis, which):
    stage = opened(sky(), tmp_path, which, up=up)
    assert UsdGeom.GetStageUpAxis(stage) == axis
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim()
    assert "by Sunsplit" in stage.GetRootLayer().documentation


def test_without_a_map_or_suns(tmp_path):
    files = export_conversion(bare(), tmp_path / "bare", ExportSettings("usd"))
    assert files.map is None
    stage = Usd.Stage.Open(str(files.scene))
    assert not any(prim.IsA(UsdLux.DomeLight) for prim in stage.Traverse())
    assert len(lamps(stage)) == len(WIDTHS)
    stage = opened(sunless(), tmp_path, "scene")
    assert not lamps(stage)
    assert the_map(stage)


def test_suns_painted_into_the_map(tmp_path):
    made = sky()
    files = export_conversion(made, tmp_path, ExportSettings("usd", discs="map"))
    stage = Usd.Stage.Open(str(files.lights))
    (point,) = lamps(stage)
    assert point.GetAngleAttr().Get() == 0
    assert "Suns in the map: 5." in files.losses[0]
    assert files.losses[0] in stage.GetRootLayer().documentation


def test_cells_are_told_to_be_blended(tmp_path):
    conversion = convert(environment(sunny()), ConversionSettings(residual="voronoi"))
    files = export_conversion(skylight_of(conversion), tmp_path, ExportSettings("usd"))
    assert "Voronoi" in " ".join(files.losses)


NAMES = [
    "two words",
    'it\'s "so"',
    "@at@@@@",
    "naïve 日本",
    "a#b?c[d]%20",
    "x<UDIM>",
    "$HOME {x} `y`",
    "-1.0001",
    "a\u00a0b",
]


@pytest.mark.parametrize("name", NAMES)
def test_names(tmp_path, name):
    stage = opened(sky(name), tmp_path, "scene")
    assert len(lamps(stage)) == 6
    texture = the_map(stage).GetTextureFileAttr().Get()
    assert texture.resolvedPath == str(tmp_path / f"{name}.usd.exr")
    assert texture.path.startswith("./")
    assert not complaints(stage)


@pytest.mark.parametrize(
    "name", ["a\nb", "a\tb", "a\\b", "a\x85b", "a\udcffb", "a:SDF_FORMAT_ARGS:b=c"]
)
def test_names_that_usd_cannot_say(tmp_path, name):
    with pytest.raises(UnusableInput, match="rename the conversion"):
        export_conversion(sky(name), tmp_path, ExportSettings("usd"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_camera(tmp_path, up):
    stage, camera = opened(sky(), tmp_path, "scene", up=up), STAGE.camera
    (prim,) = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera))
    seen = UsdGeom.Camera(prim).GetCamera(Usd.TimeCode.Default())
    across = seen.GetFieldOfView(Gf.Camera.FOVHorizontal)
    assert across == pytest.approx(camera.field_of_view, rel=1e-6)
    assert seen.aspectRatio == pytest.approx(camera.width / camera.height, rel=1e-6)
    matrix = to_world(UsdGeom.Camera(prim))
    assert matrix[:3, 3] == pytest.approx(AXES[up].of(np.array(camera.place)))
    ahead = np.subtract(camera.target, camera.place)
    assert -matrix[:3, 2] == pytest.approx(AXES[up].of(ahead / np.linalg.norm(ahead)))
    assert AXES[up].matrix[:, 2] @ matrix[:3, 1] > 0.5


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_things(tmp_path, up):
    stage = opened(sky(), tmp_path, "scene", up=up)
    for name, thing in STAGE.things.items():
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/Scene/{name}"))
        points = np.array(mesh.GetPointsAttr().Get())
        assert points == pytest.approx(AXES[up].of(mesh_of(thing).points), abs=1e-6)
        corners = points[np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.array(mesh.GetNormalsAttr().Get())
        firsts = normals[np.array(mesh.GetFaceVertexIndicesAttr().Get())[::3]]
        assert (np.einsum("ij,ij->i", across, firsts) > 0).all()
        material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
        shader, _, _ = material.ComputeSurfaceSource()
        assert shader.GetInput("diffuseColor").Get() == Gf.Vec3f(*thing.colour)
        assert shader.GetInput("ior").Get() == 1


def test_without_the_library(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.delitem(sys.modules, "pxr.UsdLux")
    with pytest.raises(UnusableInput, match="pip install usd-core"):
        export_conversion(sky(), tmp_path, ExportSettings("usd"))
    assert not list(tmp_path.iterdir())


def test_on_the_command_line(tmp_path, sunrise):
    sunsplit("convert", sunrise, "-o", tmp_path, check=True)
    lights = tmp_path / f"{sunrise.stem}.lights.json"
    for reader in ("usdlux", "blender"):
        out = tmp_path / reader
        sunsplit("export", lights, "--format", "usd", "--reader", reader, "-o", out, check=True)
        stage = Usd.Stage.Open(str(out / f"{sunrise.stem}.scene.usda"))
        (root,) = (prim for prim in stage.Traverse() if prim.HasVariantSets())
        assert root.GetVariantSets().GetVariantSelection("reader") == reader
