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
        from .scene import convert_scene, options_for, settings_for

        chosen = self._chosen(context.scene.sunsplit)
        try:
            result = convert_scene(context.scene, settings_for(chosen), options_for(chosen))
        except SunsplitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for name, value in chosen.items():
            setattr(context.scene.sunsplit, name, value)
            setattr(self, name, value)  # Adjust Last Operation shows what was used
        self.report({"INFO"}, result.headline)
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        from .panel import draw_settings

        self.layout.use_property_split = True
        draw_settings(self.layout, self)

    def _chosen(self, scene_settings: bpy.types.PropertyGroup) -> dict[str, object]:
        """The scene's settings, and before them what was given as an argument."""
        given = {name for name in CHOICES if self.properties.is_property_set(name)}
        chosen = {
            name: getattr(self if name in given else scene_settings, name) for name in CHOICES
        }
        if "share" in given and "share_auto" not in given:
            chosen["share_auto"] = False
        return chosen


class SUNSPLIT_OT_restore(bpy.types.Operator):
    """Bring back the world as it was before the conversion and remove the lamps"""

    bl_idname = "sunsplit.restore"
    bl_label = "Restore World"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.sunsplit.is_converted:
            cls.poll_message_set("This scene's world is not converted")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .scene import restore_scene

        restore_scene(context.scene)
        return {"FINISHED"}
