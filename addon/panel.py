"""The tab "Sunsplit" in the sidebar of the 3D view, and the same in the World properties.

One button that does the right thing; below it what came of it, in words; then what an artist may
turn, tint and soften. Settings are folded away.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import bpy
from bl_ui.utils import PresetPanel

from ..core.export.names import names_of
from .controls import FACTORS, changed_factors, rotation_control
from .exported import as_name, said_of
from .jobs import Job
from .overlay import draw_switch
from .skies import lacks_suns

CHARACTER = 6.5
"""Width of a character of Blender's interface font in pixels at scale 1, on average and a bit."""

MARGINS = 60
"""Pixels of a region's width, at scale 1, that text in a box cannot use."""


class _InSidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sunsplit"


class _InWorld:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "world"


class _Main:
    bl_label = "Sunsplit"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.sunsplit
        if Job.running:
            _draw_progress(self.layout, Job.running)
            return
        column = self.layout.column()
        column.scale_y = 1.6
        if lacks_suns(context.scene):
            column.operator("sunsplit.complete_sky", icon="LIGHT_SUN")
            return
        text = "Convert Again" if settings.is_converted else "Convert World"
        column.operator("sunsplit.convert", text=text, icon="LIGHT_SUN")
        if settings.is_converted:
            self.layout.operator("sunsplit.restore", icon="LOOP_BACK")
        if settings.report:
            _draw_report(self.layout, settings.report, _characters(context))


class _Suns:
    bl_label = "Suns"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene.sunsplit.sky is not None and not Job.running

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.sunsplit
        sky, layout = settings.sky, self.layout
        layout.use_property_split = True
        _draw_rotation(layout, settings)
        for factor in FACTORS:
            layout.prop(sky, f'["{factor.name}"]', text=factor.label, slider=True)
        _draw_state(layout, sky)
        draw_switch(layout, context)
        if len(settings.lamps) > 1:
            layout.label(text="Select Suns")
            row = layout.row(align=True)
            for which in ("all", "brightest", "sharp", "soft"):
                operator = row.operator("sunsplit.select_suns", text=which.title())
                operator.which = which


class _Settings:
    bl_label = "Settings"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not Job.running

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        SUNSPLIT_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        draw_settings(self.layout, context.scene.sunsplit)


class _Advanced:
    bl_label = "Advanced"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        draw_advanced(self.layout, context.scene.sunsplit)


class _Export:
    bl_label = "Export"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene.sunsplit.is_converted and not Job.running

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        layout.use_property_split = True
        layout.use_property_decorate = False
        draw_export(layout, scene.sunsplit.export)
        layout.operator("sunsplit.export", icon="EXPORT")
        said = said_of(scene)
        if said:
            _draw_report(layout, "\n".join(said), _characters(context), "CHECKMARK")


class SUNSPLIT_PT_presets(PresetPanel, bpy.types.Panel):
    bl_label = "Sunsplit Presets"
    preset_subdir = "sunsplit"
    preset_operator = "script.execute_preset"
    preset_add_operator = "sunsplit.add_preset"


class SUNSPLIT_PT_main(_InSidebar, _Main, bpy.types.Panel):
    pass


