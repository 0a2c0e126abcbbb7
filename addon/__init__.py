"""The Blender side: settings, operators, panel. Everything heavy is imported when it is used."""

import atexit
import sys

import bpy

from . import command, importing, operators, overlay, panel, presets, properties

CLASSES = (
    properties.SunsplitLamp,
    properties.SunsplitBeforePasses,
    properties.SunsplitBeforeEevee,
    properties.SunsplitExport,
    properties.SunsplitSettings,
    operators.SUNSPLIT_OT_convert,
    operators.SUNSPLIT_OT_restore,
    operators.SUNSPLIT_OT_complete_sky,
    operators.SUNSPLIT_OT_reset_factors,
    operators.SUNSPLIT_OT_select_suns,
    operators.SUNSPLIT_OT_export,
    presets.SUNSPLIT_OT_add_preset,
    panel.SUNSPLIT_PT_presets,
    overlay.SUNSPLIT_OT_pick_sun,
    panel.SUNSPLIT_PT_main,
    panel.SUNSPLIT_PT_suns,
    panel.SUNSPLIT_PT_settings,
    panel.SUNSPLIT_PT_advanced,
    panel.SUNSPLIT_PT_export,
    panel.SUNSPLIT_PT_world,
    panel.SUNSPLIT_PT_world_suns,
    panel.SUNSPLIT_PT_world_settings,
    panel.SUNSPLIT_PT_world_advanced,
    panel.SUNSPLIT_PT_world_export,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.sunsplit = bpy.props.PointerProperty(type=properties.SunsplitSettings)
    command.register()
    presets.register()
    overlay.register()
    importing.register()
    # Blender unregisters its add-ons when it ends. As a Python module it does not, and 4.5 then
    # hangs or crashes over any operator or panel that is left.
    if not bpy.app.binary_path:
        atexit.register(unregister)


def unregister() -> None:
    atexit.unregister(unregister)
    if not hasattr(bpy.types.Scene, "sunsplit"):
        return  # Blender disables an extension when it ends, after what `register` has asked for.
    importing.unregister()
    overlay.unregister()
    presets.unregister()
    command.unregister()
    del bpy.types.Scene.sunsplit
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    known = sys.modules.get(f"{__name__}.known")
    if known is not None:  # it was used
        known.forget()
