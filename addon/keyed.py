"""Where a camera is in other frames by its keys alone: nothing need be evaluated for that."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from mathutils import Euler, Matrix, Quaternion, Vector

from .changes import is_animated

SIZES = {"location": 3, "rotation_euler": 3, "rotation_quaternion": 4}
"""Properties that a camera is moved by, and how many numbers each has."""

SAME = 1e-5
"""What two matrices of the same place may differ by, as a part of how far away it is."""


@dataclass(frozen=True, eq=False)
class KeyedCamera:
    """A camera that only its own keys move, if anything does. curves: of each number of a property
    that has one."""

    camera: bpy.types.Object
    curves: dict[tuple[str, int], bpy.types.FCurve]

    def matrix_at(self, frame: int) -> Matrix:
        """Where it is in a frame."""
        return self._matrix(
            {
                name: [
                    self.curves[name, k].evaluate(frame) if (name, k) in self.curves else value
                    for k, value in enumerate(getattr(self.camera, name))
                ]
                for name in SIZES
            }
        )

    def is_told(self) -> bool:
        """Whether it stands where its properties say, by what is known of them here: it may have
        others that move it besides."""
        stands = self.camera.matrix_basis
        made = self._matrix({name: list(getattr(self.camera, name)) for name in SIZES})
        allowed = SAME * (1 + stands.translation.length)
        return all((one - other).length <= allowed for one, other in zip(made, stands, strict=True))

    def _matrix(self, values: dict[str, list[float]]) -> Matrix:
        mode = self.camera.rotation_mode
        if mode == "QUATERNION":
            turn = Quaternion(values["rotation_quaternion"]).normalized()
        else:
            turn = Euler(values["rotation_euler"], mode)
        return Matrix.LocRotScale(Vector(values["location"]), turn, self.camera.scale)


def keyed_camera(camera: bpy.types.Object) -> KeyedCamera | None:
    """A camera whose keys tell where it is; None: more than these may move it."""
    if camera.parent or camera.constraints or camera.rigid_body or is_animated(camera.data):
        return None
    curves = _curves_of(camera)
    if curves is None or camera.rotation_mode == "AXIS_ANGLE":
        return None
    found = KeyedCamera(camera, curves)
    return found if found.is_told() else None


def _curves_of(camera: bpy.types.Object) -> dict[tuple[str, int], bpy.types.FCurve] | None:
    """All curves by what they move; None: there is more to them."""
    made = camera.animation_data
    if not made or not is_animated(camera):
        return {}
    action, slot = made.action, made.action_slot
    if len(made.drivers) or len(made.nla_tracks) or not action or not slot:
        return None
    if made.action_blend_type != "REPLACE" or made.action_influence != 1 or made.use_tweak_mode:
        return None
    strips = [strip for layer in action.layers for strip in layer.strips]
    if len(strips) != 1 or strips[0].type != "KEYFRAME":
        return None
    bag = strips[0].channelbag(slot)
    curves = list(bag.fcurves) if bag else []
    if any(one.data_path not in SIZES or one.mute or not one.is_valid for one in curves):
        return None
    if any(one.is_empty or (one.group and one.group.mute) for one in curves):
        return None
    found = {(one.data_path, one.array_index): one for one in curves}
    return found if len(found) == len(curves) else None
