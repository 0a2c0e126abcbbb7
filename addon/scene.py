"""Convert the world of a scene: what the operators call."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ..core.conversion import Conversion
from ..core.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from ..core.errors import UnusableInput
from ..core.openings import Opening
from ..core.outlines import outlines_of
from ..core.passes import parts_of, samples_of_passes
from ..core.portal_noise import openings_pay
from ..core.progress import Progress, silent
from ..core.sampling import BY_PORTALS, WorldSampling, choose_sampling
from ..core.settings import ConversionSettings
from ..core.visible import VisiblePart, through_openings, visible_part
from . import eevee, passes
from .controls import keep_factors
from .driven import followed
from .images import (
    READ,
    Radiance,
    folder_for_maps,
    packed_image,
    read_image,
    remove_images,
    write_map,
)
from .known import known_conversion
from .lamps import collection_of, make_lamps, name_lamps
from .light_groups import put_into_groups
from .light_tree import make_guards, tree_plan
from .options import SceneOptions
from .portals import ClosedScene, closed_scene, has_portals, make_portals
from .rays import Reach
from .report import headline, made_sentences, portal_sentences, skipped_sentences
from .restoring import restore_scene, swap_overrides
from .rig import Rig, make_rig, rig_of
from .scene_needs import ALL, SceneNeeds, needs_steps
from .steps import Apart, Steps, run_at_once
from .trace import TAG
from .world import (
    WorldLight,
    converted_world,
    find_light,
    is_animated,
    name_images,
)

MADE = 0.9
"""Of the time of a conversion, about, until its maps are written."""


@dataclass(frozen=True, eq=False)
class _Made:
    """What a scene is to get. images: of the maps that its world shows, by what they are."""

    conversion: Conversion
    images: Mapping[str, bpy.types.Image]
    openings: tuple[Opening, ...]


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
    found = yield from needs_steps(scene)
    needs = found if options.skips else ALL
    environment = yield from read_image(light.image)
    needed = _without_excess(settings, environment.own_width, needs)
    reach = yield from _reach(scene, needs)
    visible = yield from _what_is_visible(reach, environment, needed, light)
    conversion, openings = yield from _converted(
        lambda part: Apart(
            lambda listen, _: known_conversion(environment, needed, part, listen), READ, MADE
        ),
        visible,
        (yield from _closed(scene, reach, needed)),
        light,
    )
    with folder_for_maps() as folder:
        paths = yield Apart(lambda *_: _write_maps(folder, conversion, needs), MADE, 1)
        outlines = yield Apart(lambda *_: outlines_of(conversion).to_text(), 1, 1)
        images = {path.stem: packed_image(path) for path in paths}
    made = _Made(conversion, images, openings)
    result = _replace(scene, light, made, settings, options, found)
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


def _is_converted(scene: bpy.types.Scene) -> bool:
    """Whether the scene shows what its conversion has made."""
    state = scene.sunsplit
    return scene.world == state.converted_world and state.original_world is not None


def _reach(scene: bpy.types.Scene, needs: SceneNeeds) -> Steps[Reach | None]:
    """What light can reach; None where rays do not tell. EEVEE's world shines through everything:
    there, what is left in it would do harm."""
    if needs.sight is None or scene.render.engine != "CYCLES":
        return None
    return (yield from Reach.steps(needs.sight))


def _what_is_visible(
    reach: Reach | None,
    environment: EnvironmentMap,
    settings: ConversionSettings,
    light: WorldLight,
) -> Steps[VisiblePart | None]:
    # Where the world is animated, what is hidden now may come round.
    if reach is None or not settings.chooses_border or is_animated(light, ()):
        return None
    to_map = light.map_from_world
    return (
        yield Apart(
            lambda _, in_main: visible_part(environment, reach.looks(to_map, in_main)), READ, READ
        )
    )


def _closed(
    scene: bpy.types.Scene, reach: Reach | None, settings: ConversionSettings
) -> Steps[ClosedScene | None]:
    """The scene's openings where portals may help; None where the user has made some."""
    if reach is None or not settings.leaves_residual or has_portals(scene):
        return None
    return (yield from closed_scene(reach))


