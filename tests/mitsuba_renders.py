"""Renders of exports by Mitsuba 3, where it is installed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.installed import not_installed
from tests.plates import ALBEDO


def renderer():
    """Mitsuba with its variant that needs no other library; skips where there is none."""
    try:
        import mitsuba
    except ImportError:
        not_installed("The package mitsuba is not installed.")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def picture(path: Path, width: int, height: int, samples: int, seed: int) -> np.ndarray:
    """Of a scene's file, linear, float64 (height, width, 3)."""
    mitsuba = renderer()
    text = path.read_text(encoding="utf-8")
    for name, value in (("width", width), ("height", height)):
        text = _with_side(text, name, value)
    smaller = path.with_name(f"{width}.{path.name}")
    smaller.write_text(text, encoding="utf-8")
    scene = mitsuba.load_file(str(smaller))
    return np.array(mitsuba.render(scene, spp=samples, seed=seed), np.float64)


def _with_side(text: str, name: str, value: int) -> str:
    before, after = text.split(f'<integer name="{name}" value="')
    return f'{before}<integer name="{name}" value="{value}"' + after[after.index('"') + 1 :]


PLATE = """<scene version="3.5.0">
<integrator type="path"/>
<sensor type="perspective"><float name="fov" value="10"/>
<transform name="to_world"><lookat origin="{eye}" target="0, 0, 0" up="{aside}"/></transform>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/>
<rfilter type="box"/></film><sampler type="multijitter"/></sensor>
<shape type="rectangle"><transform name="to_world">
<lookat origin="0, 0, 0" target="{eye}" up="{aside}"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="{albedo}"/></bsdf></shape>
<include filename="{lights}"/></scene>"""


def plate(
    lights: Path, normal: np.ndarray, to_axes: Callable, samples: int, seed: int
) -> np.ndarray:
    """A white plate under exported lights, (24, 24, 3). to_axes: from Sunsplit's to the file's."""
    mitsuba = renderer()
    aside = np.eye(3)[np.argmin(np.abs(normal))]
    text = PLATE.format(
        eye=", ".join(map(str, to_axes(normal * 2))),
        aside=", ".join(map(str, to_axes(aside))),
        albedo=ALBEDO,
        lights=lights.name,
    )
    scene = lights.with_name("plate.xml")
    scene.write_text(text, encoding="utf-8")
    return np.array(mitsuba.render(mitsuba.load_file(str(scene)), spp=samples, seed=seed), float)
