"""Exact mirrors and clear glass: they are shown the map itself, whatever lights all else.

Where they showed the lamps, they would show discs instead of windows and clouds. Cycles tells the
world whether a ray comes straight from such a surface (Is Singular Ray of a Light Path node), so
the world can show it the map. Lamps must not be met by that ray then, or their light would be there
twice, and of a lamp Cycles cannot be told by which rays it is met: either none meets it (its
multiple importance is off), or all from a thing that it is linked to. So a lamp that rough surfaces
must meet is linked to all but these things, and a twin of it that no ray meets to them alone: light
that they throw on other things, blurred as Filter Glossy has it, is the twin's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

from .driven import Formula
from .rig import TWIN, Rig
from .shaders import gloss_of, is_exact, may_be_exact
from .trace import TAG
from .unmet import WIDE, are_worn_as_told, has_shape, unmet_width, worn_by

ALL_BUT, ONLY = "Sunsplit All but Mirrors", "Sunsplit Mirrors"
"""Collections of what lamps are linked to."""

FOLLOWED = ("energy", "exposure", "use_temperature", "temperature", "angle")
"""What a twin has from its lamp, whoever has set it there, beside colour and direction."""


def singular_things(
    scene: bpy.types.Scene, shown: Sequence[bpy.types.Object]
) -> list[bpy.types.Object]:
    """The things that are exact mirrors or clear glass, or have a layer that is; none where not all
    of them can be told, or where one of them has a rougher gloss besides, which must meet lamps.
    shown: all that renders may show."""
    if any(layer.material_override for layer in scene.view_layers):
        return []
    if not are_worn_as_told(shown):
        return []
    found = []
    for thing in filter(has_shape, shown):
        nodes = list(worn_by(thing))
        if any(may_be_exact(node, name) for node in nodes for name in gloss_of(node)):
            return []
        if any(is_exact(node, name) for node in nodes for name in gloss_of(node)):
            if min(unmet_width(node, but_exact=True) for node in nodes) < WIDE:
                return []
            found.append(thing)
    return found


def make_twins(
    rig: Rig, lamps: Sequence[bpy.types.Object], things: Sequence[bpy.types.Object]
) -> list[bpy.types.Object]:
    """Link the lamps that rays meet to all but these things, and a twin of each to them alone: the
    twins, in no collection yet. things: see `singular_things`."""
    if not things:
        return []
    lamps = [lamp for lamp in lamps if lamp.data.cycles.use_multiple_importance_sampling]
    if not lamps:
        return []
    # To nothing would mean to everything: if all of these are deleted the rig is still there.
    others, these = (
        _linked(ALL_BUT, things, "EXCLUDE"),
        _linked(ONLY, [*things, rig.sky], "INCLUDE"),
    )
    twins = []
    for lamp in lamps:
        lamp.light_linking.receiver_collection = others
        twins.append(_twin(rig, lamp))
        twins[-1].light_linking.receiver_collection = these
    return twins


def _linked(name: str, things: Iterable[bpy.types.Object], state: str) -> bpy.types.Collection:
    made = bpy.data.collections.new(name)
    made[TAG] = True
    for thing in things:
        made.objects.link(thing)
    for one in made.collection_objects:
        one.light_linking.link_state = state
    return made


def _twin(rig: Rig, lamp: bpy.types.Object) -> bpy.types.Object:
    """A lamp that does as another does, but is not met by rays."""
    data = lamp.data.copy()
    data.animation_data_clear()
    data.cycles.use_multiple_importance_sampling = False
    for path in FOLLOWED:
        _follow(data, lamp.data, path)
    for component in range(3):
        _follow(data, lamp.data, "color", component)
    twin = bpy.data.objects.new(data.name, data)
    twin[TAG] = twin[TWIN] = True
    twin.parent, twin.location = rig.holder, lamp.location
    twin.rotation_mode = "QUATERNION"
    twin.rotation_quaternion = lamp.rotation_quaternion
    turned = twin.constraints.new("COPY_ROTATION")
    turned.target = lamp
    _follow(twin, lamp, "hide_render")
    _follow(twin, lamp, "hide_viewport")
    twin.hide_select = True  # it is the lamp that is worked with
    for rays in ("camera", "diffuse", "glossy", "transmission", "volume_scatter"):
        setattr(twin, f"visible_{rays}", getattr(lamp, f"visible_{rays}"))
    twin.lightgroup = lamp.lightgroup
    return twin


def _follow(owner: bpy.types.ID, other: bpy.types.ID, path: str, component: int = -1) -> None:
    """Let a property be as the other's of the same name."""
    formula = Formula()
    kind = "OBJECT" if isinstance(other, bpy.types.Object) else "LIGHT"
    now = getattr(other, path) if component < 0 else getattr(other, path)[component]
    at = path if component < 0 else f"{path}[{component}]"
    formula.drive(owner, path, component, formula.property(kind, other, at), now)


def links_of(lamps: Iterable[bpy.types.Object]) -> set[bpy.types.Collection]:
    """What a conversion has linked lamps to."""
    linked = {lamp.light_linking.receiver_collection for lamp in lamps}
    return {made for made in linked if made and made.get(TAG)}


def remove_links(links: Iterable[bpy.types.Collection]) -> None:
    """Take that away once no lamp is linked to it any more."""
    for made in links:
        if not made.users:
            bpy.data.collections.remove(made)
