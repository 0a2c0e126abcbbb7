"""What a scene needs of a conversion: what it does not need is skipped.

Whatever cannot be told is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import bpy
from mathutils import Vector

from .passes import users_layers

SHARP = 0.25
"""Roughness below which a surface may show single pixels of a wide map."""

LIGHTING_WIDTH = 1024
"""Pixels of a map that only lights: without its suns nothing in it is narrower than a third of a
degree, as far as rougher surfaces and shadows can tell."""

RAYS = 48, 27
"""Rays through a camera's picture that look for the world."""

DEFORMING = {
    *("ARMATURE", "BUILD", "CLOTH", "DYNAMIC_PAINT", "EXPLODE", "FLUID", "MESH_CACHE"),
    *("MESH_SEQUENCE_CACHE", "NODES", "OCEAN", "PARTICLE_SYSTEM", "SOFT_BODY", "WAVE"),
}
"""Modifiers that may move a surface without a key on it."""


@dataclass(frozen=True)
class SceneNeeds:
    """camera_sees_world: or a render may show it behind transparent things. mirrors: something
    reflects or refracts sharply. other_lights: something but the world and lamps of conversions
    gives light."""

    camera_sees_world: bool
    mirrors: bool
    other_lights: bool

    def residual_width(self, width: int) -> int | None:
        """Of the map that lights, for a map of this width; None: as wide."""
        if self.mirrors or width <= LIGHTING_WIDTH:
            return None
        narrower = range(LIGHTING_WIDTH, LIGHTING_WIDTH // 2 - 1, -2)
        return next((part for part in narrower if width % part == 0), None)


ALL = SceneNeeds(camera_sees_world=True, mirrors=True, other_lights=True)
"""Nothing is skipped."""


def needs_of(scene: bpy.types.Scene) -> SceneNeeds:
    """Look at a scene: its camera, lamps and materials."""
    shown = list(_shown(scene.objects))
    trees = _trees(scene, shown)
    nodes = [node for tree in trees for node in _nodes(tree)]
    if any(tree.animation_data for tree in trees) or any(node.type == "SCRIPT" for node in nodes):
        return ALL
    own = {entry.lamp for entry in scene.sunsplit.lamps}
    return SceneNeeds(
        camera_sees_world=_sees_world(scene, shown, nodes),
        mirrors=any(_is_sharp(node) for node in nodes),
        other_lights=any(thing.type == "LIGHT" and thing not in own for thing in shown)
        or any(_shines(node) for node in nodes),
    )


def _shown(things: Iterable[bpy.types.Object]) -> Iterator[bpy.types.Object]:
    """Things that renders may show, and those in collections that they are instances of."""
    for thing in things:
        if not thing.hide_render:
            yield thing
            if thing.instance_collection:
                yield from _shown(thing.instance_collection.all_objects)


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


def _nodes(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """All nodes of a tree, those in its groups too."""
    for node in tree.nodes:
        yield node
        if node.type == "GROUP" and node.node_tree:
            yield from _nodes(node.node_tree)


def _is_above(node: bpy.types.Node, name: str, value: float) -> bool:
    socket = node.inputs.get(name)
    return socket is not None and (socket.is_linked or socket.default_value > value)


def _shines(node: bpy.types.Node) -> bool:
    glow = ("Emission Strength", "Blackbody Intensity")
    return node.type == "EMISSION" or any(_is_above(node, name, 0) for name in glow)


def _is_sharp(node: bpy.types.Node) -> bool:
    if node.type == "BSDF_PRINCIPLED":
        coated = _is_above(node, "Coat Weight", 0) and _is_smooth(node, "Coat Roughness")
        return coated or _is_smooth(node, "Roughness")
    shiny = ("BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_GLASS", "BSDF_REFRACTION", "BSDF_METALLIC")
    return node.type in shiny and _is_smooth(node, "Roughness")


def _is_smooth(node: bpy.types.Node, name: str) -> bool:
    socket = node.inputs.get(name)
    return socket is None or socket.is_linked or socket.default_value < SHARP


def _is_seen_through(node: bpy.types.Node) -> bool:
    if node.type == "BSDF_PRINCIPLED":
        alpha = node.inputs["Alpha"]
        return alpha.is_linked or alpha.default_value < 1
    if node.type == "OUTPUT_MATERIAL":  # of a volume without a surface
        return not node.inputs["Surface"].is_linked
    return node.type in ("BSDF_TRANSPARENT", "BSDF_RAY_PORTAL", "HOLDOUT")


def _sees_world(
    scene: bpy.types.Scene, shown: list[bpy.types.Object], nodes: list[bpy.types.Node]
) -> bool:
    """Whether a camera ray may reach the world. Rays through a grid must all be stopped, now: in
    what moves, the world is taken to be seen."""
    if scene.render.film_transparent:
        return False
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        return True
    if any(marker.camera for marker in scene.timeline_markers) or scene.render.use_multiview:
        return True
    if len(users_layers(scene)) > 1 or any(_is_otherwise_in_renders(thing) for thing in shown):
        return True
    if any(made.hide_render for made in scene.collection.children_recursive):
        return True
    if any(_moves(thing) for thing in (camera, camera.data, *shown)):
        return True
    if any(_is_seen_through(node) for node in nodes):
        return True
    graph = bpy.context.evaluated_depsgraph_get()
    if graph.scene != scene:
        return True
    return not all(_is_stopped(scene, graph, camera, ray) for ray in _rays(scene, camera))


def _is_otherwise_in_renders(thing: bpy.types.Object) -> bool:
    """Whether rays through the viewport's scene may meet another shape than a render's."""
    return any(part.show_render != part.show_viewport for part in thing.modifiers)


def _moves(thing: bpy.types.Object | bpy.types.Camera) -> bool:
    made = thing.animation_data
    if made and (made.action or len(made.drivers) or len(made.nla_tracks)):
        return True
    if not isinstance(thing, bpy.types.Object):
        return False
    if any(part.type in DEFORMING for part in thing.modifiers):
        return True
    keys = getattr(thing.data, "shape_keys", None)
    if keys and keys.animation_data:
        return True
    return bool(thing.constraints or thing.rigid_body or (thing.parent and _moves(thing.parent)))


def _rays(scene: bpy.types.Scene, camera: bpy.types.Object) -> Iterator[Vector]:
    """Directions through the picture, its corners too, in the scene's axes."""
    top_right, bottom_right, bottom_left, top_left = camera.data.view_frame(scene=scene)
    turn = camera.matrix_world.to_quaternion()
    for row in range(RAYS[1]):
        left = top_left.lerp(bottom_left, row / (RAYS[1] - 1))
        right = top_right.lerp(bottom_right, row / (RAYS[1] - 1))
        for column in range(RAYS[0]):
            yield turn @ left.lerp(right, column / (RAYS[0] - 1))


def _is_stopped(
    scene: bpy.types.Scene,
    graph: bpy.types.Depsgraph,
    camera: bpy.types.Object,
    direction: Vector,
) -> bool:
    start = camera.matrix_world.translation + direction.normalized() * camera.data.clip_start
    hit, _, _, _, thing, _ = scene.ray_cast(graph, start, direction, distance=camera.data.clip_end)
    return hit and not thing.hide_render and thing.visible_camera
