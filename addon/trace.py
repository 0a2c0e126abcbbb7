"""Follow a world's nodes from its output back to the environment texture that lights the scene.

What counts is what rays other than the camera's see, so a mix by Light Path > Is Camera Ray is
followed into the branch that lights. Everything between texture and output must be linear in the
texture, as a lamp can only be stronger or weaker or tinted; what is not is refused by its name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.environment import LUMINANCE_WEIGHTS
from ..core.errors import UnusableInput

TAG = "sunsplit"
"""Custom property of every data-block and node that a conversion makes."""

Stack = tuple[bpy.types.Node, ...]
"""The group nodes that a node lies in, outermost first."""


@dataclass(frozen=True, eq=False)
class Place:
    """A node, and the group nodes around it."""

    node: bpy.types.Node
    stack: Stack

    def input(self, name: str | int) -> Input:
        return Input(self.node.inputs[name], self.stack)


@dataclass(frozen=True, eq=False)
class Input:
    """An input socket, and the group nodes around it."""

    socket: bpy.types.NodeSocket
    stack: Stack


@dataclass(frozen=True, eq=False)
class Output:
    """An output socket, and the group nodes around it."""

    socket: bpy.types.NodeSocket
    stack: Stack

    @property
    def place(self) -> Place:
        return Place(self.socket.node, self.stack)


@dataclass(frozen=True, eq=False)
class Contribution:
    """An environment texture and the factor, (3,), that its radiance reaches the scene with.

    strength: of the one background that it shines through, as a part of that factor; None where
    there are several.
    """

    texture: Place
    gain: NDArray[np.float64]
    strength: Input | None = None


def cannot_follow(node: bpy.types.Node, why: str) -> UnusableInput:
    label = node.label or node.name
    return UnusableInput(
        f'The world\'s node "{label}" {why}, which lamps cannot follow: '
        "remove it, or render the world to a panorama and use that."
    )


def lighting_textures(
    world: bpy.types.World, engine: str = "CYCLES", undone: bool = True
) -> list[Contribution]:
    """Every environment texture that lights the scene, several paths to one added up.

    engine: of the scene, as a world may have an output for each. undone: as if the world were not
    converted; else a residual map is what lights a converted world.
    """
    found: dict[tuple, Contribution] = {}
    for place, weight in _backgrounds(_surface(world, engine)):
        strength = place.input("Strength")
        for part in _colour(place.input("Color"), undone):
            part = replace(part, gain=part.gain * weight * constant(strength), strength=strength)
            if not part.gain.any():
                continue
            key = (*(n.name for n in part.texture.stack), part.texture.node.name)
            before = found.get(key)
            if before:
                part = replace(part, gain=part.gain + before.gain, strength=None)
            found[key] = part
    return list(found.values())


def plain_light(world: bpy.types.World, engine: str = "CYCLES") -> NDArray[np.float64]:
    """Radiance, (3,), that backgrounds without an environment texture give in all directions.

    Raises UnusableInput where it is not the same in all.
    """
    total = np.zeros(3)
    for place, weight in _backgrounds(_surface(world, engine)):
        strength, colour = weight * constant(place.input("Strength")), place.input("Color")
        if strength.any() and not any(True for _ in _colour(colour, undone=False)):
            total += strength * constant(colour)
    return total


def _surface(world: bpy.types.World, engine: str) -> Input:
    """What an engine takes the world's light from. Raises UnusableInput."""
    tree = world.node_tree
    # From Blender 5 on every world uses nodes, and asking whether it does is deprecated.
    uses_nodes = tree is not None and (bpy.app.version >= (5, 0) or world.use_nodes)
    target = "EEVEE" if "EEVEE" in engine else "CYCLES"
    output = tree.get_output_node(target) if uses_nodes else None
    if output is None:
        raise UnusableInput(
            f'The world "{world.name}" uses no nodes: give it an Environment Texture first.'
        )
    return Place(output, ()).input("Surface")


def source_of(start: Input) -> Output | None:
    """The output that feeds an input, through reroutes, muted nodes and group borders.

    None when nothing does; then the value of the socket where the chain ends counts.
    """
    end = ends_at(start)
    return end if isinstance(end, Output) else None


def ends_at(at: Input) -> Output | Input:
    """Where a chain of links ends: at an output that makes a value, or at an unlinked input."""
    while at.socket.is_linked and not at.socket.links[0].is_muted:
        output = Output(at.socket.links[0].from_socket, at.stack)
        step = _through(output)
        if step is None:
            return output
        at = step
    return at


