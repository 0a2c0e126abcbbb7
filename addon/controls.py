"""What an artist changes after a conversion: factors of all suns, kept with the outermost empty of
their rig, and the input of the world that turns them.

They are properties of the empty itself, and not of the add-on's settings: so they go wherever it
goes, and drivers can read them where there is no Sunsplit.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Factor:
    """A property of the outermost empty that changes all lamps; neutral: as measured."""

    name: str
    label: str
    neutral: float
    least: float
    most: float
    description: str


STRENGTH = Factor(
    *("strength", "Strength", 1.0, 0.0, 4.0),
    description="Strength of all suns, times what was measured",
)
WARMTH = Factor(
    *("warmth", "Warmth", 0.0, -1.0, 1.0),
    description="Tint of all suns: 0 as measured, 1 as of a lamp of 3000 K, -1 as of 14000 K",
)
SOFTNESS = Factor(
    *("softness", "Softness", 1.0, 0.0, 10.0),
    description="Width of all suns, times what was measured",
)
FACTORS = (STRENGTH, WARMTH, SOFTNESS)


def reset_factors(sky: bpy.types.Object) -> None:
    """Make all suns as they were measured."""
    for factor in FACTORS:
        sky[factor.name] = factor.neutral
    sky.update_tag()


def changed_factors(sky: bpy.types.Object) -> list[str]:
    """The names of factors that make suns other than measured."""
    return [factor.name for factor in FACTORS if sky.get(factor.name) != factor.neutral]


def rotation_control(settings: bpy.types.PropertyGroup) -> tuple[bpy.types.NodeSocket, int] | None:
    """The input that turns the map of a conversion, and its lamps, about the vertical, and which
    component of it; None where no single input does."""
    for empty in _rig_of(settings):
        for curve in empty.animation_data.drivers if empty.animation_data else ():
            variables = curve.driver.variables
            vertical = curve.data_path == "rotation_euler" and curve.array_index == 2
            if (vertical or curve.data_path == "rotation_axis_angle") and len(variables) == 1:
                target = variables[0].targets[0]
                return _resolved(target.id, target.data_path)
    return None


def _rig_of(settings: bpy.types.PropertyGroup) -> list[bpy.types.Object]:
    """The empties that hold a conversion's lamps, the outermost first; without a lamp only that.
    This way round it takes no time, as to ask for children does."""
    lamp = next((entry.lamp for entry in settings.lamps if entry.lamp), None)
    if lamp is None:
        return [settings.sky] if settings.sky else []
    found = [lamp]
    while found[0].parent is not None:
        found.insert(0, found[0].parent)
    return found[:-1]


def _resolved(owner: bpy.types.ID, path: str) -> tuple[bpy.types.NodeSocket, int] | None:
    socket_path, _, index = path.partition(".default_value")
    try:
        socket = owner.path_resolve(socket_path)
    except ValueError:  # the user has taken the node away
        return None
    return socket, int(index.strip("[]")) if index else -1
