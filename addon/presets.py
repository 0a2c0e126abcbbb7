"""Presets of the settings, by Blender's own preset system: those that ship, and the user's."""

from __future__ import annotations

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase

from .properties import CHOICES

FOLDER = str(Path(__file__).parent)
"""Where `presets/sunsplit` is."""


class SUNSPLIT_OT_add_preset(AddPresetBase, bpy.types.Operator):
    """Keep these settings under a name, or remove that name"""

    bl_idname = "sunsplit.add_preset"
    bl_label = "Add Sunsplit Preset"
    preset_menu = "SUNSPLIT_PT_presets"
    preset_subdir = "sunsplit"
    preset_defines = ["settings = bpy.context.scene.sunsplit"]  # noqa: RUF012
    preset_values = [f"settings.{name}" for name in CHOICES]  # noqa: RUF012


def register() -> None:
    bpy.utils.register_preset_path(FOLDER)


def unregister() -> None:
    bpy.utils.unregister_preset_path(FOLDER)
