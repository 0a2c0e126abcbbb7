"""What a scene needs of a conversion: what it does not need is skipped.

Whatever cannot be told is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import bpy

from ..core.environment import whole_part_from
from ..core.settings import ResidualWidth
from ..core.suns import Sun
from .moments import Panes, Sight, sight_of
from .ordinary import is_all_met, is_seen_as_rendered, shown_things
from .rig import guards_of, rig_of, twins_of
from .shaders import is_seen_through, is_sharp, is_translucent, nodes_of, shines
from .singular import singular_things
from .steps import Steps, run_at_once
from .unmet import unmet_steps, worn_by
from .views import finest_width, is_ordinary, view_of

MIRRORED_WIDTH = 1024
"""Pixels of a map that something mirrors, at least, however coarse the camera is: a curved mirror
shows more of it in each of a picture's pixels, some of them less."""


MIRRORED_PART = 0.05
"""What that counts as where it cannot be told."""


@dataclass(frozen=True)
class SceneNeeds:
    """camera_sees_world: or a render may show it behind transparent things. mirrors: something
    reflects or refracts sharply, and shows what lights. singular: things that do so exactly, and
    are shown the map itself (see `singular`). mirrored_part: how much of the picture either of them
    is. other_lights: something but the world and lamps of
    conversions gives light. fog: something may scatter light on its way. unmet_width: angular
    diameter, in radians, of the widest suns that rays need not meet (see `unmet`). camera_width:
    pixels around the sphere that a picture can tell apart; None: any. sight: the scene for rays
    that ask what light reaches; None: they would not tell. looked: where anything moves, how many
    frames were looked at, and the first and last of their range."""

    camera_sees_world: bool
    mirrors: bool
    other_lights: bool
    fog: bool = False
    unmet_width: float = 0.0
    singular: tuple[bpy.types.Object, ...] = ()
    mirrored_part: float = 0.0
    camera_width: int | None = None
    sight: Sight | None = field(default=None, compare=False)
    looked: tuple[int, int, int] | None = None

    @property
    def shows_map(self) -> bool:
        """Whether any ray sees the map itself."""
        return self.camera_sees_world or bool(self.singular)

    def shown_width(self, width: int) -> int:
        """Of what rays see of the map itself, for a map of this width."""
        if self.camera_width is None:
            return width
        needed = max(self.camera_width, MIRRORED_WIDTH) if self.singular else self.camera_width
        return whole_part_from(width, needed)

    def twins(self, suns: Iterable[Sun]) -> int:
        """How many of these have a lamp for mirrors alone besides."""
        if not self.singular:
            return 0
        return sum(1 for sun in suns if sun.angular_diameter > self.unmet_width)

    def residual_width(self, width: int) -> ResidualWidth:
        """Of the map that lights, for a map of this width."""
        if not self.mirrors:
            return "lighting"
        if self.camera_width is None:
            return "own"
        narrower = whole_part_from(width, max(self.camera_width, MIRRORED_WIDTH))
        return narrower if narrower < width else "own"


ALL = SceneNeeds(camera_sees_world=True, mirrors=True, other_lights=True)
"""Nothing is skipped."""


def needs_of(scene: bpy.types.Scene) -> SceneNeeds:
    """Look at a scene, all at once: see `needs_steps`."""
    return run_at_once(needs_steps(scene))


def needs_steps(
    scene: bpy.types.Scene, look: bool = True, by_map: bool = False
) -> Steps[SceneNeeds]:
    """Look at a scene: its camera, lamps, materials and shapes; in several frames where they
    move. look: else only what gives or scatters light is told, and all else needed. by_map: mirrors
    may show the map itself."""
    ever = users_things(scene, ever=True)
    shown = users_things(scene) if any(thing.hide_render for thing in ever) else ever
    trees = _trees(scene, ever)
    nodes = [node for tree in trees for node in nodes_of(tree)]
    lights = any(thing.type == "LIGHT" for thing in ever) or any(shines(node) for node in nodes)
    fog = _is_foggy(scene, ever, nodes)
    changes = any(tree.animation_data for tree in trees) or any(map(_is_animated_group, nodes))
    if changes or scene.background_set or any(node.type == "SCRIPT" for node in nodes):
        return replace(ALL, fog=fog)
    if not look:
        return replace(ALL, other_lights=lights, fog=fog)
    sight = None
    if is_seen_as_rendered(scene, shown):
        sight = yield from sight_of(scene, shown, _panes(shown))
    told = sight if sight and _is_told_by_rays(scene, shown, nodes, sight) else None
    needs = SceneNeeds(
        camera_sees_world=(yield from _sees_world(scene, nodes, sight)),
        mirrors=any(is_sharp(node) for node in nodes),
        other_lights=lights,
        fog=fog,
        camera_width=_camera_width(scene, sight),
        sight=told,
        looked=(len(sight.moments), *sight.frames) if sight and sight.frames else None,
    )
    if needs.mirrors:
        needs = replace(needs, mirrored_part=(yield from _mirrored_part(ever, told)))
    if fog:
        return needs
    singular = singular_things(scene, ever) if by_map and needs.mirrors else []
    if singular:  # then all wear what their slots say
        shown = _but(shown, singular)
        nodes = [node for thing in _but(ever, singular) for node in worn_by(thing)]
    return replace(
        needs,
        mirrors=any(is_sharp(node) for node in nodes),
        singular=tuple(singular),
        unmet_width=(yield from unmet_steps(nodes, shown, told, bool(singular))),
    )