def _through(output: Output) -> Input | None:
    """The input that an output merely hands on, or None when its node makes the value."""
    node, stack = output.socket.node, output.stack
    if node.type == "REROUTE":
        return Input(node.inputs[0], stack)
    if node.mute:
        for link in node.internal_links:
            if link.to_socket == output.socket:
                return Input(link.from_socket, stack)
        raise cannot_follow(node, "is muted and has nothing to hand on")
    if node.type == "GROUP_INPUT":
        return Input(_by_identifier(stack[-1].inputs, output.socket.identifier), stack[:-1])
    if node.type == "GROUP":
        if node.node_tree is None:
            raise cannot_follow(node, "is a group without content")
        inner = next((n for n in node.node_tree.nodes if _is_active_output(n)), None)
        if inner is None:
            raise cannot_follow(node, "is a group without an output")
        return Input(_by_identifier(inner.inputs, output.socket.identifier), (*stack, node))
    return None


def _is_active_output(node: bpy.types.Node) -> bool:
    return node.type == "GROUP_OUTPUT" and node.is_active_output


def _by_identifier(sockets: bpy.types.NodeInputs, identifier: str) -> bpy.types.NodeSocket:
    return next(socket for socket in sockets if socket.identifier == identifier)


def _backgrounds(at: Input) -> Iterator[tuple[Place, float]]:
    """Backgrounds that a closure is made of, and the part that each has in it."""
    output = source_of(at)
    if output is None:
        return
    place, kind = output.place, output.socket.node.type
    if kind in ("BACKGROUND", "EMISSION"):
        yield place, 1.0
    elif kind == "MIX_SHADER":
        factor = float(np.clip(constant(place.input(0))[0], 0, 1))
        for index, weight in ((1, 1 - factor), (2, factor)):
            if weight:
                yield from ((one, part * weight) for one, part in _backgrounds(place.input(index)))
    elif kind == "ADD_SHADER":
        yield from _backgrounds(place.input(0))
        yield from _backgrounds(place.input(1))
    else:
        raise cannot_follow(place.node, "is not a background")


def _colour(at: Input, undone: bool) -> Iterator[Contribution]:
    """Contributions of a colour; none where it does not come from an environment texture."""
    output = source_of(at)
    if output is None:
        return
    place, kind = output.place, output.socket.node.type
    if kind == "TEX_ENVIRONMENT":
        yield Contribution(place, np.ones(3))
    elif undone and place.node.get(TAG):
        # The mix of an earlier conversion: what lit before is what it shows the camera.
        yield from _colour(place.input(7), undone)
    elif kind == "HUE_SAT" and _only_scales(place):
        gain = constant(place.input("Value"))
        for part in _colour(place.input("Color"), undone):
            yield replace(part, gain=part.gain * gain)
    elif kind in ("MIX", "MIX_RGB"):
        yield from _mixed(place, undone)
    elif kind == "VECT_MATH":
        yield from _vector_math(place, undone)
    elif kind in _IDENTITIES and _has_values(place, _IDENTITIES[kind]):
        yield from _colour(place.input("Color"), undone)
    elif any(_colour_textures(place)):
        raise cannot_follow(place.node, "changes the map's colours unevenly")


_IDENTITIES: dict[str, dict[str, float]] = {
    "GAMMA": {"Gamma": 1},
    "BRIGHTCONTRAST": {"Bright": 0, "Contrast": 0},
    "HUE_SAT": {"Hue": 0.5, "Saturation": 1, "Value": 1},
    "INVERT": {"Fac": 0},
    "CURVE_RGB": {"Fac": 0},
}
"""Nodes that change nothing at these values; all of them may also be switched off by Fac 0."""


def _has_values(place: Place, wanted: dict[str, float]) -> bool:
    sockets = {s.identifier: s for s in place.node.inputs}
    factor = sockets.get("Fac")
    if factor is not None and _is_zero(Input(factor, place.stack)):
        return True
    return all(
        name in sockets and np.allclose(constant(Input(sockets[name], place.stack)), value)
        for name, value in wanted.items()
    )


def _only_scales(place: Place) -> bool:
    """Whether a Hue/Saturation/Value node leaves hue and saturation and is fully on."""
    sockets = {s.identifier: Input(s, place.stack) for s in place.node.inputs}
    neutral = {"Hue": 0.5, "Saturation": 1, "Fac": 1}
    return all(
        name in sockets and np.allclose(constant(sockets[name]), value)
        for name, value in neutral.items()
    )


def _is_zero(at: Input) -> bool:
    return source_of(at) is None and not constant(at).any()


def _colour_textures(place: Place) -> Iterator[bool]:
    """True for each environment texture somewhere above a node that is not understood."""
    for socket in place.node.inputs:
        output = source_of(Input(socket, place.stack))
        if output is not None:
            if output.socket.node.type == "TEX_ENVIRONMENT":
                yield True
            else:
                yield from _colour_textures(output.place)


