"""Convert the world of a scene and take it back: what the operators call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import bpy

from ..core.conversion import Conversion
from ..core.errors import UnusableInput
from ..core.passes import parts_of, samples_of_passes
from ..core.sampling import needs_light_tree
from ..core.settings import ConversionSettings
from ..core.visible import visible_part
from . import eevee, passes
from .known import known_conversion
from .lamps import link_lamps, make_lamps, remove_lamps, unlink_lamps
from .light_groups import put_into_groups, remove_groups
from .rays import Reach
from .scene_needs import ALL, SceneNeeds, needs_of
from .trace import TAG
from .world import (
    WorldLight,
    converted_world,
    find_light,
    is_animated,
    name_images,
    read_image,
    remove_converted,
    unconverted,
)

ALL_LIGHT = 0.999
"""Of all light, in lamps: the rest shows nowhere."""

LEAST_SAID = 0.0005
"""Of all light: less of it that reaches nothing is not worth a sentence."""


@dataclass(frozen=True)
class SceneOptions:
    """What a scene may choose besides what becomes of its map.

    skips: what the scene does not need, as it is now, is left out. two_passes, light_groups: see
    the modules of these names.
    """

    skips: bool = True
    two_passes: bool = False
    light_groups: bool = False


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


def settings_for(chosen: Mapping[str, Any]) -> ConversionSettings:
    """The values of the panel, by the names of `properties.CHOICES`, as the core wants them."""
    options = {field.name for field in fields(SceneOptions)}
    values = {name: value for name, value in chosen.items() if name not in options}
    share = None if values.pop("share_auto") else float(values["share"])
    return ConversionSettings(
        **values
        | {
            "share": share,
            "lights": values["lights"] or None,
            "tolerance": values["tolerance"] or None,
            # The slider can stop at an odd number; the next even one is meant.
            "strata": values["strata"] + values["strata"] % 2,
            "samples": values["samples"] or None,
            "residual_width": values["residual_width"] or None,
            "fill": None if values["fill"] == "auto" else values["fill"],
        }
    )


def options_for(chosen: Mapping[str, Any]) -> SceneOptions:
    """The rest of what `settings_for` takes."""
    return SceneOptions(**{field.name: bool(chosen[field.name]) for field in fields(SceneOptions)})


def convert_scene(
    scene: bpy.types.Scene,
    settings: ConversionSettings,
    options: SceneOptions = SceneOptions(),
) -> SceneConversion:
    """Replace a scene's world and add lamps.

    A converted world is converted again as the user has left it, turned or with another map;
    what Restore brings back stays the world that there was first. A world that the user has
    chosen instead becomes the new original. Raises UnusableInput; then, and whatever else goes
    wrong, the scene is as it was.
    """
    state, world = scene.sunsplit, scene.world
    if world is None:
        raise UnusableInput("The scene has no world: add one with an HDRI first.")
    again = world == state.converted_world and state.original_world is not None
    if world.get(TAG) and not again:
        raise UnusableInput(
            f'The world "{world.name}" is already converted, by another scene or file: '
            "restore it there, or choose the original world."
        )
    if options.two_passes:
        passes.check(scene)
    light = find_light(world, scene.render.engine)
    found = needs_of(scene) if options.skips or options.two_passes else ALL
    needs = found if options.skips else ALL
    environment = read_image(light.image)
    needed = _without_excess(settings, environment.own_width, needs)
    visible = None
    # EEVEE's world shines through everything: there, what is left in it would do harm.
    if needs.sight and needed.chooses_border and scene.render.engine == "CYCLES":
        visible = visible_part(environment, Reach.of(needs.sight).looks(light.map_from_world))
    conversion = known_conversion(environment, needed, visible)
    original = state.original_world if again else world
    tree_off = _is_without_light_tree(scene, conversion, needs)
    camera_width = needs.width_for_camera(environment.own_width)
    sentences = [
        *_sentences(conversion),
        *_skipped(conversion, settings, needs, tree_off),
        *_warnings(scene, world, original, light),
    ]
    for_eevee = settings.in_eevee or "EEVEE" in scene.render.engine
    if for_eevee:
        sentences += eevee.losses(conversion.residual, light.gain)
    new = converted_world(world, light, conversion, needs.camera_sees_world, camera_width)
    lamps = make_lamps(conversion.suns, light, new)
    # From here on `light` must not be used: its nodes go with the world that is replaced.
    restore_scene(scene)
    name_images(new, conversion.environment.name)
    result = _install(scene, original, conversion, new, lamps)
    if tree_off:
        scene.cycles.use_light_tree, state.light_tree_off = False, True
    if for_eevee:
        eevee.apply(scene, lamps)
    if options.two_passes:
        sentences += _add_pass(scene, conversion, found.other_lights)
    if options.light_groups:
        put_into_groups(scene.view_layers, new, lamps)
    state.report = "\n".join([result.headline, *sentences])
    return result


def _without_excess(
    settings: ConversionSettings, width: int, needs: SceneNeeds
) -> ConversionSettings:
    """With a residual so wide that nothing could tell it from one as wide as the map, and none for
    mirrors where there are none."""
    if settings.in_eevee:
        settings = replace(settings, mirrors=needs.mirrors)
    if settings.residual_width is not None:
        return settings
    narrower = needs.residual_width(width)
    return replace(settings, residual_width="own" if narrower == width else narrower)


def _is_without_light_tree(
    scene: bpy.types.Scene, conversion: Conversion, needs: SceneNeeds
) -> bool:
    """Whether Cycles shall draw lots among the lamps, where there is nothing else to choose."""
    if not hasattr(scene, "cycles") or needs.other_lights:
        return False
    if not scene.cycles.use_light_tree and not scene.sunsplit.light_tree_off:
        return False  # as the user has it
    return not needs_light_tree(conversion.suns, conversion.strata.light)


def _add_pass(scene: bpy.types.Scene, conversion: Conversion, other_lights: bool) -> list[str]:
    """Move the lamps into a pass of their own; what was done."""
    if not conversion.suns:
        return ["One pass: without lamps there is nothing to show in a second one."]
    parts = parts_of(conversion, by_strength=scene.cycles.use_light_tree)
    whole = passes.samples_of_scene(scene)
    number = passes.PassSamples(*samples_of_passes(whole, *parts))
    layer = passes.add_suns_layer(scene, scene.sunsplit.collection, number, other_lights)
    lines = [
        f"Two passes: {number.suns} samples for the suns, {number.sky} for the sky.",
        f'The view layer "{layer.name}" has the lamps: choose it to see or change them.',
    ]
    if other_lights:
        lines.append("Other lights shine too, so the suns' pass is a light group, not denoised.")
    return lines


def _skipped(
    conversion: Conversion, settings: ConversionSettings, needs: SceneNeeds, tree_off: bool
) -> list[str]:
    """What was left out, and why."""
    lines = []
    own, width = conversion.environment.own_width, conversion.settings.residual_width
    if conversion.invisible_part > LEAST_SAID:
        lines.append(
            f"Skipped: {conversion.invisible_part:.1%} of the light reaches nothing that the "
            "camera shows: no lamps for it, it stays in the world."
        )
    if conversion.residual is not None and width not in (settings.residual_width, "own"):
        why = "the camera is too coarse for more" if needs.mirrors else "nothing mirrors sharply"
        lines.append(
            f"Skipped: {why}, so the world that lights is {width} pixels wide instead of {own}."
        )
    if not (conversion.settings.mirrors or conversion.account.share < ALL_LIGHT):
        lines.append(
            "Skipped: nothing mirrors sharply, so all light is in lamps, which EEVEE shadows; only "
            "the camera sees the world."
        )
    shown = needs.width_for_camera(own)
    if not needs.camera_sees_world:
        lines.append("Skipped: the camera does not see the world, so renders do not load the HDRI.")
    elif shown != own:
        lines.append(
            f"Skipped: at this resolution the camera shows no more than {shown} pixels around, so "
            f"it gets a map that wide instead of {own}."
        )
    if tree_off:
        lines.append("Skipped: the light tree, as the lamps are cheaper without and alone.")
    return lines


def _install(
    scene: bpy.types.Scene,
    original: bpy.types.World,
    conversion: Conversion,
    world: bpy.types.World,
    lamps: list[bpy.types.Object],
) -> SceneConversion:
    """Give a scene its converted world and lamps; the names are free by now."""
    state = scene.sunsplit
    world.name = f"{original.name} (Sunsplit)"
    state.original_world, state.converted_world = original, world
    scene.world = world
    _swap_overrides(scene, original, world)
    for lamp in lamps:
        state.lamps.add().lamp = lamp
    state.collection = link_lamps(scene, lamps)
    return SceneConversion(conversion, world, state.collection)


def _swap_overrides(
    scene: bpy.types.Scene, old: bpy.types.World, new: bpy.types.World | None
) -> None:
    """View layers that override the world with the same world follow it."""
    for layer in scene.view_layers:
        if layer.world_override == old:
            layer.world_override = new


def _sentences(conversion: Conversion) -> list[str]:
    lines = []
    if conversion.suns:
        lines.append(
            f"By prediction right within {conversion.predicted_error:.2%} under shadows, "
            f"{conversion.ground_error:.2%} on level ground"
        )
    if conversion.residual is not None:
        error = conversion.account.relative_error.max()
        lines.append(f"Account: lamps + world = map within {error:.0e}")
    elif conversion.account.share < 0.999:
        lines.append(f"{1 - conversion.account.share:.1%} of all light is left out.")
    if conversion.environment.repairs.pixels:
        lines.append(f"Repaired pixels: {conversion.environment.repairs}")
    return [*lines, *conversion.notes]


def _warnings(
    scene: bpy.types.Scene,
    world: bpy.types.World,
    original: bpy.types.World,
    light: WorldLight,
) -> list[str]:
    lines = []
    if is_animated(world, light):
        lines.append(
            f"The world is animated: the lamps stay as they are at frame {scene.frame_current}."
        )
    for layer in passes.users_layers(scene):
        if layer.world_override not in (None, world, original):
            lines.append(
                f'View layer "{layer.name}" has a world of its own: '
                "there, the lamps are added to that world's light."
            )
    return lines


def restore_scene(scene: bpy.types.Scene) -> None:
    """Bring back the original world and remove all that the conversion made.

    A world that the user has chosen meanwhile stays. What another scene uses too stays there.
    """
    state = scene.sunsplit
    converted, collection = state.converted_world, state.collection
    original = state.original_world
    lamps = [entry.lamp for entry in state.lamps if entry.lamp]
    if original is None and converted is not None:
        original = unconverted(converted)
    if converted is not None:
        if scene.world == converted:
            scene.world = original
        _swap_overrides(scene, converted, original)
    passes.remove_suns_layer(scene)
    eevee.take_back(scene)
    remove_groups(scene.view_layers)
    state.original_world = state.converted_world = state.collection = None
    state.lamps.clear()
    state.report = ""
    if state.light_tree_off and hasattr(scene, "cycles"):
        scene.cycles.use_light_tree = True
    state.light_tree_off = False
    unlink_lamps(scene, collection, lamps)
    remove_lamps(lamps)
    if converted is not None and converted != original:
        remove_converted(converted)
