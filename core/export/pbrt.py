"""pbrt-v4: `distant` lights and an `infinite` one (the published file format, version 4)."""

from __future__ import annotations

import numpy as np

from .axes import Z_UP, Axes, chosen_axes
from .emitters import Emitters, Rays, emitters_of
from .made import Made, heading, number, numbers
from .names import Names, check_text, names_of
from .octahedral import octahedral
from .settings import ExportSettings
from .skylight import Skylight
from .stage import STAGE, Ball, Camera, Stage, Thing, mesh_of


def made_for_pbrt(sky: Skylight, settings: ExportSettings) -> Made:
    """Its own axes are Sunsplit's: a map's pole is Z."""
    axes = chosen_axes(settings.up, Z_UP)
    emitters = emitters_of(sky, "many rays", settings.discs)
    losses = tuple(emitters.losses)
    names = names_of("pbrt", sky.name)
    check_text(sky.name, "pbrt")
    radiance = None
    if emitters.radiance is not None:
        radiance = octahedral(emitters.radiance, emitters.has_cells)
    comments = [f"# {line}" for line in heading(emitters, axes, losses)]
    return Made(
        names,
        "\n".join([*comments, *_lights(emitters, axes, names.map), ""]),
        "\n".join([*comments, *_scene(STAGE, axes, names), ""]),
        radiance,
        axes,
        losses,
    )


def _lights(emitters: Emitters, axes: Axes, map_name: str) -> list[str]:
    lines = [
        "# Include this after WorldBegin. With so many lights pbrt's own choice among them would",
        '# leave the map without samples: Integrator ... "string lightsampler" "power"',
    ]
    for rays in emitters.rays:
        lines += _distant(rays, axes)
    if emitters.radiance is not None:
        turn = np.eye(4)
        turn[:3, :3] = axes.rotation_of_map(emitters.turn, np.eye(3))
        lines += [
            "AttributeBegin",
            f"  ConcatTransform [ {numbers(turn.T)} ]",  # column by column
            f'  LightSource "infinite" "string filename" {_text(map_name)}',
            "AttributeEnd",
        ]
    return lines


def _distant(rays: Rays, axes: Axes) -> list[str]:
    return [
        f'LightSource "distant" "point3 from" [ {numbers(to_light)} ] "point3 to" [ 0 0 0 ] '
        f'"rgb L" [ {numbers(rays.irradiance)} ]'
        for to_light in axes.of(rays.to_light)
    ]


def _scene(stage: Stage, axes: Axes, names: Names) -> list[str]:
    lines = [*_camera(stage.camera, axes, names), "WorldBegin", f"Include {_text(names.lights)}"]
    for name, thing in stage.things.items():
        lines += [f"# {name}", *_shape(thing, axes)]
    return lines


def _camera(camera: Camera, axes: Axes, names: Names) -> list[str]:
    place, target, up = (
        numbers(axes.of(np.array(v))) for v in (camera.place, camera.target, (0.0, 0.0, 1.0))
    )
    shorter = min(camera.field_of_view, camera.field_of_view_of_height)
    picture = names.scene.removesuffix(".pbrt") + ".exr"
    return [
        # pbrt's cameras are left-handed: without this the picture would be mirrored.
        "Scale -1 1 1",
        f"LookAt {place}  {target}  {up}",
        f'Camera "perspective" "float fov" [ {number(shorter)} ]',
        f'Film "rgb" "integer xresolution" [ {camera.width} ] '
        f'"integer yresolution" [ {camera.height} ] "string filename" {_text(picture)}',
        'Sampler "zsobol" "integer pixelsamples" [ 64 ]',
        'Integrator "path" "integer maxdepth" [ 8 ] "string lightsampler" "power"',
    ]


def _shape(thing: Thing, axes: Axes) -> list[str]:
    material = f'  Material "diffuse" "rgb reflectance" [ {numbers(thing.colour)} ]'
    if isinstance(thing, Ball):
        shape = [
            f"  Translate {numbers(axes.of(np.array(thing.centre)))}",
            f'  Shape "sphere" "float radius" [ {number(thing.radius)} ]',
        ]
    else:
        mesh = mesh_of(thing)
        shape = [
            f'  Shape "trianglemesh" "point3 P" [ {numbers(axes.of(mesh.points))} ]',
            f'    "integer indices" [ {" ".join(map(str, mesh.triangles.ravel()))} ]',
        ]
    return ["AttributeBegin", material, *shape, "AttributeEnd"]


def _text(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
