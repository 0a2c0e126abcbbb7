"""Mitsuba 3: `directional` emitters and an `envmap`, as XML and as a dict for `load_dict`."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..environment import LUMINANCE_WEIGHTS, scalar_irradiance
from .axes import Y_UP, Axes, chosen_axes
from .emitters import CELLS_BLENDED, Emitters, emitters_of
from .made import Made, heading, number, numbers
from .names import Names, check_text, names_of
from .settings import ExportSettings, Up
from .skylight import Floats, Skylight
from .stage import STAGE, Ball, Box, Camera, Stage, Thing

LAYOUT = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
"""Unturned, an `envmap` has the image's centre at +Z, its left at +X and its pole at +Y."""

VERSION = "3.5.0"
"""Of the file format: the first that knows `sampling_weight`."""

Emitter = dict[str, Any]


def made_for_mitsuba(sky: Skylight, settings: ExportSettings) -> Made:
    """Y up, as Mitsuba's own maps are."""
    axes = chosen_axes(settings.up, Y_UP)
    emitters = emitters_of(sky, "many rays", settings.discs)
    losses = (*emitters.losses, *([CELLS_BLENDED] if emitters.has_cells else []))
    names = names_of("mitsuba", sky.name)
    check_text(sky.name, "Mitsuba")
    comment = "\n".join(["", *heading(emitters, axes, losses), ""])
    return Made(
        names,
        _document(comment, _lights(emitters, axes, names.map)),
        _document(comment, _scene(STAGE, axes, names)),
        _radiance(emitters),
        axes,
        losses,
    )


def mitsuba_dict(sky: Skylight, up: Up = "usual", discs: str = "auto") -> dict[str, Any]:
    """Emitters for `mitsuba.load_dict({"type": "scene", **mitsuba_dict(sky), ...})`.

    Needs the package mitsuba, with a variant set; no files are written.
    """
    import mitsuba

    settings = ExportSettings("mitsuba", up, discs)
    made, axes = emitters_of(sky, "many rays", settings.discs), chosen_axes(settings.up, Y_UP)
    found = {}
    for n, emitter in enumerate(_emitters(made, axes)):
        if "to_world" in emitter:
            emitter["to_world"] = mitsuba.ScalarTransform4f(emitter["to_world"])
            emitter["bitmap"] = mitsuba.Bitmap(_radiance(made))
        else:
            irradiance = [float(value) for value in emitter["irradiance"]]
            emitter["irradiance"] = {"type": "rgb", "value": irradiance}
            emitter["direction"] = [float(value) for value in emitter["direction"]]
        found[f"sunsplit_{n}"] = emitter
    return found


def _emitters(emitters: Emitters, axes: Axes) -> list[Emitter]:
    """By the names of Mitsuba's parameters. Lots are drawn by how much light each gives: by default
    the map would get one of some hundred."""
    found: list[Emitter] = []
    for rays in emitters.rays:
        weight = float(rays.irradiance @ LUMINANCE_WEIGHTS)
        for to_light in axes.of(rays.to_light):
            found.append(
                {
                    "type": "directional",
                    "direction": -to_light,
                    "irradiance": rays.irradiance,
                    "sampling_weight": weight,
                }
            )
    if emitters.radiance is not None:
        turn = np.eye(4)
        turn[:3, :3] = axes.rotation_of_map(emitters.turn, LAYOUT)
        weight = float(scalar_irradiance(emitters.radiance) @ LUMINANCE_WEIGHTS)
        found.append({"type": "envmap", "to_world": turn, "sampling_weight": weight})
    return found


def _radiance(emitters: Emitters) -> NDArray[np.float32] | None:
    """The map with rows where Mitsuba looks for them: the first and the last one at the poles.

    It blends between rows, so one more between each two leaves it the map that it was.
    """
    if emitters.radiance is None:
        return None
    rows = emitters.radiance
    height, width = rows.shape[:2]
    out = np.empty((2 * height + 1, width, 3), np.float32)
    out[1::2] = rows
    out[2:-1:2] = (rows[:-1] + rows[1:]) / 2
    for pole in (0, -1):
        out[pole] = rows[pole].mean(axis=0, dtype=np.float64)
    return out


