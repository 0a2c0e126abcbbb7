"""Values that follow a node's input: drivers that need no Python and no add-on to be worked out.

Blender works "simple expressions" out by itself, also where scripts in files are not allowed to
run, and on machines that have no Sunsplit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import bpy

from .trace import Input, Output, constant, ends_at

LONGEST = 255
"""Characters that Blender keeps of an expression."""

_OPERATORS = {"ADD": "+", "SUBTRACT": "-", "MULTIPLY": "*", "DIVIDE": "/"}
_FUNCTIONS = {"MAXIMUM": "max", "MINIMUM": "min", "POWER": "pow"}


@dataclass
class Formula:
    """An expression in the making, and what its variables stand for: (kind of ID, ID, path)."""

    variables: dict[str, tuple[str, bpy.types.ID, str]] = field(default_factory=dict)

    def property(self, kind: str, owner: bpy.types.ID, path: str) -> str:
        """The variable for a property of a data-block."""
        target = kind, owner, path
        for name, known in self.variables.items():
            if known == target:
                return name
        name = f"v{len(self.variables)}_"  # none is a part of another
        self.variables[name] = target
        return name

    def input(self, at: Input, component: int = 0) -> str:
        """The value of a node's input, or of a component of it, as `trace.constant` knows it."""
        end = ends_at(at)
        if isinstance(end, Input):
            return self._socket(end.socket, component)
        return self._output(end, at, component)

    def drive(
        self, owner: bpy.types.bpy_struct, path: str, index: int, text: str, now: float
    ) -> None:
        """Let a property of a data-block follow an expression of this formula's variables. index:
        of its component, -1 where it has none. now: the value, which it keeps where it depends on
        nothing or Blender could not hold the expression."""
        used = {name: source for name, source in self.variables.items() if name in text}
        if not used or len(text) > LONGEST:
            if index < 0:
                setattr(owner, path, now)
            else:
                getattr(owner, path)[index] = now
            return
        curve = owner.driver_add(path, index)
        # It comes with points at 0 and 1, which it snaps to from within a ten thousandth.
        curve.keyframe_points.clear()
        driver = curve.driver
        driver.type = "SCRIPTED"
        for name, (kind, source, source_path) in used.items():
            variable = driver.variables.new()
            variable.name = name
            variable.targets[0].id_type = kind
            variable.targets[0].id = source
            variable.targets[0].data_path = source_path
        driver.expression = text

    def _output(self, end: Output, at: Input, component: int) -> str:
        place, node = end.place, end.socket.node
        same_kind = (at.socket.type == "VALUE") == (end.socket.type == "VALUE")
        if node.type in ("VALUE", "RGB") and (same_kind or node.type == "VALUE"):
            return self._socket(end.socket, component)
        if node.type == "COMBXYZ" and at.socket.type != "VALUE":
            return self.input(place.input(component))
        if node.type == "MATH" and not node.use_clamp:
            sides = self.input(place.input(0)), self.input(place.input(1))
            if node.operation in _OPERATORS:
                return f"({sides[0]}{_OPERATORS[node.operation]}{sides[1]})"
            if node.operation in _FUNCTIONS:
                return f"{_FUNCTIONS[node.operation]}({sides[0]},{sides[1]})"
        # Something else that is one value now: it stays that.
        return repr(float(constant(at)[component]))

    def _socket(self, socket: bpy.types.NodeSocket, component: int) -> str:
        path = socket.path_from_id("default_value")
        if not isinstance(socket.default_value, float | int):
            path += f"[{component}]"
        tree = socket.id_data
        if tree.is_embedded_data:
            world = next(w for w in bpy.data.worlds if w.node_tree == tree)
            return self.property("WORLD", world, f"node_tree.{path}")
        return self.property("NODETREE", tree, path)


def followed(things: Iterable[bpy.types.Object]) -> set[tuple[bpy.types.ID, str]]:
    """Node trees and paths of inputs that drivers of objects, or of their data, follow."""
    found = set()
    for thing in things:
        for owner in (thing, thing.data):
            if owner is None or owner.animation_data is None:
                continue
            for curve in owner.animation_data.drivers:
                for variable in curve.driver.variables:
                    target = variable.targets[0]
                    path = target.data_path.partition(".default_value")
                    if target.id_type == "WORLD":
                        tree = target.id.node_tree
                        found.add((tree, path[0].removeprefix("node_tree.") + path[1]))
                    elif target.id_type == "NODETREE":
                        found.add((target.id, path[0] + path[1]))
    return found
