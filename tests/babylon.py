"""Babylon.js in a real browser: what its materials show of a file's light."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from sunsplit.core import sphere
from sunsplit.core.export.axes import Y_UP
from sunsplit.core.export.gltf.document import data_uri, quaternion
from sunsplit.core.export.stage import Ball, mesh_of
from tests.browser import browser, chromium
from tests.gltf_validator import PACKAGES
from tests.installed import not_installed

SCRIPTS = ("babylonjs/babylon.js", "babylonjs-loaders/babylonjs.loaders.min.js")

MATT = {"metallicFactor": 0, "roughnessFactor": 1}
MIRROR = {"metallicFactor": 1, "roughnessFactor": 0}

PAGE = """async ([gltf, count]) => {
  const canvas = document.createElement("canvas");
  const engine = new BABYLON.Engine(canvas, false);
  const scene = new BABYLON.Scene(engine);
  await BABYLON.SceneLoader.AppendAsync("", "data:" + gltf, scene, undefined, ".gltf");
  // Its loader forgets to say that what it has unpacked is linear.
  if (scene.environmentTexture) scene.environmentTexture.gammaSpace = false;
  scene.imageProcessingConfiguration.applyByPostProcess = true;  // linear pictures
  await scene.whenReadyAsync();
  const seen = [];
  for (let k = 0; k < count; k++) {
    const camera = scene.cameras.find((c) => [c.name, c.parent?.name].includes("view " + k));
    const type = BABYLON.Constants.TEXTURETYPE_FLOAT;
    const picture = new BABYLON.RenderTargetTexture("view", 9, scene, false, true, type);
    scene.activeCamera = picture.activeCamera = camera;
    picture.renderList = scene.meshes.slice();
    while (!picture.isReadyForRendering()) await new Promise((go) => setTimeout(go, 20));
    scene.customRenderTargets = [picture];
    scene.render();
    const pixels = await picture.readPixels();
    seen.push(Array.from(pixels.slice(4 * 40, 4 * 40 + 3)));  // the middle one of 9 x 9
    picture.dispose();
  }
  engine.dispose();
  return seen;
}"""


def seen_on_a_ball(lights: Path, ways: np.ndarray, surface: dict[str, float]) -> np.ndarray:
    """Linear colours, (n, 3), of the middle of a ball seen from each of these ways, (n, 3), under
    the light of a file: there its normal is the way itself, and a mirror shows what is there.

    Skips where Chromium or the npm packages babylonjs and babylonjs-loaders are not installed.
    """
    scripts = [PACKAGES / script for script in SCRIPTS]
    if not chromium() or not all(script.is_file() for script in scripts):
        not_installed("Chromium or the npm packages babylonjs and babylonjs-loaders are missing.")
    document = json.loads(lights.read_text(encoding="utf-8"))
    _add_ball(document, surface)
    for number, way in enumerate(ways):
        _add_camera(document, f"view {number}", way)
    with browser("--use-angle=swiftshader", "--enable-unsafe-swiftshader") as opened:
        page = opened.new_page()
        page.set_content("<body></body>")
        for script in scripts:
            page.add_script_tag(path=str(script))
        return np.array(page.evaluate(PAGE, [json.dumps(document), len(ways)]))


def _add(document: dict[str, Any], node: dict[str, Any]) -> None:
    document.setdefault("nodes", []).append(node)
    (scene,) = document["scenes"]
    scene.setdefault("nodes", []).append(len(document["nodes"]) - 1)


def _add_ball(document: dict[str, Any], surface: dict[str, float]) -> None:
    mesh = mesh_of(Ball((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0)))
    points, normals = ((v @ Y_UP.matrix.T).astype("<f4") for v in (mesh.points, mesh.normals))
    parts = [points, normals, mesh.triangles.ravel().astype("<u4")]
    data, start = b"".join(part.tobytes() for part in parts), 0
    document["buffers"] = [
        {"uri": data_uri("application/octet-stream", data), "byteLength": len(data)}
    ]
    document["bufferViews"], document["accessors"] = [], []
    for part, kind, component in zip(
        parts, ("VEC3", "VEC3", "SCALAR"), (5126, 5126, 5125), strict=True
    ):
        view = {"buffer": 0, "byteOffset": start, "byteLength": part.nbytes}
        document["bufferViews"].append(view)
        accessor = {"bufferView": len(document["accessors"]), "type": kind, "count": len(part)}
        document["accessors"].append({**accessor, "componentType": component})
        start += part.nbytes
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    document["accessors"][0].update(bounds)
    document["materials"] = [{"pbrMetallicRoughness": surface}]
    primitive = {"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}
    document["meshes"] = [{"primitives": [primitive]}]
    _add(document, {"mesh": 0})


def _add_camera(document: dict[str, Any], name: str, way: np.ndarray) -> None:
    """Far away, so that it sees the ball's middle along one line."""
    perspective = {"yfov": 0.002, "aspectRatio": 1, "znear": 1, "zfar": 200}
    document["cameras"] = [{"type": "perspective", "perspective": perspective}]
    frame = Y_UP.matrix @ np.stack([*sphere.tangents(way), way], axis=-1)
    place = {"translation": (Y_UP.matrix @ way * 50).tolist(), "rotation": quaternion(frame)}
    _add(document, {"name": name, "camera": 0, **place})
