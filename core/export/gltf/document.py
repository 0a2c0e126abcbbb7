"""A glTF 2.0 file while it is put together: one JSON with all its data inside."""

from __future__ import annotations

import json
from base64 import b64encode
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...version import version
from ..names import shown

Floats = NDArray[np.float64]
Json = dict[str, Any]

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
"""Numbers that glTF has from OpenGL: types of components, and what a part of a buffer is for."""


class Document:
    """One scene. Lists of glTF come to be as they are needed, as it allows no empty ones."""

    def __init__(self, name: str) -> None:
        self._scene: Json = {"name": shown(name)}
        self._parts: Json = {
            "asset": {"version": "2.0", "generator": f"Sunsplit {version()}"},
            "scene": 0,
            "scenes": [self._scene],
        }
        self._data = bytearray()

    def add(self, kind: str, part: Json) -> int:
        """A part of the list of this name: its index."""
        return _added(self._parts, kind, part)

    def add_node(self, name: str, part: Json) -> None:
        """A node of the scene."""
        index = self.add("nodes", {"name": name, **part})
        self._scene.setdefault("nodes", []).append(index)

    def add_of_extension(self, extension: str, kind: str, part: Json) -> int:
        """A part of a list that an extension has at the root: its index there."""
        self.use(extension)
        lists = self._parts.setdefault("extensions", {}).setdefault(extension, {})
        return _added(lists, kind, part)

    def use(self, extension: str) -> None:
        """No reader has to know it; one that does not shows the rest."""
        used = self._parts.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def tell(self, extras: Json) -> None:
        """What is to be known about the scene: readers keep it with theirs."""
        self._scene["extras"] = extras

    def extend_scene(self, extension: str, part: Json) -> None:
        self.use(extension)
        self._scene.setdefault("extensions", {})[extension] = part

    def add_vectors(self, vectors: Floats, with_bounds: bool = False) -> int:
        """Of vertices, (n, 3), stored as float32: the index of the accessor."""
        stored = np.ascontiguousarray(vectors, "<f4")
        bounds = {}
        if with_bounds:
            bounds = {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        return self._add_accessor(stored, VERTICES, FLOAT, "VEC3", bounds)

    def add_indices(self, indices: NDArray[np.integer]) -> int:
        """Of a mesh's corners, in a row: the index of the accessor."""
        stored = np.ascontiguousarray(indices.ravel(), "<u4")
        return self._add_accessor(stored, INDICES, UNSIGNED_INT, "SCALAR", {})

    def _add_accessor(
        self, stored: NDArray, target: int, component: int, kind: str, bounds: Json
    ) -> int:
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": stored.nbytes}
        self._data += stored.tobytes()  # four bytes a number: every part begins at a multiple
        accessor = {
            "bufferView": self.add("bufferViews", {**view, "target": target}),
            "componentType": component,
            "count": len(stored),
            "type": kind,
        }
        return self.add("accessors", {**accessor, **bounds})

    def text(self) -> str:
        """The file."""
        parts = dict(self._parts)
        if self._data:
            uri = data_uri("application/octet-stream", bytes(self._data))
            parts["buffers"] = [{"uri": uri, "byteLength": len(self._data)}]
        return json.dumps(parts, ensure_ascii=False, indent=1, allow_nan=False) + "\n"


def data_uri(media_type: str, content: bytes) -> str:
    """Content as an address that holds it."""
    return f"data:{media_type};base64,{b64encode(content).decode('ascii')}"


def numbers_of(values: Floats) -> list[float]:
    return [float(value) for value in values]


def quaternion(matrix: Floats) -> list[float]:
    """x, y, z, w of a rotation, (3, 3)."""
    from scipy.spatial.transform import Rotation

    return numbers_of(Rotation.from_matrix(matrix).as_quat())


def _added(lists: Json, kind: str, part: Json) -> int:
    found = lists.setdefault(kind, [])
    found.append(part)
    return len(found) - 1
