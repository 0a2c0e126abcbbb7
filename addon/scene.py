"""Convert the world of a scene and take it back: what the operators call."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..core.conversion import Conversion, convert
from ..core.errors import UnusableInput
from ..core.settings import ConversionSettings
from .lamps import add_lamps, remove_lamps
from .world import converted_world, find_light, read_image, remove_converted


@dataclass(frozen=True, eq=False)
class SceneConversion:
    """A conversion, the world and the lamps that it has become."""

    conversion: Conversion
    world: bpy.types.World
    collection: bpy.types.Collection

    @property
    def headline(self) -> str:
        count = len(self.conversion.suns)
        noun = "lamp" if count == 1 else "lamps"
        return f"{count} {noun} with {self.conversion.account.share:.1%} of all light"


def chosen_settings(scene: bpy.types.Scene) -> ConversionSettings:
    """The settings of `scene.sunsplit` as the core wants them."""
    chosen = scene.sunsplit
    share = None if chosen.share_auto else float(chosen.share)
    return ConversionSettings(
        lights=chosen.lights,
        share=share,
        # The slider can stop at an odd number; the next even one is meant.
        strata=chosen.strata + chosen.strata % 2,
        residual="none" if share == 1 else chosen.residual,
    )


def convert_scene(scene: bpy.types.Scene) -> SceneConversion:
    """Replace a scene's world and add lamps; a scene already converted starts from its original.

    Raises UnusableInput and leaves the scene as it was.
    """
    state = scene.sunsplit
    original = state.original_world or scene.world
    if original is None:
        raise UnusableInput("The scene has no world: add one with an HDRI first.")
    light = find_light(original)
    conversion = convert(read_image(light.image), chosen_settings(scene))
    # Nothing of the scene has been touched up to here: whatever was wrong has been said.
    restore_scene(scene)
    state.original_world = original
    scene.world = converted_world(original, light, conversion.residual)
    state.converted_world = scene.world
    state.collection = add_lamps(scene, conversion.suns, light)
    result = SceneConversion(conversion, scene.world, state.collection)
    state.report = "\n".join([result.headline, *_sentences(conversion)])
    return result


def _sentences(conversion: Conversion) -> list[str]:
    lines = []
    if conversion.residual is not None:
        error = conversion.account.relative_error.max()
        lines.append(f"Account: lamps + world = map within {error:.0e}")
    if conversion.environment.repairs.pixels:
        lines.append(f"Repaired pixels: {conversion.environment.repairs}")
    return [*lines, *conversion.notes]


def restore_scene(scene: bpy.types.Scene) -> None:
    """Bring back the original world and remove all that the conversion made."""
    state = scene.sunsplit
    if state.original_world is None:
        return
    # A world that the user has chosen meanwhile is the user's: it stays.
    if scene.world == state.converted_world or scene.world is None:
        scene.world = state.original_world
    remove_lamps(scene, state.collection)
    if state.converted_world is not None:
        remove_converted(state.converted_world)
    state.original_world = state.converted_world = state.collection = None
    state.report = ""