def users_things(scene: bpy.types.Scene, ever: bool = False) -> list[bpy.types.Object]:
    """What renders may show and no conversion has made, once each. ever: in any frame."""
    state = scene.sunsplit
    own = {entry.lamp for entry in (*state.lamps, *state.portals)}
    own |= {*rig_of(state.sky), *guards_of(state.sky), *twins_of(state.sky)}
    return list(dict.fromkeys(shown_things((t for t in scene.objects if t not in own), ever)))


def _mirrored_part(shown: Sequence[bpy.types.Object], sight: Sight | None) -> Steps[float]:
    """How much of the picture are things that mirror sharply, or refract."""
    if sight is None:
        return MIRRORED_PART
    sharp = {thing.name for thing in shown if any(map(is_sharp, worn_by(thing)))}
    return (yield from sight.part_of_picture(sharp, alone=True))


def _but(
    things: Iterable[bpy.types.Object], some: Sequence[bpy.types.Object]
) -> list[bpy.types.Object]:
    return [thing for thing in things if thing not in some]


def _is_animated_group(node: bpy.types.Node) -> bool:
    return node.type == "GROUP" and bool(node.node_tree and node.node_tree.animation_data)


def _is_foggy(
    scene: bpy.types.Scene, shown: Iterable[bpy.types.Object], nodes: Iterable[bpy.types.Node]
) -> bool:
    if any(thing.type == "VOLUME" for thing in shown):
        return True
    tree = scene.world and scene.world.node_tree
    outputs = [*nodes, *(nodes_of(tree) if tree else ())]
    kinds = ("OUTPUT_MATERIAL", "OUTPUT_WORLD")
    return any(n.type in kinds and n.inputs["Volume"].is_linked for n in outputs)


def _camera_width(scene: bpy.types.Scene, sight: Sight | None) -> int | None:
    if sight:
        return finest_width(scene, sight.views)
    camera = scene.camera
    if not is_ordinary(camera) or scene.render.use_multiview:
        return None
    if any(marker.camera for marker in scene.timeline_markers):
        return None
    if scene.animation_data or camera.data.animation_data:
        return None
    return finest_width(scene, [view_of(scene, camera)])


def _is_told_by_rays(
    scene: bpy.types.Scene,
    shown: list[bpy.types.Object],
    nodes: list[bpy.types.Node],
    sight: Sight,
) -> bool:
    """Whether rays meet all that light would meet: no fog, and nothing that only renders show."""
    if any(layer.material_override for layer in scene.view_layers):
        return False
    foggy = any(n.type == "OUTPUT_MATERIAL" and n.inputs["Volume"].is_linked for n in nodes)
    return not foggy and is_all_met(scene, shown, sight.shapes)


def _panes(shown: Iterable[bpy.types.Object]) -> Panes:
    shown = list(shown)
    worn = {slot.material for thing in shown for slot in thing.material_slots if slot.material}
    through = {made for made in worn if _has(made, is_translucent)}
    straight = {made for made in worn if _has(made, is_seen_through)}
    panes = [thing for thing in shown if _lets_light_through(thing, through)]
    shadowless = [thing for thing in panes if _is_shadowless(thing, straight)]
    return Panes(*(frozenset(thing.name for thing in some) for some in (panes, shadowless)))


def _lets_light_through(thing: bpy.types.Object, through: set[bpy.types.Material]) -> bool:
    """through: materials that do."""
    if thing.type == "MESH" and not (thing.visible_shadow and thing.visible_diffuse):
        return True
    return bool(through) and _wears(thing, through)


def _is_shadowless(thing: bpy.types.Object, straight: set[bpy.types.Material]) -> bool:
    """Whether light passes a thing that lets it through without being bent. straight: materials
    that it passes so."""
    if thing.type == "MESH" and not thing.visible_shadow:
        return True
    return bool(straight) and _wears(thing, straight)


def _wears(thing: bpy.types.Object, materials: set[bpy.types.Material]) -> bool:
    return any(slot.material in materials for slot in thing.material_slots)


def _has(material: bpy.types.Material, kind: Callable[[bpy.types.Node], bool]) -> bool:
    return material.node_tree is not None and any(map(kind, nodes_of(material.node_tree)))


def _trees(scene: bpy.types.Scene, shown: list[bpy.types.Object]) -> list[bpy.types.NodeTree]:
    """Of the materials that things may wear, those of instances and overrides too."""
    overrides = [layer.material_override for layer in scene.view_layers]
    found = {made.node_tree: None for made in overrides if made and made.node_tree}
    found |= {
        slot.material.node_tree: None
        for thing in shown
        for slot in thing.material_slots
        if slot.material and slot.material.node_tree
    }
    if any(thing.instance_type != "NONE" or thing.modifiers for thing in shown):
        # What is instanced or made by geometry nodes may wear any material of the file.
        found |= {made.node_tree: None for made in bpy.data.materials if made.node_tree}
    return list(found)


def _sees_world(
    scene: bpy.types.Scene, nodes: list[bpy.types.Node], sight: Sight | None
) -> Steps[bool]:
    """Whether a camera ray may reach the world."""
    if scene.render.film_transparent:
        return False
    if sight is None or any(is_seen_through(node) for node in nodes):
        return True
    return (yield from sight.camera_sees_world())
