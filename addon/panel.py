"""The tab "Sunsplit" in the sidebar of the 3D view."""

import bpy


class SUNSPLIT_PT_main(bpy.types.Panel):
    bl_idname = "SUNSPLIT_PT_main"
    bl_label = "Sunsplit"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sunsplit"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.sunsplit
        converted = settings.original_world is not None
        column = self.layout.column()
        column.scale_y = 1.6
        text = "Convert Again" if converted else "Convert World"
        column.operator("sunsplit.convert", text=text, icon="LIGHT_SUN")
        if converted:
            self.layout.operator("sunsplit.restore", icon="LOOP_BACK")
        if settings.report:
            box = self.layout.box().column(align=True)
            for line in settings.report.splitlines():
                box.label(text=line)


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
        layout.prop(settings, "lights")
        layout.prop(settings, "share_auto")
        row = layout.row()
        row.active = not settings.share_auto
        row.prop(settings, "share")
        layout.prop(settings, "strata")
        layout.prop(settings, "residual")
