"""Light groups "Suns" and "Sky", for artists who balance the two after the render."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

SUNS, SKY = "Suns", "Sky"

ADDED = "sunsplit_light_groups"
"""Custom property of a view layer: the groups that the conversion has added to it."""

OWN = "sunsplit_own_light_group"
"""Custom property of a converted world: the group that it would be in without the conversion."""


def put_into_groups(
    layers: Iterable[bpy.types.ViewLayer],
    world: bpy.types.World,
    lamps: Sequence[bpy.types.Object],
) -> None:
    """Give view layers both groups, lamps the one and their world the other."""
    for layer in layers:
        missing = [name for name in (SUNS, SKY) if name not in layer.lightgroups]
        for name in missing:
            layer.lightgroups.add(name=name)
        if missing:
            layer[ADDED] = missing
    for lamp in lamps:
        lamp.lightgroup = SUNS
    world[OWN] = world.lightgroup
    world.lightgroup = SKY


def take_out_of_groups(world: bpy.types.World) -> None:
    """Put a converted world, or its copy, back into the group that is the user's."""
    if OWN in world:
        world.lightgroup = world[OWN]
        del world[OWN]


def remove_groups(layers: Iterable[bpy.types.ViewLayer]) -> None:
    """Take away the groups that a conversion has added; those of the user stay."""
    for layer in layers:
        for name in layer.get(ADDED, ()):
            if name in layer.lightgroups:
                layer.lightgroups.remove(layer.lightgroups[name])
        if ADDED in layer:
            del layer[ADDED]