def _converted(
    convert: Callable[[VisiblePart | None], Apart],
    visible: VisiblePart | None,
    closed: ClosedScene | None,
    light: WorldLight,
) -> Steps[tuple[Conversion, tuple[Opening, ...]]]:
    """A conversion, and the openings that it is made for: that for Cycles with portals in them or
    without, which ever is predicted to be less noisy."""
    if closed is None:
        return (yield convert(visible)), ()
    to_map = light.map_from_world
    told = yield convert(through_openings(visible, closed.part))
    light_told = yield from closed.light(told, to_map)
    untold = yield convert(visible)
    light_untold = yield from closed.light(untold, to_map)
    if openings_pay(light_told, light_untold, _sampling(untold).method != "NONE"):
        return told, closed.openings
    return untold, ()


def _sampling(conversion: Conversion) -> WorldSampling:
    has_cells = conversion.settings.residual == "voronoi"
    return choose_sampling(
        conversion.residual, conversion.visible_share, has_cells, conversion.visible
    )


def _write_maps(folder: Path, conversion: Conversion, needs: SceneNeeds) -> list[Path]:
    """Files of what the converted world shows instead of the map, named by what it is."""
    maps: dict[str, Radiance] = {}
    residual = conversion.levelled or conversion.residual
    if residual is not None:
        maps["residual"] = residual
    environment = conversion.environment
    width = needs.width_for_camera(environment.own_width)
    if needs.camera_sees_world and width != environment.own_width:
        maps["camera"] = environment.narrowed(width)
    return [write_map(folder, *made) for made in maps.items()]


def _replace(
    scene: bpy.types.Scene,
    light: WorldLight,
    made: _Made,
    settings: ConversionSettings,
    options: SceneOptions,
    found: SceneNeeds,
) -> SceneConversion:
    """The last step: the new world and lamps are made first, so that nothing is lost if that
    fails; then they take the place of what was there."""
    state, world = scene.sunsplit, scene.world
    needs = found if options.skips else ALL
    original = state.original_world if _is_converted(scene) else world
    conversion, openings = made.conversion, made.openings
    tree = tree_plan(scene, conversion, needs, found, bool(openings))
    has_cells = conversion.settings.residual == "voronoi"
    sampling = BY_PORTALS if openings else _sampling(conversion)
    sees_it = needs.camera_sees_world
    try:
        new = converted_world(world, light, made.images, sampling, has_cells, sees_it)
    finally:
        remove_images(made.images)
    light = find_light(new, scene.render.engine)  # the same, in the new world
    rig = make_rig(light.texture)
    keep_factors(state.sky, rig.sky)
    lamps = make_lamps(conversion.suns, light, rig, new)
    guards = make_guards(rig, lamps) if tree.guarded else []
    sentences = [
        *made_sentences(conversion),
        *skipped_sentences(conversion, settings, needs, tree.is_idle),
        *portal_sentences(len(openings)),
        *tree.warnings,
        *_warnings(scene, (world, original), light, [*rig_of(rig.sky), *lamps]),
    ]
    for_eevee = settings.in_eevee or "EEVEE" in scene.render.engine
    if for_eevee:
        sentences += eevee.losses(conversion.residual, light.gain)
    restore_scene(scene)
    name_images(new, conversion.environment.name)
    result = _install(scene, original, conversion, new, rig, lamps, guards)
    state.portals = make_portals(scene, openings)
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
    mirrors where there are none."""
    if settings.in_eevee:
        settings = replace(settings, mirrors=needs.mirrors)
    if settings.residual_width is not None:
        return settings
    narrower = needs.residual_width(width)
    return replace(settings, residual_width="own" if narrower == width else narrower)


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
    guards: list[bpy.types.Object],
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
    state.sky, state.collection = rig.sky, collection_of(rig, [*lamps, *guards])
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