class SUNSPLIT_PT_suns(_InSidebar, _Suns, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_main"


class SUNSPLIT_PT_settings(_InSidebar, _Settings, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_main"


class SUNSPLIT_PT_advanced(_InSidebar, _Advanced, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_settings"


class SUNSPLIT_PT_export(_InSidebar, _Export, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_main"


class SUNSPLIT_PT_world(_InWorld, _Main, bpy.types.Panel):
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012


class SUNSPLIT_PT_world_suns(_InWorld, _Suns, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_world"


class SUNSPLIT_PT_world_settings(_InWorld, _Settings, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_world"


class SUNSPLIT_PT_world_advanced(_InWorld, _Advanced, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_world_settings"


class SUNSPLIT_PT_world_export(_InWorld, _Export, bpy.types.Panel):
    bl_parent_id = "SUNSPLIT_PT_world"


def _draw_progress(layout: bpy.types.UILayout, job: Job) -> None:
    layout.progress(factor=job.fraction, text=job.stage.capitalize() or "Sunsplit")
    layout.label(text="Cancel", icon="EVENT_ESC")


def _draw_report(
    layout: bpy.types.UILayout, report: str, characters: int, icon: str = "LIGHT_SUN"
) -> None:
    box = layout.box().column(align=True)
    for number, sentence in enumerate(report.splitlines()):
        for part, line in enumerate(textwrap.wrap(sentence, characters)):
            box.label(text=line, icon=icon if number == part == 0 else "NONE")


def _draw_rotation(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """The input of the world that turns the map, and with it the lamps."""
    control = rotation_control(settings)
    if control is None:
        layout.label(text="The world's nodes turn map and suns", icon="INFO")
        return
    socket, component = control
    layout.prop(socket, "default_value", index=component, text="Rotation")


def _draw_state(layout: bpy.types.UILayout, sky: bpy.types.Object) -> None:
    """Whether the light is the map's or the artist's."""
    changed = changed_factors(sky)
    row = layout.row()
    if changed:
        row.label(text="Artistic: not the map's light any more", icon="BRUSH_DATA")
        row.operator("sunsplit.reset_factors", icon="LOOP_BACK")
    else:
        row.label(text="Exact: the light of the map", icon="CHECKMARK")


def _characters(context: bpy.types.Context) -> int:
    """How many fit into a line of the panel: labels do not wrap, they lose their middle."""
    width = context.region.width / context.preferences.system.ui_scale - MARGINS
    return max(int(width / CHARACTER), 20)


def draw_settings(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """What most users may want to choose."""
    layout.prop(settings, "target")
    # 0 is a number like any other to who has not read the tooltip.
    layout.prop(settings, "lights", text="Lights" if settings.lights else "Lights (auto)")
    automatic = not settings.tolerance and not settings.lights
    layout.prop(settings, "tolerance", text="Tolerance (auto)" if automatic else "Tolerance")
    layout.prop(settings, "skips")


def draw_advanced(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """The other choices; what has no effect with those above it is left out."""
    sampled = settings.method != "edge"
    layout.prop(settings, "method")
    if sampled:
        layout.prop(settings, "samples")
        layout.prop(settings, "position")
        layout.prop(settings, "per_stratum")
        if settings.per_stratum:
            layout.prop(settings, "strata")
    layout.prop(settings, "shape")
    layout.separator()
    layout.prop(settings, "share_auto")
    if not settings.share_auto:
        layout.prop(settings, "share")
    layout.prop(settings, "fill")
    if settings.share_auto or settings.share < 1:
        layout.prop(settings, "residual")
        if settings.residual == "voronoi":
            layout.prop(settings, "residual_samples")
        if settings.residual != "none":
            layout.prop(settings, "residual_width")
    if sampled or settings.residual == "voronoi":
        layout.prop(settings, "frequency")
    layout.separator()
    layout.prop(settings, "two_passes")
    layout.prop(settings, "light_groups")


def draw_export(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """What an export may be told; what has no effect on its format is left out."""
    layout.prop(settings, "format")
    if settings.format == "gltf":
        layout.prop(settings, "lux")
    else:
        layout.prop(settings, "up")
    if settings.format == "usd":  # which has discs
        layout.prop(settings, "reader")
    else:
        layout.prop(settings, "discs")


def draw_replaced(layout: bpy.types.UILayout, folder: Path, kind: str, name: str) -> None:
    """Which files of an export there are already."""
    names = names_of(kind, as_name(name))
    there = [one for one in (names.lights, names.scene, names.map) if (folder / one).is_file()]
    if there:
        column = layout.column(align=True)
        column.label(text="Replaces:", icon="ERROR")
        for one in there:
            column.label(text=one, icon="BLANK1")
