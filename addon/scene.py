"""Convert the world of a scene: what the operators call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ..core.conversion import Conversion
from ..core.environment import LUMINANCE_WEIGHTS
from ..core.errors import UnusableInput
from ..core.outlines import outlines_of
from ..core.passes import parts_of, samples_of_passes
from ..core.progress import Progress, silent
from ..core.settings import ConversionSettings
from . import eevee, passes
from .controls import keep_factors
from .driven import followed
from .fitted import MADE, Fitted, fitted_conversion
from .images import (
    Radiance,
    folder_for_maps,
    packed_image,
    read_image,
    remove_images,
    write_map,
)
from .lamps import collection_of, make_lamps, name_lamps
from .light_groups import put_into_groups
from .light_tree import make_guards, tree_plan
from .options import SceneOptions
from .portals import make_portals
from .report import (
    headline,
    made_sentences,
    mirror_sentences,
    portal_sentences,
    skipped_sentences,
)
from .restoring import restore_scene, swap_overrides
from .rig import Rig, make_rig, rig_of
from .scene_needs import ALL, SceneNeeds, needs_steps
from .singular import make_twins
from .steps import Apart, Steps, run_at_once
from .trace import TAG
from .world import (
    Shown,
    WorldLight,
    converted_world,
    find_light,
    is_animated,
    name_images,
)


@dataclass(frozen=True, eq=False)
class SceneConversion:
    """A conversion, the world and the lamps that it has become."""

    conversion: Conversion
    world: bpy.types.World
    collection: bpy.types.Collection

    @property
    def headline(self) -> str:
        return headline(len(self.conversion.suns), self.conversion.account.share)


def convert_scene(
    scene: bpy.types.Scene,
    settings: ConversionSettings,
    options: SceneOptions | None = None,
    progress: Progress = silent,
) -> SceneConversion:
    """Replace a scene's world and add lamps, all at once: see `conversion_steps`."""
    return run_at_once(conversion_steps(scene, settings, options or SceneOptions()), progress)


def conversion_steps(
    scene: bpy.types.Scene, settings: ConversionSettings, options: SceneOptions
) -> Steps[SceneConversion]:
    """Replace a scene's world and add lamps.

    A converted world is converted again as the user has left it, turned or with another map;
    what Restore brings back stays the world that there was first. A world that the user has
    chosen instead becomes the new original. Raises UnusableInput; then, and whatever else goes
    wrong, and before the last step, the scene is as it was.
    """
    world = _world_to_convert(scene)
    if options.two_passes:
        passes.check(scene)
    light = find_light(world, scene.render.engine)
    by_map = _may_mirror_the_map(scene, settings, options)
    found = yield from needs_steps(scene, look=options.skips, by_map=by_map)
    needs = found if options.skips else ALL
    environment = yield from read_image(light.image)
    needed = _without_excess(settings, environment.own_width, needs)
    fitted = yield from fitted_conversion(scene, environment, needed, needs, light)
    conversion = fitted.conversion
    with folder_for_maps() as folder:
        paths = yield Apart(lambda *_: _write_maps(folder, conversion, needs), MADE, 1)
        outlines = yield Apart(lambda *_: outlines_of(conversion).to_text(), 1, 1)
        images = {path.stem: packed_image(path) for path in paths}
    result = _replace(scene, light, fitted, images, settings, options, found)
    scene.sunsplit.outlines = outlines
    return result


def _world_to_convert(scene: bpy.types.Scene) -> bpy.types.World:
    world = scene.world
    if world is None:
        raise UnusableInput("The scene has no world: add one with an HDRI first.")
    if world.get(TAG) and not _is_converted(scene):
        raise UnusableInput(
            f'The world "{world.name}" is already converted, by another scene or file: '
            "restore it there, or choose the original world."
        )
    return world


def _may_mirror_the_map(
    scene: bpy.types.Scene, settings: ConversionSettings, options: SceneOptions
) -> bool:
    """Whether mirrors may show the map itself: in Cycles, and where suns are not to be had apart
    from the sky, in mirrors too."""
    if scene.render.engine != "CYCLES" or settings.in_eevee:
        return False
    return not (options.two_passes or options.light_groups)


def _is_converted(scene: bpy.types.Scene) -> bool:
    """Whether the scene shows what its conversion has made."""
    state = scene.sunsplit
    return scene.world == state.converted_world and state.original_world is not None


