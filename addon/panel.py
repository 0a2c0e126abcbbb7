"""The tab "Sunsplit" in the sidebar of the 3D view."""

import textwrap

import bpy

CHARACTER = 6.5
"""Width of a character of Blender's interface font in pixels at scale 1, on average and a bit."""


class SUNSPLIT_PT_main(bpy.types.Panel):
    bl_idname = "SUNSPLIT_PT_main"
    bl_label = "Sunsplit"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sunsplit"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.sunsplit
        converted = settings.is_converted
        column = self.layout.column()
        column.scale_y = 1.6
        text = "Convert Again" if converted else "Convert World"
        column.operator("sunsplit.convert", text=text, icon="LIGHT_SUN")
        if converted:
            self.layout.operator("sunsplit.restore", icon="LOOP_BACK")
        if settings.report:
            box = self.layout.box().column(align=True)
            for sentence in settings.report.splitlines():
                for line in textwrap.wrap(sentence, _characters(context)):
                    box.label(text=line)


def _characters(context: bpy.types.Context) -> int:
    """How many fit into a line of the panel: labels do not wrap, they lose their middle."""
    margins = 60
    width = context.region.width / context.preferences.system.ui_scale - margins
    return max(int(width / CHARACTER), 20)


class SUNSPLIT_PT_settings(bpy.types.Panel):
    bl_idname = "SUNSPLIT_PT_settings"
    bl_label = "Settings"
    bl_parent_id = "SUNSPLIT_PT_main"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sunsplit"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.sunsplit
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        draw_settings(layout, settings)


def draw_settings(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """The choices of a scene or of the operator; what has no effect now is left out or grey."""
    sampled = settings.method != "edge"
    layout.prop(settings, "target")
    layout.prop(settings, "method")
    layout.prop(settings, "lights")
    layout.prop(settings, "tolerance")
    layout.prop(settings, "shape")
    layout.prop(settings, "share_auto")
    _row(layout, settings, "share", not settings.share_auto)
    layout.prop(settings, "fill")
    _row(layout, settings, "strata", sampled and settings.per_stratum)
    if sampled:
        layout.prop(settings, "per_stratum")
        layout.prop(settings, "samples")
        layout.prop(settings, "position")
    if sampled or settings.residual == "voronoi":
        layout.prop(settings, "frequency")
    layout.separator()
    rest = settings.share_auto or settings.share < 1
    _row(layout, settings, "residual", rest)
    if settings.residual == "voronoi":
        _row(layout, settings, "residual_samples", rest)
    if settings.residual != "none":
        _row(layout, settings, "residual_width", rest)
    layout.separator()
    for name in ("skips", "two_passes", "light_groups"):
        layout.prop(settings, name)


def _row(
    layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, name: str, active: bool
) -> None:
    row = layout.row()
    row.active = active
    row.prop(settings, name)
