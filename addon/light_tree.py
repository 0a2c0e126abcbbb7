"""Cycles' light tree: whether a scene needs it, and what keeps it from leaving out light.

In Cycles 4.5 and 5.2 the tree draws every second sample among lamps whose whole disc a surface
faces. Where it faces none, any that reaches above its horizon is as good, but only the first
`core.sampling.MOST_IN_TREE` distant lights can be drawn, while all count as if they could: what
the others should give is missing. In fog it is so everywhere. Guards are dark points, of which
every surface faces one whole, so that there is always something to draw; fog they cannot help.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.app.translations import pgettext_rpt as said
from mathutils import Vector

from ..core.conversion import Conversion
from ..core.passes import parts_of
from ..core.sampling import MOST_IN_TREE, needs_light_tree
from .lamps import FARTHEST, GUARDS, LEAST, lamp_data
from .rig import GUARD, Rig
from .scene_needs import SceneNeeds, users_things
from .trace import TAG

CORNERS = (1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)
"""Towards guards: of a regular tetrahedron, so a surface faces one within 71 degrees."""


MIRRORED = 45.0
"""Variance of a sample in a picture that is all mirrors and clear glass, in squares of the mean:
their glints are noise however suns are chosen. By docs/benchmarks/light_tree.md."""


@dataclass(frozen=True)
class TreePlan:
    """is_idle: the tree costs more than it saves. is_wrong: it would leave out light. Either way it
    is switched off. guarded: it leaves out none if there are guards. warnings: whole sentences."""

    is_idle: bool = False
    is_wrong: bool = False
    guarded: bool = False
    warnings: tuple[str, ...] = ()

    @property
    def off(self) -> bool:
        return self.is_idle or self.is_wrong


def tree_plan(
    scene: bpy.types.Scene,
    conversion: Conversion,
    needs: SceneNeeds,
    found: SceneNeeds,
    pays: bool,
) -> TreePlan:
    """What to do with a scene's light tree. needs: what may not be skipped. found: the same as the
    scene has it, whether or not anything shall be skipped. pays: whether the tree saves more noise
    than time, where there are no lights but a conversion's."""
    if not hasattr(scene, "cycles"):
        return TreePlan()
    if not scene.cycles.use_light_tree and not scene.sunsplit.light_tree_off:
        return TreePlan()  # as the user has it
    if not needs.other_lights and not pays:
        return TreePlan(is_idle=True)
    suns = len(conversion.suns) + needs.twins(conversion.suns)
    if not suns or not overflows(suns + _other_suns(scene)):
        return TreePlan()
    if not found.fog:
        return TreePlan(guarded=True)
    if not found.other_lights:
        line = said("The light tree is off: in fog Cycles leaves out light of so many lamps by it.")
        return TreePlan(is_wrong=True, warnings=(line,))
    line = said(
        "In fog Cycles' light tree leaves out light of so many lamps: switch it off, or allow "
        "fewer lights."
    )
    return TreePlan(guarded=True, warnings=(line,))


def tree_pays(conversion: Conversion, needs: SceneNeeds) -> bool:
    """Whether the tree saves more noise than time, where there are no lights but a conversion's."""
    if not conversion.suns:
        return False
    _, residual = parts_of(conversion, by_strength=True)
    beside = residual.variance + MIRRORED * needs.mirrored_part
    return needs_light_tree(conversion.suns, conversion.strata.light, beside)


def overflows(suns: int) -> bool:
    """Whether the tree cannot draw among so many suns and a world."""
    return suns + 1 > MOST_IN_TREE


def make_guards(rig: Rig, lamps: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """Lamps without light for the rig of others, in no collection yet.

    They have a billionth of the brightest one's strength, as the tree does not draw what has none.
    """
    strength = max(lamp.data.energy for lamp in lamps)
    return [_guard(rig, Vector(corner).normalized(), strength) for corner in CORNERS]


def _guard(rig: Rig, to_light: Vector, strength: float) -> bpy.types.Object:
    data = lamp_data(np.full(3, strength), 0.0)
    data.exposure = np.log2(LEAST)
    data.use_shadow = False  # in EEVEE a shadow would cost a map
    guard = bpy.data.objects.new(GUARDS, data)
    guard[TAG] = guard[GUARD] = True
    guard.parent = rig.holder
    guard.rotation_mode = "QUATERNION"
    guard.rotation_quaternion = to_light.to_track_quat("Z", "Y")
    guard.location = FARTHEST * to_light
    guard.hide_select = True  # it is nothing to work with
    guard.visible_camera = False
    return guard


def _other_suns(scene: bpy.types.Scene) -> int:
    """Sun lamps that are not a conversion's."""
    return sum(1 for thing in users_things(scene) if _is_sun(thing))


def _is_sun(thing: bpy.types.Object) -> bool:
    return thing.type == "LIGHT" and thing.data.type == "SUN"
