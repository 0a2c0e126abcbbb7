"""Operators: read the settings, call a plain function, report. A few lines each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ..core.errors import SunsplitError
from .exported import remember
from .modal import InSteps
from .properties import CHOICES, EXPORT_CHOICES
from .skies import lacks_suns
from .steps import Steps

if TYPE_CHECKING:
    from .scene import SceneConversion


class SUNSPLIT_OT_convert(InSteps, bpy.types.Operator):
    """Turn the brightest lights of the world's HDRI into sun lamps and keep the rest as world"""

    bl_idname = "sunsplit.convert"
    bl_label = "Convert World"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    __annotations__ = CHOICES
    home = ".scene"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.world is None:
            cls.poll_message_set("The scene has no world: add one with an HDRI first")
            return False
        return _is_editable(cls, context)

    def work(self, context: bpy.types.Context) -> Steps[SceneConversion]:
        from .options import options_for, settings_for
        from .scene import conversion_steps

        scene, chosen = context.scene, self._chosen(context.scene.sunsplit)
        settings = settings_for(chosen, scene.render.engine)
        return conversion_steps(scene, settings, options_for(chosen))

    def done(self, context: bpy.types.Context, result: SceneConversion) -> set[str]:
        for name, value in self._chosen(context.scene.sunsplit).items():
            setattr(context.scene.sunsplit, name, value)
            setattr(self, name, value)  # Adjust Last Operation shows what was used
        self.report({"INFO"}, result.headline)
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        from .panel import draw_advanced, draw_settings

        self.layout.use_property_split = True
        draw_settings(self.layout, self)
        self.layout.separator()
        draw_advanced(self.layout, self)

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
        return _is_converted(cls, context) and _is_editable(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .restoring import restore_scene

        restore_scene(context.scene)
        return {"FINISHED"}


class SUNSPLIT_OT_complete_sky(bpy.types.Operator):
    """Add the suns that belong to this world, which comes from an asset library"""

    bl_idname = "sunsplit.complete_sky"
    bl_label = "Add Its Suns"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not lacks_suns(context.scene):
            cls.poll_message_set("No suns belong to this world, or they are there already")
            return False
        return _is_editable(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .dropped import complete_sky

        scene = context.scene
        complete_sky(scene, scene.world, scene.sunsplit.original_world)
        return {"FINISHED"}


class SUNSPLIT_OT_reset_factors(bpy.types.Operator):
    """Set strength, warmth and softness of all suns back to what was measured"""

    bl_idname = "sunsplit.reset_factors"
    bl_label = "As Measured"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.sunsplit.sky is None:
            cls.poll_message_set("There are no suns to reset: convert the world first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .controls import reset_factors

        reset_factors(context.scene.sunsplit.sky)
        return {"FINISHED"}


class SUNSPLIT_OT_select_suns(bpy.types.Operator):
    """Select sun lamps by how much light they give or how wide they are"""

    bl_idname = "sunsplit.select_suns"
    bl_label = "Select Suns"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    __annotations__ = {
        "which": EnumProperty(
            name="Which",
            description="By how much light they give, or how wide they are",
            items=[
                ("all", "All", "All suns"),
                ("brightest", "Brightest", "The one that gives most light"),
                ("sharp", "Sharp", "Narrower than the limit: hard shadows"),
                ("soft", "Soft", "As wide as the limit or wider: soft shadows"),
            ],
        ),
        "limit": FloatProperty(
            name="Limit",
            description="Angular diameter between sharp and soft suns",
            subtype="ANGLE",
            default=0.0872664626,  # 5 degrees
            min=0.0,
            max=3.14159265,
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Suns are selected in Object Mode")
            return False
        return _is_converted(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .lamps import select_lamps, suns_that_are

        found = suns_that_are(context.scene.sunsplit, self.which, self.limit)
        select_lamps(context, found)
        self.report({"INFO"}, f"{len(found)} selected")
        return {"FINISHED"} if found else {"CANCELLED"}


class SUNSPLIT_OT_export(bpy.types.Operator):
    """Write suns and world, as they are now, as files of another renderer, with a small scene"""

    bl_idname = "sunsplit.export"
    bl_label = "Export Light"
    bl_options = {"REGISTER"}  # noqa: RUF012 - nothing changes: there is nothing to undo

    __annotations__ = EXPORT_CHOICES | {
        "directory": StringProperty(
            name="Folder",
            description="Where the files are written; nothing: beside the .blend file",
            subtype="DIR_PATH",
            options={"SKIP_SAVE", "HIDDEN"},
        ),
        "filename": StringProperty(
            name="Name",
            description="What the names of the files begin with; nothing: the name of the map",
            subtype="FILE_NAME",
            options={"SKIP_SAVE", "HIDDEN"},
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _is_converted(cls, context)

    _in_browser = False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from .exporting import map_name

        for name, value in self._chosen(context.scene).items():
            setattr(self, name, value)
        self._in_browser = True
        if not self.directory and bpy.data.filepath:
            self.directory = bpy.path.abspath("//")
        self.filename = self.filename or map_name(context.scene)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..core.export.settings import ExportSettings
        from .exporting import export_scene

        scene, chosen = context.scene, self._chosen(context.scene)
        if chosen["format"] == "gltf" and (self._in_browser or not self._is_given("up")):
            del chosen["up"]  # there is no choice, and what it is for other formats stays
        try:
            settings = ExportSettings(**chosen)
            with _waiting(context):
                files = export_scene(scene, self.directory, settings, self.filename)
        except SunsplitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for name, value in chosen.items():
            setattr(scene.sunsplit.export, name, value)
        for sentence in files.losses:
            self.report({"INFO"}, sentence)
        headline = f"{len(files.paths)} files written to {files.lights.parent}"
        self.report({"INFO"}, headline)
        remember(scene, [headline, f"Axes: {files.axes}", *files.losses])
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        from .panel import draw_export, draw_replaced

        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        draw_export(self.layout, self)
        draw_replaced(self.layout, Path(self.directory), self.format, self.filename)

    def check(self, context: bpy.types.Context) -> bool:
        return True  # another name or folder: draw what would be replaced there

    def _chosen(self, scene: bpy.types.Scene) -> dict[str, object]:
        """The scene's settings, and before them what was given as an argument."""
        return {
            name: getattr(self if self._is_given(name) else scene.sunsplit.export, name)
            for name in EXPORT_CHOICES
        }

    def _is_given(self, name: str) -> bool:
        return self.properties.is_property_set(name)


@contextmanager
def _waiting(context: bpy.types.Context) -> Iterator[None]:
    """Shows by the mouse that Blender is busy: with a wide map for some seconds."""
    window = None if bpy.app.background else context.window
    if window:
        window.cursor_modal_set("WAIT")
    try:
        yield
    finally:
        if window:
            window.cursor_modal_restore()


def _is_converted(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    if not context.scene.sunsplit.is_converted:
        operator.poll_message_set("This scene's world is not converted")
        return False
    return True


def _is_editable(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    if context.scene.library is not None:
        operator.poll_message_set(
            "The scene is linked from another file: open that, or make the scene local"
        )
        return False
    return True
