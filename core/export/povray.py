"""POV-Ray 3.7: `light_source`s and a `sky_sphere`, in its scene description language."""

from __future__ import annotations

import re
from dataclasses import replace
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from .. import sphere
from ..suns import Sun
from ..tolerances import HALF_MAXIMUM
from .axes import Y_UP_LEFT, Axes, chosen_axes
from .emitters import Emitters, emitters_of, rays_of_disc
from .made import Made, heading, number
from .names import Names, names_of
from .settings import ExportSettings
from .skylight import Floats, Skylight
from .stage import STAGE, Ball, Box, Camera, Stage, Thing

LAYOUT = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]])
"""Unturned, `map_type 1` has the image's centre at -X, what is a quarter from its left at +Z and
its top at +Y: in POV-Ray's own left-handed axes a map that is not mirrored would look so."""

WIDE_DISC = np.radians(10.0)
"""Angular diameter from which a sun is painted. An area light is a flat grid: wider ones gave up to
0.5 % too much on surfaces that they graze. Radiosity finds a disc in the map that is wider."""

GRID = 17
"""Lights along each side of an area light. Shadows' edges are then, on average, 1 % of a sun's
light off what a true disc casts; 33 would still be 0.8 % off, and take twice as long."""

FAR = 1e6
"""Where suns stand, in a scene's units; POV-Ray sees nothing farther away than 1e7."""

DIM = 2.0**-4
"""A map whose brightest value is below is stored brighter: halfs lose digits below 2^-14."""

RADIOSITY = """\
#ifndef (Sunsplit_Radiosity) #declare Sunsplit_Radiosity = true; #end
#if (Sunsplit_Radiosity)
  global_settings {
    radiosity {
      count 600, 100000
      error_bound 0.2
      nearest_count 5
      recursion_limit 4
      adc_bailout 1e-5
      pretrace_start 0.08
      pretrace_end 0.02
      brightness 1
    }
  }
#end"""
"""count: directions of each gathering, from so many that no two gather along the same ones; the
1,600 that POV-Ray takes unless told otherwise are biased, by up to 1 %."""

NEEDED = """\
In a scene of your own, before this file is included:
  #version 3.7;
  global_settings { assumed_gamma 1.0 }
  #default { finish { ambient 0 diffuse 1 } }
With diffuse 1 a pigment is an albedo, and pictures show radiance in the HDRI's units.
Radiosity lets the map light surfaces, and is set here; with a radiosity of your own, before:
  #declare Sunsplit_Radiosity = false;
The scene is taken to lie around the origin, within some thousand units."""

LOSSES = {
    "grid": f"Suns with a width are area lights of {GRID} x {GRID}: shadows fade in so many steps, "
    "and mirrors do not show them.",
    "rays": "Suns too wide for an area light are parallel lights, 61 each: shadows fade in so many "
    "steps.",
    "radiosity": "The map lights surfaces by radiosity, which blurs its small shadows.",
    "missed": "Radiosity finds narrow suns in the map by luck only: their light will be blotchy or "
    "missing; as lights they are right.",
}


def made_for_povray(sky: Skylight, settings: ExportSettings) -> Made:
    """Left-handed with Y up, as most of POV-Ray's scenes are; Z up is right-handed."""
    axes = chosen_axes(settings.up, Y_UP_LEFT, Y_UP_LEFT)
    emitters = emitters_of(sky, "discs", settings.discs, WIDE_DISC)
    stem = plain_name(sky.name)
    losses = tuple(_losses(sky, emitters, stem))
    names = names_of("povray", stem)
    radiance, scale = emitters.radiance, 1.0
    if radiance is not None:
        radiance, scale = _within_half(radiance)
    comments = heading(emitters, axes, losses)
    lights = [*_comments([*comments, *NEEDED.splitlines()]), RADIOSITY]
    for sun in emitters.discs:
        lights += _sun(sun, axes)
    if radiance is not None:
        lights += _sky(replace(emitters, radiance=radiance), scale, axes, names.map)
    scene = [*_comments([*comments, _command(STAGE.camera, names)]), *_scene(STAGE, axes, names)]
    texts = ("\n".join([*lines, ""]) for lines in (lights, scene))
    return Made(names, *texts, radiance, axes, losses)


def plain_name(name: str) -> str:
    """As POV-Ray takes names of files: without letters beyond ASCII, spaces, quotes and slashes.
    What is replaced is told apart by some digits at the end."""
    plain = re.sub(r"[^A-Za-z0-9._+,-]", "_", name)
    if plain == name:
        return name
    return f"{plain}-{sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:6]}"


def _losses(sky: Skylight, emitters: Emitters, stem: str) -> list[str]:
    widths = [sun.angular_diameter for sun in emitters.discs if sun.angular_diameter]
    painted = {sun.angular_diameter for sun in sky.suns}.difference(widths, [0.0])
    found = {
        "grid": any(width < WIDE_DISC for width in widths),
        "rays": any(width >= WIDE_DISC for width in widths),
        "radiosity": emitters.radiance is not None,
        "missed": any(width < WIDE_DISC for width in painted),
    }
    losses = emitters.losses + [LOSSES[kind] for kind, lost in found.items() if lost]
    if stem != emitters.name:
        losses.append(f"POV-Ray cannot read a file of this name: the files are called {stem}.")
    return losses


def _comments(lines: list[str]) -> list[str]:
    return [f"// {line}" for line in lines]


