"""What of single objects is otherwise in other frames: where they are, and which shape they have.

Both may follow from another object's place or shape. Such ties are followed all at once, as they
may lead in circles: a mirror often hangs on what it mirrors.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator

import bpy

DEFORMING = {
    *("ARMATURE", "BUILD", "CLOTH", "DYNAMIC_PAINT", "EXPLODE", "FLUID", "MESH_CACHE"),
    *("MESH_SEQUENCE_CACHE", "OCEAN", "PARTICLE_SYSTEM", "SOFT_BODY", "WAVE"),
}
"""Modifiers that may move a surface without a key on it."""

NODES_THAT_STAND_STILL = re.compile(
    r"(ShaderNode|FunctionNode|NodeReroute$|NodeFrame$|NodeGroup(Input|Output)$|GeometryNode"
    r"(?!ApplySimulated|Bake|BoneInfo|CameraInfo|Collection|CustomGroup|DeformCurves|Image|Import"
    r"|InputActiveCamera|InputCollection|InputImage|InputObject|InputSceneTime|IsViewport"
    r"|ObjectInfo|ReplaceMaterial|SampleSound|SelfObject|SetMaterial$|Simulation|Tool"
    r"|ViewportTransform|XPBD))"
)
"""Nodes of geometry that make the same in all frames, in a viewport as in renders, of nothing but
their inputs; none gives a material that the object does not have."""

SHAPELESS = {"ARMATURE", "CAMERA", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
"""Objects that have no surface; how some of them look makes others look otherwise."""

PLACE, SHAPE = "place", "shape"
"""What of an object may change."""

Fact = tuple[bpy.types.Object, str]


def changes_of(things: Iterable[bpy.types.Object]) -> set[Fact]:
    """What of some things, and of all that they follow, may be otherwise in another frame."""
    plain_data: dict[bpy.types.ID | None, bool] = {}
    waiting = [
        (thing, what)
        for thing in things
        if not _is_plain(thing, plain_data)
        for what in (PLACE, SHAPE)
    ]
    known: set[Fact] = set()
    followers: dict[Fact, list[Fact]] = defaultdict(list)
    while waiting:
        fact = waiting.pop()
        if fact in known:
            continue
        known.add(fact)
        for leader in _leaders(*fact):
            followers[leader].append(fact)
            waiting.append(leader)
    changed: set[Fact] = set()
    waiting = [fact for fact in known if _changes_itself(*fact)]
    while waiting:
        fact = waiting.pop()
        if fact not in changed:
            changed.add(fact)
            waiting += followers[fact]
    return changed


def _is_plain(thing: bpy.types.Object, plain_data: dict[bpy.types.ID | None, bool]) -> bool:
    """Whether nothing of it can change, nor follow what does: most of a scene is so, and soon told.
    plain_data: what is known of things' data, which many may share."""
    if thing.parent or thing.animation_data or thing.rigid_body or thing.pose:
        return False
    if len(thing.modifiers) or len(thing.constraints) or len(thing.particle_systems):
        return False
    data = thing.data
    if data not in plain_data:
        keys = getattr(data, "shape_keys", None)
        plain_data[data] = not (getattr(data, "animation_data", None) or keys)
    return plain_data[data]


def is_animated(owner: bpy.types.ID | None) -> bool:
    """Whether it has keys, strips or drivers."""
    made = getattr(owner, "animation_data", None)
    return bool(made and (made.action or len(made.drivers) or len(made.nla_tracks)))


def appears(thing: bpy.types.Object) -> bool:
    """Whether it is hidden in some frames and shown in others, or may be."""
    if not thing.animation_data:  # most have none
        return False
    return any(path.startswith("hide") for path in animated_paths(thing))


def animated_paths(owner: bpy.types.ID | None) -> Iterator[str]:
    """All properties of something that its keys, drivers and strips change."""
    made = getattr(owner, "animation_data", None)
    if not made:
        return
    yield from (curve.data_path for curve in made.drivers)
    actions = [made.action, *_actions(s for track in made.nla_tracks for s in track.strips)]
    for action in filter(None, actions):
        for layer in action.layers:
            for strip in layer.strips:
                for bag in strip.channelbags:
                    yield from (curve.data_path for curve in bag.fcurves)


def _actions(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.Action | None]:
    for strip in strips:
        yield strip.action
        yield from _actions(strip.strips)


def _leaders(thing: bpy.types.Object, what: str) -> Iterator[Fact]:
    """What this follows: if any of it changes, so may this."""
    if what == PLACE:
        followed = [thing.parent] if thing.parent else []  # on a bone, or on corners of a mesh
    else:
        followed = [other for other in _shaped_by(thing) if isinstance(other, bpy.types.Object)]
        if followed:
            # A mirror that moves, or moving past one that does not: either makes another shape.
            yield thing, PLACE
    for other in followed:
        yield other, PLACE
        yield other, SHAPE


def _changes_itself(thing: bpy.types.Object, what: str) -> bool:
    if what == SHAPE:
        return _is_reshaped(thing)
    if is_animated(thing) or thing.constraints or thing.rigid_body:
        return True
    parent = thing.parent
    return bool(parent and parent.type == "CURVE" and is_animated(parent.data))  # along its path


def _is_reshaped(thing: bpy.types.Object) -> bool:
    """Whether its surface may change in itself, or be made anew for each frame."""
    if any(part.type in DEFORMING for part in thing.modifiers) or len(thing.particle_systems):
        return True
    if any(part.type == "NODES" and not stand_still(part.node_group) for part in thing.modifiers):
        return True
    if thing.pose and any(bone.constraints for bone in thing.pose.bones):
        return True
    if is_animated(getattr(thing.data, "shape_keys", None)):
        return True
    paths = () if thing.type in ("CAMERA", "LIGHT") else animated_paths(thing.data)
    if any(path != "eval_time" for path in paths):  # that moves only what runs along a curve
        return True
    return any(is_animated(other) or _is_film(other) for other in _shaped_by(thing))


def _shaped_by(thing: bpy.types.Object) -> Iterator[bpy.types.ID]:
    """Objects and textures that an object's modifiers refer to, or what bends it as its parent."""
    if thing.parent and thing.parent_type in ("ARMATURE", "LATTICE"):
        yield thing.parent
    for part in thing.modifiers:
        for name, kind in part.bl_rna.properties.items():
            if kind.type != "POINTER":
                continue
            value = getattr(part, name)
            if isinstance(value, bpy.types.Collection):
                yield from value.all_objects
            elif isinstance(value, bpy.types.ID):
                yield value


def _is_film(texture: bpy.types.ID) -> bool:
    """Whether its picture is another one in each frame."""
    image = getattr(texture, "image", None)
    return bool(image and image.source in ("SEQUENCE", "MOVIE"))


def stand_still(tree: bpy.types.NodeTree | None) -> bool:
    """Whether nodes of geometry make the same in all frames, and give no material; their inputs are
    the object's."""
    waiting, known = [tree], {None}
    while waiting:
        tree = waiting.pop()
        if tree in known:
            continue
        known.add(tree)
        if is_animated(tree):
            return False
        if not all(NODES_THAT_STAND_STILL.match(node.bl_idname) for node in tree.nodes):
            return False
        waiting += [node.node_tree for node in tree.nodes if node.bl_idname == "GeometryNodeGroup"]
    return True