def _mixed(place: Place, undone: bool) -> Iterator[Contribution]:
    node = place.node
    if node.type == "MIX":
        if node.data_type != "RGBA":
            raise cannot_follow(node, "mixes something other than colours")
        factor, first, second = (place.input(index) for index in (0, 6, 7))
        clamped = node.clamp_result
        limited = node.clamp_factor
    else:
        factor, first, second = (place.input(index) for index in (0, 1, 2))
        clamped = node.use_clamp
        limited = True
    sides = list(_colour(first, undone)), list(_colour(second, undone))
    if not any(sides):
        return
    if clamped:
        raise cannot_follow(node, "clamps the map")
    weight = float(constant(factor)[0])
    if limited:
        weight = min(max(weight, 0.0), 1.0)
    for is_first in (True, False):
        parts = sides[0 if is_first else 1]
        others, other = (sides[1], second) if is_first else (sides[0], first)
        if parts:
            gain = _gain_of_side(node, is_first, weight, None if others else other)
            yield from (replace(part, gain=part.gain * gain) for part in parts)


def _gain_of_side(
    node: bpy.types.Node, is_first: bool, weight: float, other: Input | None
) -> NDArray[np.float64]:
    """What a mix does to its first (A) or second (B) colour; other: the other one if constant."""
    if node.blend_type == "MIX" or weight == 0:
        return np.full(3, 1 - weight if is_first else weight)
    if node.blend_type == "ADD":
        return np.full(3, 1.0 if is_first else weight)
    if node.blend_type == "MULTIPLY" and other is not None:
        # A (1 - f) + f A B: linear in either side while the other one is constant.
        return (1 - weight if is_first else 0) + weight * constant(other)
    raise cannot_follow(node, f"blends the map by {node.blend_type.title()}")


def _vector_math(place: Place, undone: bool) -> Iterator[Contribution]:
    first, second = (list(_colour(place.input(index), undone)) for index in (0, 1))
    if not first and not second:
        return
    operation = place.node.operation
    if operation == "SCALE":
        gain = constant(place.input("Scale"))
        yield from (replace(part, gain=part.gain * gain) for part in first)
    elif operation == "ADD":
        yield from first
        yield from second
    elif operation == "MULTIPLY" and not (first and second):
        gain = constant(place.input(1 if first else 0))
        yield from (replace(part, gain=part.gain * gain) for part in first or second)
    else:
        raise cannot_follow(place.node, f"does {operation.title()} on the map")


def constant(at: Input) -> NDArray[np.float64]:
    """The value of a number, vector or colour for a ray that lights, as an array (3,).

    Raises UnusableInput when it depends on anything but Light Path > Is Camera Ray.
    """
    end = ends_at(at)
    value = _value(end)
    if at.socket.type == "VALUE" and end.socket.type == "RGBA":
        return np.full(3, value @ LUMINANCE_WEIGHTS)  # as renderers make a number of a colour
    if at.socket.type == "VALUE" and end.socket.type == "VECTOR":
        return np.full(3, value.mean())
    return value


def _value(end: Input | Output) -> NDArray[np.float64]:
    if isinstance(end, Input):
        return _as_three(end.socket.default_value)
    place, node = end.place, end.socket.node
    if node.type in ("VALUE", "RGB"):
        return _as_three(end.socket.default_value)
    if node.type == "COMBXYZ":
        return np.array([constant(place.input(index))[0] for index in range(3)])
    if node.type == "LIGHT_PATH" and (end.socket.identifier == "Is Camera Ray" or node.get(TAG)):
        return np.zeros(3)  # a conversion asks for rays of mirrors, too, which do not light
    if node.type == "MATH" and node.operation in _MATH:
        return _math(place)
    raise cannot_follow(node, "is not one value for the whole map")


def _as_three(value: object) -> NDArray[np.float64]:
    array = np.atleast_1d(np.array(value, dtype=np.float64))
    return np.repeat(array, 3) if array.size == 1 else array[:3]


_MATH = {
    "ADD": np.add,
    "SUBTRACT": np.subtract,
    "MULTIPLY": np.multiply,
    "DIVIDE": lambda a, b: np.divide(a, b, out=np.zeros_like(a), where=b != 0),
    "MAXIMUM": np.maximum,
    "MINIMUM": np.minimum,
    "POWER": lambda a, b: np.abs(a) ** b,
}


def _math(place: Place) -> NDArray[np.float64]:
    value = _MATH[place.node.operation](constant(place.input(0)), constant(place.input(1)))
    return np.clip(value, 0, 1) if place.node.use_clamp else value
