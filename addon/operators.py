"""Operators: read the settings, call a plain function, report. A few lines each."""

import bpy

from ..core.errors import SunsplitError
from .properties import CHOICES


class SUNSPLIT_OT_convert(bpy.types.Operator):
    """Turn the brightest lights of the world's HDRI into sun lamps and keep the rest as world"""

    bl_idname = "sunsplit.convert"
    bl_label = "Convert World"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    __annotations__ = CHOICES

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.world is None:
            cls.poll_message_set("The scene has no world: add one with an HDRI first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .scene import convert_scene

        settings = context.scene.sunsplit
        for name in CHOICES:
            if self.properties.is_property_set(name):
                setattr(settings, name, getattr(self, name))
        try:
            result = convert_scene(context.scene)
        except SunsplitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for name in CHOICES:  # Adjust Last Operation shows what was used
            setattr(self, name, getattr(settings, name))
        self.report({"INFO"}, result.headline)
        return {"FINISHED"}


class SUNSPLIT_OT_restore(bpy.types.Operator):
    """Bring back the world as it was before the conversion and remove the lamps"""

    bl_idname = "sunsplit.restore"
    bl_label = "Restore World"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.sunsplit.original_world is None:
            cls.poll_message_set("This scene's world is not converted")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .scene import restore_scene

        restore_scene(context.scene)
        return {"FINISHED"}
