"""What holds the lamps: empties that turn as the world turns its map, so that the suns stay where
the map shows them, in the viewport and in animations.

Each rotation on the map's way is undone by an empty of its own, outermost the one that is nearest
to the scene. The outermost has the factors that artists change, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from .controls import FACTORS
from .driven import Formula
from .mapping import Matrix3, Rotation, turns
from .trace import TAG, Input, Place, constant

SKY = "Sunsplit Sky"

GUARD = "sunsplit_guard"
"""Custom property of a lamp that gives no light (see `light_tree`)."""

TWIN = "sunsplit_twin"
"""Custom property of a lamp that only mirrors and clear glass have (see `singular`)."""


@dataclass(frozen=True, eq=False)
class Rig:
    """sky: the outermost empty. holder: the innermost, which lamps are parented to. from_map: what
    directions in the map pass before `holder` turns them, (3, 3)."""

    sky: bpy.types.Object
    holder: bpy.types.Object
    from_map: Matrix3


def make_rig(texture: Place) -> Rig:
    """Empties that follow the mapping of an environment texture; in no collection yet."""
    joints = list(_joints(texture))
    last = max((k for k, joint in enumerate(joints) if isinstance(joint, Rotation)), default=-1)
    from_map = np.eye(3)
    for fixed in joints[last + 1 :]:
        from_map = from_map @ fixed
    sky = holder = _empty(None)
    for k, joint in enumerate(joints[: last + 1]):
        holder = sky if k == 0 else _empty(holder)
        if isinstance(joint, Rotation):
            _follow(holder, joint)
        else:
            holder.matrix_basis = Matrix(joint.tolist()).to_4x4()
    for factor in FACTORS:
        sky[factor.name] = factor.neutral
        sky.id_properties_ui(factor.name).update(
            min=factor.least,
            max=factor.most,
            default=factor.neutral,
            description=factor.description,
        )
    return Rig(sky, holder, from_map)


def _joints(texture: Place) -> Iterator[Matrix3 | Rotation]:
    """What must be undone to come from the map to the world, the last thing first: rotations, or
    what is undone already."""
    for turn in turns(texture):
        steps = [turn.before, turn.rotation, turn.after]
        for step in steps:
            if isinstance(step, Rotation):
                yield step
            elif step is not None and not _only_lengthens(step):
                yield np.linalg.inv(step)


def _only_lengthens(matrix: Matrix3) -> bool:
    scale = matrix[0, 0]
    return scale > 0 and np.allclose(matrix, scale * np.eye(3), rtol=0, atol=1e-7 * scale)


def _empty(parent: bpy.types.Object | None) -> bpy.types.Object:
    empty = bpy.data.objects.new(SKY, None)
    empty[TAG] = True
    empty.parent = parent
    # It stands at the origin, in the way of what the user wants to select there.
    empty.hide_select = True
    return empty


def _follow(empty: bpy.types.Object, rotation: Rotation) -> None:
    """Let an empty undo what a node turns directions by."""
    sign = 1 if rotation.undone else -1
    if rotation.axis is None:
        # The inverse of a rotation about x, then y, then z is one about z, then y, then x.
        empty.rotation_mode = "XYZ" if rotation.undone else "ZYX"
        for k in range(3):
            _follow_input(empty, "rotation_euler", k, rotation.angles, k, sign)
        return
    empty.rotation_mode = "AXIS_ANGLE"
    _follow_input(empty, "rotation_axis_angle", 0, rotation.angles, 0, sign)
    for k in range(3):
        if isinstance(rotation.axis, tuple):
            empty.rotation_axis_angle[k + 1] = rotation.axis[k]
        else:
            _follow_input(empty, "rotation_axis_angle", k + 1, rotation.axis, k, 1)


def _follow_input(
    empty: bpy.types.Object, path: str, index: int, at: Input, component: int, sign: int
) -> None:
    formula = Formula()
    text = formula.input(at, component)
    now = sign * float(constant(at)[component])
    formula.drive(empty, path, index, text if sign > 0 else f"-{text}", now)


def rig_of(sky: bpy.types.Object | None) -> list[bpy.types.Object]:
    """All empties of a rig, the outermost first."""
    found = []
    while sky is not None:
        found.append(sky)
        sky = next((c for c in sky.children if c.type == "EMPTY" and c.get(TAG)), None)
    return found


def guards_of(sky: bpy.types.Object | None) -> list[bpy.types.Object]:
    """Lamps of a rig that give no light (see `light_tree`)."""
    return [c for empty in rig_of(sky) for c in empty.children if c.get(GUARD)]


def twins_of(sky: bpy.types.Object | None) -> list[bpy.types.Object]:
    """Lamps of a rig that only mirrors and clear glass have (see `singular`)."""
    return [c for empty in rig_of(sky) for c in empty.children if c.get(TWIN)]


def remove_rig(sky: bpy.types.Object | None, lamps: Sequence[bpy.types.Object]) -> None:
    """Remove the empties that no scene uses any more. What the user has hung there stays where it
    is."""
    empties = rig_of(sky)
    if any(empty.users_scene for empty in empties):
        return
    for empty in empties:
        for child in [c for c in empty.children if c not in lamps and c not in empties]:
            where = child.matrix_world.copy()
            child.parent = None
            child.matrix_world = where
    for empty in empties:
        bpy.data.objects.remove(empty)
