"""Convert a map for what a scene shows of it: for the light that reaches something, and for the
openings that it comes in through."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy

from ..core.conversion import Conversion
from ..core.environment import EnvironmentMap
from ..core.gloss import Gloss
from ..core.openings import Opening
from ..core.portal_noise import LightInside, openings_pay, told_at_its_best, untold_at_its_best
from ..core.sampling import BY_PORTALS, WorldSampling, choose_sampling
from ..core.settings import ConversionSettings
from ..core.visible import VisiblePart, in_gloss, to_indoors, visible_part
from .glossy import gloss_steps
from .images import READ
from .known import known_conversion
from .light_tree import tree_pays
from .portals import closed_scene, has_portals
from .rays import Reach
from .scene_needs import SceneNeeds
from .steps import Apart, Steps
from .world import WorldLight, is_animated

MADE = 0.9
"""Of the time of a conversion, about, until its maps are written."""

WIDE = 0.18
"""Openings that need no portals, though `core.openings` may still find them. In a missing wall,
which takes .13, they pay where they are predicted to; in a missing roof, which takes .23, they
gained nothing under six maps, but up to twice the noise."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A conversion, and the openings that portals are to stand in for it. by_tree: whether suns,
    and the sky through openings, should be chosen by their strength, else by lot, where there are
    no other lights."""

    conversion: Conversion
    by_tree: bool
    openings: tuple[Opening, ...] = ()

    @property
    def has_cells(self) -> bool:
        """Whether the residual is a Voronoi map."""
        return self.conversion.settings.residual == "voronoi"

    @property
    def sampling(self) -> WorldSampling:
        """How Cycles looks for the residual."""
        if self.openings:
            return BY_PORTALS
        of = self.conversion
        return choose_sampling(of.residual, of.visible_share, self.has_cells, of.visible)


def fitted_conversion(
    scene: bpy.types.Scene,
    environment: EnvironmentMap,
    settings: ConversionSettings,
    needs: SceneNeeds,
    light: WorldLight,
) -> Steps[Fitted]:
    """Convert the map that lights a scene; in a closed one for Cycles with portals or without,
    whichever is predicted to be less noisy."""
    reach = yield from _reach(scene, needs)
    visible = yield from _what_is_visible(reach, environment, settings, light)
    closed = (yield from closed_scene(reach)) if reach else None
    if closed is not None and closed.part >= WIDE:
        closed = None

    def convert(part: VisiblePart | None) -> Apart:
        return Apart(
            lambda listen, _: known_conversion(environment, settings, part, listen), READ, MADE
        )

    if closed is None:
        gloss = yield from _gloss(reach, settings, light)
        conversion = yield convert(in_gloss(visible, gloss))
        return Fitted(conversion, tree_pays(conversion, needs))
    # Where the world is animated, light that comes in now may not, and what does not may.
    moves, to_map = is_animated(light, ()), light.map_from_world
    indoors = None if moves else closed.indoors(environment, visible, to_map)
    through = closed.part if settings.chooses_border else None
    # Where the user has made portals, or no light is left for any, there is nothing to decide.
    by_users = has_portals(scene)
    if by_users or not settings.leaves_residual:
        conversion = yield convert(to_indoors(visible, indoors, through if by_users else None))
        return Fitted(conversion, tree_pays(conversion, needs))
    untold = yield convert(to_indoors(visible, indoors))
    without = Fitted(untold, tree_pays(untold, needs))
    told = yield convert(to_indoors(visible, indoors, through))
    by_portals = Fitted(told, by_tree=True, openings=closed.openings)
    outside = yield from closed.light(untold, to_map)
    inside = yield from closed.light(told, to_map)
    return _calmer(by_portals, inside, without, outside, needs)


def _calmer(
    told: Fitted, inside: LightInside, untold: Fitted, outside: LightInside, needs: SceneNeeds
) -> Fitted:
    """Of a conversion for portals and one without, each with what it gives a closed scene."""
    has_table = untold.sampling.method != "NONE"
    if not needs.other_lights:  # else the tree stays
        inside = told_at_its_best(inside)
        outside = replace(outside, by_tree=untold.by_tree)
        if untold.by_tree:
            outside = untold_at_its_best(outside, has_table)
    if openings_pay(inside, outside, has_table):
        return replace(told, by_tree=inside.by_tree)
    return replace(untold, by_tree=outside.by_tree)


def _reach(scene: bpy.types.Scene, needs: SceneNeeds) -> Steps[Reach | None]:
    """What light can reach; None where rays do not tell. EEVEE's world shines through everything:
    there, what is left in it would do harm."""
    if needs.sight is None or scene.render.engine != "CYCLES":
        return None
    return (yield from Reach.steps(needs.sight))


def _gloss(
    reach: Reach | None, settings: ConversionSettings, light: WorldLight
) -> Steps[Gloss | None]:
    """What the picture shows in rough gloss, where that may tell how many lamps it takes."""
    if reach is None or not settings.cuts_for_gloss or is_animated(light, ()):
        return None
    return (yield from gloss_steps(reach.sight, light.map_from_world))


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