def _write_maps(folder: Path, conversion: Conversion, needs: SceneNeeds) -> list[Path]:
    """Files of what the converted world shows instead of the map, named by what it is."""
    maps: dict[str, Radiance] = {}
    residual = conversion.levelled or conversion.residual
    if residual is not None:
        maps["residual"] = residual
    environment = conversion.environment
    width = needs.shown_width(environment.own_width)
    if needs.shows_map and width != environment.own_width:
        maps["map"] = environment.narrowed(width)
    return [write_map(folder, *made) for made in maps.items()]


def _replace(
    scene: bpy.types.Scene,
    light: WorldLight,
    fitted: Fitted,
    images: Mapping[str, bpy.types.Image],
    settings: ConversionSettings,
    options: SceneOptions,
    found: SceneNeeds,
) -> SceneConversion:
    """The last step: the new world and lamps are made first, so that nothing is lost if that
    fails; then they take the place of what was there."""
    state, world = scene.sunsplit, scene.world
    needs = found if options.skips else ALL
    original = state.original_world if _is_converted(scene) else world
    conversion, openings = fitted.conversion, fitted.openings
    tree = tree_plan(scene, conversion, needs, found, fitted.by_tree)
    shown = Shown(needs.camera_sees_world, bool(needs.singular))
    try:
        new = converted_world(world, light, images, fitted.sampling, fitted.has_cells, shown)
    finally:
        remove_images(images)
    light = find_light(new, scene.render.engine)  # the same, in the new world
    rig = make_rig(light.texture)
    keep_factors(state.sky, rig.sky)
    lamps = make_lamps(conversion.suns, light, rig, new, needs.unmet_width)
    twins = make_twins(rig, lamps, needs.singular)
    guards = make_guards(rig, lamps) if tree.guarded else []
    sentences = [
        *made_sentences(conversion),
        *skipped_sentences(conversion, settings, needs, tree.is_idle),
        *mirror_sentences(needs, len(twins)),
        *portal_sentences(len(openings)),
        *tree.warnings,
        *_warnings(scene, (world, original), light, [*rig_of(rig.sky), *lamps]),
    ]
    for_eevee = settings.in_eevee or "EEVEE" in scene.render.engine
    if for_eevee:
        sentences += eevee.losses(conversion.residual, light.gain)
    restore_scene(scene)
    name_images(new, conversion.environment.name)
    result = _install(scene, original, conversion, new, rig, lamps, [*twins, *guards])
    make_portals(scene, openings)
    if tree.off:
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
    mirrors where there are none. A Voronoi map is made of as many pixels as samples are drawn
    from."""
    if settings.in_eevee:
        settings = replace(settings, mirrors=needs.mirrors)
    if settings.residual_width is not None:
        return settings
    enough = needs.residual_width(width)
    if enough == "lighting" and settings.residual == "voronoi":
        return settings
    return replace(settings, residual_width=enough)


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


def _install(
    scene: bpy.types.Scene,
    original: bpy.types.World,
    conversion: Conversion,
    world: bpy.types.World,
    rig: Rig,
    lamps: list[bpy.types.Object],
    helpers: list[bpy.types.Object],
) -> SceneConversion:
    """Give a scene its converted world and lamps; the names are free by now."""
    state = scene.sunsplit
    world.name = f"{original.name} (Sunsplit)"
    state.original_world, state.converted_world = original, world
    scene.world = world
    swap_overrides(scene, original, world)
    for lamp in lamps:
        state.lamps.add().lamp = lamp
    name_lamps(conversion.suns, lamps, rig, conversion.account.source @ LUMINANCE_WEIGHTS)
    state.sky, state.collection = rig.sky, collection_of(rig, [*lamps, *helpers])
    scene.collection.children.link(state.collection)
    return SceneConversion(conversion, world, state.collection)


def _warnings(
    scene: bpy.types.Scene,
    worlds: tuple[bpy.types.World, ...],
    light: WorldLight,
    made: list[bpy.types.Object],
) -> list[str]:
    """What lamps and rig, `made`, cannot follow. worlds: that are replaced."""
    lines = []
    if is_animated(light, followed(made)):
        lines.append(
            "The world is animated by more than a rotation and a strength: in all else the lamps "
            f"stay as they are at frame {scene.frame_current}."
        )
    for layer in passes.users_layers(scene):
        if layer.world_override not in (None, *worlds):
            lines.append(
                f'View layer "{layer.name}" has a world of its own: '
                "there, the lamps are added to that world's light."
            )
    return lines