def _command(camera: Camera, names: Names) -> str:
    picture = names.scene.removesuffix(".pov") + ".exr"
    return (
        f"povray +I{names.scene} +W{camera.width} +H{camera.height} +A0.1 +R3 -J +FE +O{picture}, "
        "in this folder."
    )


def _within_half(radiance: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """A map as POV-Ray can read it, which makes halfs of every EXR, and what is to be multiplied
    with afterwards: a power of two, which changes no digit."""
    brightest = float(radiance.max(initial=0))
    if brightest == 0 or DIM <= brightest <= HALF_MAXIMUM:
        return radiance, 1.0
    # Half of the largest half, at least a quarter of it.
    scale = 2.0 ** (np.floor(np.log2(brightest)) - 14)
    return radiance / np.float32(scale), scale


def _sun(sun: Sun, axes: Axes) -> list[str]:
    """A light of colour 1 makes a white surface that faces it shine with 1: with the radiance that
    an irradiance of pi gives."""
    if not sun.angular_diameter:
        return [_parallel(axes.of(sun.to_light), sun.irradiance)]
    if sun.angular_diameter >= WIDE_DISC:
        rays = axes.of(rays_of_disc(sun.to_light, sun.angular_diameter / 2))
        return [_parallel(to_light, sun.scalar_irradiance / len(rays)) for to_light in rays]
    size = 2 * FAR * np.tan(sun.angular_diameter / 2)
    across, along = (_vector(size * axes.of(side)) for side in sphere.tangents(sun.to_light))
    place = _vector(FAR * axes.of(sun.to_light))
    # Each light of the grid gives its part to a surface that faces it, not the sun's middle.
    return [
        f"light_source {{ {place} rgb {_vector(sun.scalar_irradiance / np.pi)}",
        f"  area_light {across}, {along}, {GRID}, {GRID} circular adaptive 2 area_illumination",
        "}",
    ]


def _parallel(to_light: Floats, irradiance: Floats) -> str:
    place, colour = _vector(FAR * to_light), _vector(irradiance / np.pi)
    return f"light_source {{ {place} rgb {colour} parallel point_at 0 }}"


def _sky(emitters: Emitters, scale: float, axes: Axes, map_name: str) -> list[str]:
    blend = "" if emitters.has_cells else " interpolate 2"
    turn = axes.rotation_of_map(emitters.turn, LAYOUT)
    return [
        "sky_sphere {",
        f'  pigment {{ image_map {{ exr "{map_name}" map_type 1{blend} }} }}',
        *([] if emitters.has_cells else _poles(emitters.radiance)),
        f"  {_matrix(turn, np.zeros(3))}",
        *([] if scale == 1 else [f"  emission rgb {number(scale)}"]),
        "}",
    ]


def _poles(radiance: NDArray[np.float32]) -> list[str]:
    """Lids over half a row at either pole, where POV-Ray would blend with the opposite pole."""
    radius = np.sin(np.pi / (2 * len(radiance)))
    return [
        f"  pigment {{ function {{ select({upwards}, 0, 0, 1) * select("
        f"x*x + z*z - {number(radius**2)}, 1, 0) }} "
        f"color_map {{ [0.5 rgbt 1] [0.5 rgb {_vector(row.mean(axis=0, dtype=np.float64))}] }} }}"
        for upwards, row in (("y", radiance[0]), ("-y", radiance[-1]))
    ]


def _scene(stage: Stage, axes: Axes, names: Names) -> list[str]:
    lines = [
        "#version 3.7;",
        "global_settings { assumed_gamma 1.0 }",
        "#default { finish { ambient 0 diffuse 1 } }",
        f'#include "{names.lights}"',
        *_camera(stage.camera, axes),
    ]
    for name, thing in stage.things.items():
        lines += [f"// {name}", *_shape(thing, axes)]
    return lines


def _camera(camera: Camera, axes: Axes) -> list[str]:
    """Its vectors themselves: they say what is right and what is left in axes of either hand."""
    right, up, back = axes.of(camera.frame.T)
    width = number(2 * np.tan(np.radians(camera.field_of_view) / 2))
    return [
        "camera {",
        f"  location {_vector(axes.of(np.array(camera.place)))}",
        f"  direction {_vector(-back)}",
        f"  right {width} * {_vector(right)}",
        f"  up {width} * image_height / image_width * {_vector(up)}",
        "}",
    ]


def _shape(thing: Thing, axes: Axes) -> list[str]:
    pigment = f"pigment {{ rgb {_vector(thing.colour)} }}"
    if isinstance(thing, Ball):
        centre = _vector(axes.of(np.array(thing.centre)))
        return [f"sphere {{ {centre}, {number(thing.radius)} {pigment} }}"]
    if isinstance(thing, Box):
        placed = _matrix(axes.matrix @ thing.matrix[:3, :3], axes.of(thing.matrix[:3, 3]))
        return [f"box {{ -1, 1 {pigment} {placed} }}"]
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]])
    points = ", ".join(_vector(corner) for corner in axes.of(corners * thing.half))
    return [f"polygon {{ 5, {points} {pigment} }}"]


def _vector(values: Floats | tuple[float, ...]) -> str:
    return "<" + ", ".join(number(value) for value in values) + ">"


def _matrix(matrix: Floats, offset: Floats) -> str:
    """POV-Ray writes what becomes of each axis, then of the origin."""
    return "matrix " + _vector(np.concatenate([matrix.T.ravel(), offset]))
