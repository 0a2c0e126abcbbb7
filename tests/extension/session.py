"""What a user does with the extension, in a Blender of its own; run by test_extension.py.

    python -I -S session.py PACKAGES ZIP HDRI FOLDER

PACKAGES: a folder with Blender's Python module and what that needs, nothing else; with -S it is
all there is beside the standard library, so that scipy and the like can only come from the zip.
Writes what it saw to FOLDER/report.json.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import shutil
import sys
from functools import partial
from pathlib import Path

PACKAGES, ZIP, HDRI, FOLDER = sys.argv[1:5]
sys.path.insert(0, PACKAGES)

import bpy  # noqa: E402

MODULE = "bl_ext.user_default.sunsplit"
LIBRARIES = ("scipy", "skimage", "OpenEXR", "OpenImageIO", "PIL", "tqdm", "networkx", "imageio")


def main() -> None:
    """Install, use, disable and enable again; then the command line of the same installation."""
    report = {"install": install()}
    report["touched"] = touched = []
    sys.addaudithook(partial(watch, Path(sys.modules[MODULE].__file__).parent, touched))
    light_by(HDRI)
    report["before"] = seen()
    report["convert"] = pressed(bpy.ops.sunsplit.convert)
    report["restore"] = pressed(bpy.ops.sunsplit.restore)
    report["without_openimageio"] = without("OpenImageIO")
    bpy.ops.sunsplit.restore()
    bpy.ops.preferences.addon_disable(module=MODULE)
    report["disabled"] = present()
    bpy.ops.preferences.addon_enable(module=MODULE)
    report["enabled_again"] = present()
    report["convert_again"] = pressed(bpy.ops.sunsplit.convert)
    report["command_line"] = command_line()
    report["library"] = library()
    report["libraries"] = {name: sys.modules[name].__file__ for name in loaded()}
    own = {n: m for n, m in sys.modules.items() if n == MODULE or n.startswith(f"{MODULE}.")}
    report["own_modules"] = {name: module.__file__ for name, module in own.items()}
    report["foreign_sunsplit"] = "sunsplit" in sys.modules
    (Path(FOLDER) / "report.json").write_text(json.dumps(report, indent=1), encoding="utf-8")


def install() -> dict[str, object]:
    """Install from the zip; what that imported."""
    before = set(sys.modules)
    result = bpy.ops.extensions.package_install_files(
        filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True
    )
    # The first parts of the names: `scipy` of `scipy.ndimage`.
    imported = {name.partition(".")[0] for name in set(sys.modules) - before}
    return {
        "result": list(result),
        "imported": sorted(imported),
        "loaded_before": sorted(before & set(LIBRARIES)),
        "present": present(),
    }


def watch(home: Path, touched: list[str], event: str, arguments: tuple) -> None:
    """Note what would not work in a folder that may only be read, or without a network: writing
    into the extension's own folder, but for compiled Python, and connecting to anything."""
    paths = [Path(a) for a in arguments if isinstance(a, str)]
    inside = any(p.is_relative_to(home) and "__pycache__" not in p.parts for p in paths[:2])
    if event == "open":
        _, mode, flags = arguments
        read = flags or 0 if mode is None else os.O_RDONLY if mode[0] == "r" else os.O_WRONLY
        writes = read & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) or "+" in (mode or "")
        if inside and writes:
            touched.append(f"{event} {arguments}")
    elif event.startswith(("os.mkdir", "os.rename", "os.remove", "shutil.", "tempfile.")):
        if inside:
            touched.append(f"{event} {arguments}")
    elif event in ("socket.connect", "socket.getaddrinfo", "urllib.Request"):
        touched.append(f"{event} {arguments}")


def present() -> dict[str, bool]:
    """What of the add-on Blender knows at the moment."""
    return {
        "settings": hasattr(bpy.context.scene, "sunsplit"),
        "operator": hasattr(bpy.types, "SUNSPLIT_OT_convert"),
        "panel": hasattr(bpy.types, "SUNSPLIT_PT_main"),
        "preference": MODULE in bpy.context.preferences.addons,
    }


def light_by(path: str) -> None:
    """Give the scene a world that shows a map."""
    world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    bpy.context.scene.world = world
    tree = world.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    texture.image = bpy.data.images.load(path)
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def pressed(operator: object) -> dict[str, object]:
    """Call an operator as its button does; what the scene looks like afterwards."""
    return {"result": list(operator()), **seen()}


def without(library: str) -> dict[str, object]:
    """Convert where a library cannot be imported, a map that is not known already."""
    kept = sys.modules.pop(library, None)
    sys.modules[library] = None
    sys.modules[f"{MODULE}.addon.known"].forget()
    try:
        return pressed(bpy.ops.sunsplit.convert)
    finally:
        del sys.modules[library]
        if kept is not None:
            sys.modules[library] = kept


def seen() -> dict[str, object]:
    """The scene's world and the lamps of a conversion."""
    collection = bpy.data.collections.get("Sunsplit Suns")
    lamps = [t for t in collection.objects if t.type == "LIGHT"] if collection else []
    maps = [n for n in bpy.context.scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT"]
    return {
        "world": bpy.context.scene.world.name,
        "maps": len(maps),
        "lamps": [[lamp.type, lamp.data.type, lamp.data.energy] for lamp in lamps],
    }


def loaded() -> list[str]:
    return [name for name in LIBRARIES if name in sys.modules]


def command_line() -> dict[str, object]:
    """Convert the file itself, with a picture: this needs what Blender does not ask for."""
    cli = importlib.import_module(f"{MODULE}.core.cli")
    folder = Path(FOLDER) / "converted"
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = cli.main(["convert", HDRI, "-o", str(folder), "--preview"])
    files = sorted(path.name for path in folder.iterdir())
    return {"status": status, "files": files, "said": said.getvalue()}


def library() -> dict[str, object]:
    """Convert a folder: the workers are other processes, which know no extension by this name."""
    cli = importlib.import_module(f"{MODULE}.core.cli")
    folder, said = Path(FOLDER), io.StringIO()
    (folder / "maps" / "inner").mkdir(parents=True)
    shutil.copy(HDRI, folder / "maps" / "inner")
    arguments = ["library", str(folder / "maps"), "-o", str(folder / "library"), "--json"]
    with contextlib.redirect_stdout(said):
        status = cli.main(arguments)
    made = folder / "library" / "inner"
    files = sorted(path.name for path in made.iterdir()) if made.exists() else []
    return {"status": status, "files": files, "said": said.getvalue()}


if __name__ == "__main__":
    main()
