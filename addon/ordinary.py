"""Whether a scene is of the ordinary kind that rays tell about: what they meet is what renders
show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from operator import attrgetter

import bpy

from .changes import appears
from .motion import cameras_of
from .passes import users_layers
from .shapes import Shape, are_flattened
from .views import is_ordinary

SOLID = {"MESH", "EMPTY", "LIGHT", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
"""Objects that rays meet, or renders do not show."""

RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
"""What something may be hidden from."""

_is_visible = attrgetter(*(f"visible_{ray}" for ray in RAYS))


def shown_things(
    things: Iterable[bpy.types.Object],
    ever: bool = False,
    known: set[bpy.types.Collection] | None = None,
) -> Iterator[bpy.types.Object]:
    """Things that renders may show, and those in collections that they are instances of: of each
    collection once. ever: in any frame. known: collections that are not asked for any more."""
    known = set() if known is None else known
    for thing in things:
        if not thing.hide_render or (ever and appears(thing)):
            yield thing
            made = thing.instance_collection
            if made and made not in known:
                known.add(made)
                yield from shown_things(made.all_objects, ever, known)


def is_seen_as_rendered(scene: bpy.types.Scene, shown: Iterable[bpy.types.Object]) -> bool:
    """Whether rays through what the viewport shows tell what a render would: with an ordinary
    camera and nothing that looks otherwise in renders."""
    if not all(is_ordinary(camera) for camera in cameras_of(scene)):
        return False
    if scene.render.use_multiview or scene.background_set or len(users_layers(scene)) > 1:
        return False
    if any(made.hide_render for made in scene.collection.children_recursive):
        return False
    return all(
        part.show_render == part.show_viewport for thing in shown for part in thing.modifiers
    )


def is_all_met(
    scene: bpy.types.Scene, shown: Iterable[bpy.types.Object], shapes: Iterable[Shape]
) -> bool:
    """Whether rays meet every surface that renders show. shapes: that they meet."""
    shown, own, shapes = list(shown), set(scene.objects), list(shapes)
    if are_flattened(shapes):
        return False
    makers = [thing for thing in shown if thing.instance_type != "NONE"]
    return all(_is_met(thing, own) for thing in shown) and _are_instances_met(
        [maker for maker in makers if maker in own], makers, shapes
    )


def _is_met(thing: bpy.types.Object, own: set[bpy.types.Object]) -> bool:
    """own: things that are shown by themselves."""
    kind = thing.type
    if kind != "MESH":
        return kind in SOLID and thing.mode != "EDIT"
    return thing.mode != "EDIT" and (thing not in own or thing.visible_get())


def _are_instances_met(
    outermost: list[bpy.types.Object], makers: list[bpy.types.Object], shapes: Iterable[Shape]
) -> bool:
    """Whether all of a collection is met wherever there is an instance of it. outermost: those of
    all makers of instances that are not instances themselves."""
    if not all(_makes_what_is_seen(maker) for maker in makers):
        return False
    met: dict[bpy.types.Object, set[bpy.types.Object]] = {}
    for shape in shapes:
        if len(shape.things) > 1:
            met.setdefault(shape.things[1], set()).add(shape.things[0])
    for made in {maker.instance_collection for maker in makers}:
        if any(part.hide_render for part in (made, *made.children_recursive)):
            return False
    parts = {maker.instance_collection: set() for maker in outermost}
    for made, those in parts.items():
        things = shown_things(made.all_objects)
        those |= {thing for thing in things if thing.type == "MESH" and len(thing.data.polygons)}
    return all(met.get(maker, set()) >= parts[maker.instance_collection] for maker in outermost)


def _makes_what_is_seen(maker: bpy.types.Object) -> bool:
    if maker.instance_type != "COLLECTION" or not maker.instance_collection:
        return False
    return all(_is_visible(maker))