def _document(comment: str, elements: list[ElementTree.Element]) -> str:
    scene = ElementTree.Element("scene", version=VERSION)
    scene.append(ElementTree.Comment(comment))
    scene.extend(elements)
    ElementTree.indent(scene)
    return ElementTree.tostring(scene, encoding="unicode", xml_declaration=True) + "\n"


def _lights(emitters: Emitters, axes: Axes, map_name: str) -> list[ElementTree.Element]:
    found = []
    for emitter in _emitters(emitters, axes):
        element = ElementTree.Element("emitter", type=emitter["type"])
        _float(element, "sampling_weight", emitter["sampling_weight"])
        if emitter["type"] == "envmap":
            ElementTree.SubElement(element, "string", name="filename", value=map_name)
            _matrix(element, emitter["to_world"])
        else:
            x, y, z = map(number, emitter["direction"])
            ElementTree.SubElement(element, "vector", name="direction", x=x, y=y, z=z)
            _colour(element, "irradiance", emitter["irradiance"])
        found.append(element)
    return found


def _scene(stage: Stage, axes: Axes, names: Names) -> list[ElementTree.Element]:
    integrator = ElementTree.Element("integrator", type="path")
    ElementTree.SubElement(integrator, "integer", name="max_depth", value="8")
    things = [_shape(name, thing, axes) for name, thing in stage.things.items()]
    include = ElementTree.Element("include", filename=names.lights)
    return [integrator, _camera(stage.camera, axes), *things, include]


def _camera(camera: Camera, axes: Axes) -> ElementTree.Element:
    sensor = ElementTree.Element("sensor", type="perspective")
    _float(sensor, "fov", camera.field_of_view)
    place = ElementTree.SubElement(sensor, "transform", name="to_world")
    vectors = {"origin": camera.place, "target": camera.target, "up": (0.0, 0.0, 1.0)}
    turned = {k: ", ".join(map(number, axes.of(np.array(v)))) for k, v in vectors.items()}
    ElementTree.SubElement(place, "lookat", turned)
    film = ElementTree.SubElement(sensor, "film", type="hdrfilm")
    for side in ("width", "height"):
        value = str(getattr(camera, side))
        ElementTree.SubElement(film, "integer", name=side, value=value)
    ElementTree.SubElement(film, "rfilter", type="box")
    sampler = ElementTree.SubElement(sensor, "sampler", type="multijitter")
    ElementTree.SubElement(sampler, "integer", name="sample_count", value="64")
    return sensor


def _shape(name: str, thing: Thing, axes: Axes) -> ElementTree.Element:
    matrix = np.eye(4)
    if isinstance(thing, Ball):
        kind, matrix[:3, :3] = "sphere", np.eye(3) * thing.radius
        matrix[:3, 3] = thing.centre
    elif isinstance(thing, Box):
        kind, matrix = "cube", thing.matrix
    else:
        kind, matrix[:3, :3] = "rectangle", np.diag([thing.half, thing.half, 1.0])
    shape = ElementTree.Element("shape", type=kind, id=name)
    to_axes = np.eye(4)
    to_axes[:3, :3] = axes.matrix
    _matrix(shape, to_axes @ matrix)
    _colour(ElementTree.SubElement(shape, "bsdf", type="diffuse"), "reflectance", thing.colour)
    return shape


def _float(element: ElementTree.Element, name: str, value: float) -> None:
    ElementTree.SubElement(element, "float", name=name, value=number(value))


def _colour(
    element: ElementTree.Element, name: str, value: Floats | tuple[float, float, float]
) -> None:
    ElementTree.SubElement(element, "rgb", name=name, value=numbers(value).replace(" ", ", "))


def _matrix(element: ElementTree.Element, matrix: Floats) -> None:
    transform = ElementTree.SubElement(element, "transform", name="to_world")
    ElementTree.SubElement(transform, "matrix", value=numbers(matrix))
