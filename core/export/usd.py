"""USD: a UsdLux DistantLight for each sun and a DomeLight for the map.

By UsdLux a normalised DistantLight gives a surface that faces it an irradiance of its intensity
(times 2 to its exposure), whatever its angle, which is that of a whole diameter. Blender's importer
(as of 4.5 and 5.2) makes a lamp of four times that, and of twice the angle. No value serves both:
the file holds one variant for either, and a setting says which is chosen until the user chooses.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from .. import sphere
from ..errors import UnusableInput
from ..suns import Sun
from .axes import Z_UP, Axes, chosen_axes
from .emitters import CELLS_BLENDED, Emitters, emitters_of
from .made import Made, heading
from .names import check_text, names_of
from .settings import ExportSettings, Reader
from .skylight import Skylight
from .stage import STAGE
from .usd_scene import SCENE, add_scene, place_in_stage

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdLux

LAYOUT = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
"""Unturned, a DomeLight has the image's centre at +Z, its left at +X and its pole at +Y, whatever
the stage's up axis is. (DomeLight_1 follows the up axis; but Blender turns it wrongly there, and
older renderers do not know it.)"""

FACTORS: dict[Reader, tuple[float, float]] = {"usdlux": (1.0, 1.0), "blender": (0.25, 0.5)}
"""What a reader must be given, for it to arrive at the right irradiance and at the right angle."""

VARIANTS = "reader"
LIGHTS = "/Sunsplit"


def made_for_usd(sky: Skylight, settings: ExportSettings) -> Made:
    """Z up, as Sunsplit is. Raises UnusableInput: Pixar's library is not there, or a name is such
    that no USD file can refer to it."""
    try:
        import pxr.UsdLux  # noqa: F401
    except ImportError as error:
        raise UnusableInput(
            "USD needs Pixar's library, which Blender of blender.org has: pip install usd-core."
        ) from error
    check_text(sky.name, "USD", ("\\", ":SDF_FORMAT_ARGS:"))
    axes = chosen_axes(settings.up, Z_UP)
    emitters = emitters_of(sky, "discs", settings.discs)
    reader = settings.reader if emitters.discs else None
    losses = (*emitters.losses, *_losses(emitters, reader))
    names = names_of("usd", sky.name)
    about = "\n".join(heading(emitters, axes, losses))
    lights = _written(about, axes, lambda stage: _lights(stage, emitters, axes, names.map, reader))
    scene = _written(about, axes, lambda stage: add_scene(stage, STAGE, axes))
    _refer(scene, f"{SCENE}/Light", names.lights, reader)
    return Made(
        names, lights.ExportToString(), scene.ExportToString(), emitters.radiance, axes, losses
    )


def _losses(emitters: Emitters, reader: Reader | None) -> list[str]:
    lines = []
    if emitters.has_cells:
        lines.append(CELLS_BLENDED)
    if reader == "usdlux":
        lines.append(
            "Blender's own importer takes such suns for four times as strong and twice as wide: "
            'for it, choose the reader "blender".'
        )
    if reader == "blender":
        lines.append(
            "The suns are as Blender's importer takes them; to others they are a quarter as strong "
            'and half as wide: for them, choose the reader "usdlux".'
        )
    return lines


def _written(about: str, axes: Axes, fill: Callable[[Usd.Stage], None]) -> Sdf.Layer:
    """A layer that is no file, filled by way of a stage, which is gone when this returns."""
    from pxr import Sdf, Usd, UsdGeom

    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.documentation = about
    stage = Usd.Stage.Open(layer)
    up = UsdGeom.Tokens.z if axes.name == Z_UP.name else UsdGeom.Tokens.y
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    fill(stage)
    return layer


def _refer(layer: Sdf.Layer, path: str, file: str, reader: Reader | None) -> None:
    """Bring a file in. Without a stage, which would look for the file, that is not there yet."""
    from pxr import Sdf

    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier, prim.typeName = Sdf.SpecifierDef, "Xform"
    prim.referenceList.prependedItems.append(Sdf.Reference(f"./{file}"))
    if reader:
        prim.variantSelections[VARIANTS] = reader


def _lights(
    stage: Usd.Stage, emitters: Emitters, axes: Axes, map_name: str, reader: Reader | None
) -> None:
    from pxr import UsdGeom, UsdLux

    root = UsdGeom.Xform.Define(stage, LIGHTS).GetPrim()
    stage.SetDefaultPrim(root)
    paths = [f"{LIGHTS}/Sun_{n}" for n in range(1, len(emitters.discs) + 1)]
    for path, sun in zip(paths, emitters.discs, strict=True):
        _sun(UsdLux.DistantLight.Define(stage, path), sun, axes)
    if reader:
        variants = root.GetVariantSets().AddVariantSet(VARIANTS)
        for name, factors in FACTORS.items():
            variants.AddVariant(name)
            variants.SetVariantSelection(name)
            with variants.GetVariantEditContext():
                for path, sun in zip(paths, emitters.discs, strict=True):
                    _strength(UsdLux.DistantLight.Get(stage, path), sun, *factors)
        variants.SetVariantSelection(reader)
    if emitters.radiance is not None:
        dome = UsdLux.DomeLight.Define(stage, f"{LIGHTS}/Map")
        dome.CreateIntensityAttr(1.0)
        dome.CreateExposureAttr(0.0)
        dome.CreateTextureFileAttr(f"./{map_name}")
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        place_in_stage(dome, axes.rotation_of_map(emitters.turn, LAYOUT))


def _sun(light: UsdLux.DistantLight, sun: Sun, axes: Axes) -> None:
    """All of a sun that every reader takes alike."""
    strongest = sun.irradiance.max()
    colour = sun.irradiance / strongest if strongest > 0 else np.ones(3)
    light.CreateColorAttr(tuple(colour.tolist()))
    light.CreateExposureAttr(0.0)
    light.CreateNormalizeAttr(True)
    # It shines along its -Z; how it is turned about that is all one.
    back = axes.of(sun.to_light)
    place_in_stage(light, np.stack([*sphere.tangents(back), back], axis=-1))


def _strength(light: UsdLux.DistantLight, sun: Sun, brightness: float, width: float) -> None:
    light.CreateIntensityAttr(float(sun.irradiance.max()) * brightness)
    light.CreateAngleAttr(float(np.degrees(sun.angular_diameter)) * width)
