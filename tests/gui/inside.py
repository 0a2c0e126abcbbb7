"""What runs inside the window's Blender: a scene, and answers to what the tests ask.

    blender --python inside.py -- FOLDER

FOLDER holds `sky.hdr`. A timer runs every 20 ms: it leaves a heartbeat and evaluates what is asked
in `ask.json`, an expression with the functions of this file and `bpy` as names; `answer.json` is
what comes of it. Nothing here presses a button: that is done from outside, with a mouse.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
import traceback
from collections.abc import Callable
from functools import wraps
from pathlib import Path

import bpy
from mathutils import Euler

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
MODULE = "bl_ext.user_default.sunsplit"
TICK = 0.02

HEARTBEAT = (FOLDER / "heartbeat").open("w", buffering=1)
"""A line for each tick: seconds of the monotonic clock, which all processes share."""


def main() -> None:
    preferences = bpy.context.preferences
    preferences.use_preferences_save = False
    preferences.view.show_splash = False
    preferences.view.use_save_prompt = False
    preferences.filepaths.use_auto_save_temporary_files = False
    # The sidebar beside the view, not over it: what is in it stands on one colour.
    preferences.system.use_region_overlap = False
    # The processor draws: eight times for smooth edges is too much.
    preferences.system.viewport_aa = "OFF"
    bpy.app.timers.register(tick, first_interval=TICK, persistent=True)


def tick() -> float:
    """Leave a heartbeat; answer what is asked."""
    HEARTBEAT.write(f"{time.monotonic():.4f}\n")
    question = FOLDER / "ask.json"
    if question.exists():
        asked = json.loads(question.read_text(encoding="utf-8"))
        question.unlink()
        part = FOLDER / "answer.part"
        part.write_text(json.dumps(answer(asked)), encoding="utf-8")
        part.rename(FOLDER / "answer.json")
    return TICK


def answer(asked: str) -> dict[str, object]:
    """The value of an expression, or why there is none."""
    try:
        return {"value": eval(asked, globals())}  # the tests' own words
    except Exception:
        return {"error": traceback.format_exc()}


# The extension


def install(name: str) -> list[str]:
    """Install a zip that lies in the folder, and enable it."""
    return list(
        bpy.ops.extensions.package_install_files(
            filepath=str(FOLDER / name),
            repo="user_default",
            enable_on_install=True,
            overwrite=True,
        )
    )


def present() -> dict[str, bool]:
    """What of the extension Blender knows at the moment."""
    return {
        "settings": hasattr(bpy.types.Scene, "sunsplit"),
        "operator": hasattr(bpy.types, "SUNSPLIT_OT_convert"),
        "panel": hasattr(bpy.types, "SUNSPLIT_PT_main"),
        "preference": MODULE in bpy.context.preferences.addons,
    }


def enable(on: bool = True) -> None:
    """Enable or disable the extension as its switch in the preferences does."""
    operator = bpy.ops.preferences.addon_enable if on else bpy.ops.preferences.addon_disable
    operator(module=MODULE)


def timed_start() -> float:
    """Milliseconds to import and register the extension, as each start of Blender does."""
    sys.modules[MODULE].unregister()
    for name in [name for name in sys.modules if f"{name}.".startswith(f"{MODULE}.")]:
        del sys.modules[name]
    began = time.perf_counter()
    module = importlib.import_module(MODULE)
    module.register()
    spent = 1e3 * (time.perf_counter() - began)
    module.__addon_enabled__ = True  # or Blender would not unregister it
    return spent


def forget() -> None:
    """Have the next conversion begin with reading its map."""
    known = sys.modules.get(f"{MODULE}.addon.known")
    if known is not None:
        known.forget()


# The scene


def new_scene() -> None:
    """Surfaces under a real HDRI, saved and opened: with nothing to undo."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    with bpy.context.temp_override(window=window()):
        add = bpy.ops.mesh
        add.primitive_plane_add(size=12)
        add.primitive_cube_add(size=1.4, location=(-1.6, 0.4, 0.7))
        add.primitive_cylinder_add(radius=0.35, depth=2.4, location=(1.9, 1.0, 1.2))
        add.primitive_uv_sphere_add(radius=0.8, location=(0.4, -0.6, 0.8))
        bpy.ops.object.shade_smooth()
        bpy.ops.object.camera_add(location=(6.2, -6.6, 3.4), rotation=(1.25, 0, 0.75))
        bpy.ops.object.select_all(action="DESELECT")
    scene = bpy.context.scene
    scene.camera = bpy.data.objects["Camera"]
    scene.render.engine = "CYCLES"
    scene.world = bpy.data.worlds.new("World")
    light_by("sky.hdr")
    save_scene("scene.blend")
    open_scene("scene.blend")


def animate() -> None:
    """A camera that pans over a ground, at frame 30 of 100; it was moved since, without a key."""
    scene = bpy.context.scene
    scene.frame_end = 100
    bpy.ops.mesh.primitive_plane_add(size=200)
    camera = bpy.data.objects.new("Pan", bpy.data.cameras.new("Pan"))
    scene.collection.objects.link(camera)
    scene.camera, camera.rotation_euler[0] = camera, 1.0
    for frame, turn in ((1, 0.0), (100, 1.0)):
        camera.rotation_euler[2], camera.location[2] = turn, 3
        camera.keyframe_insert("rotation_euler", frame=frame)
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(30)
    camera.location[0] = 0.25
    remember_step("Animate")


def animated() -> list[object]:
    """The frame, where the camera stands, and all scenes of the file."""
    scene = bpy.context.scene
    return [scene.frame_current, *scene.camera.matrix_world.translation, len(bpy.data.scenes)]


def look() -> tuple[int, int, int] | None:
    """How many frames Sunsplit looks at, of which range."""
    module = importlib.import_module("bl_ext.user_default.sunsplit.addon.scene_needs")
    return module.needs_of(bpy.context.scene).looked


def light_by(name: str) -> None:
    """Give the scene's world a map that lies in the folder."""
    tree = bpy.context.scene.world.node_tree
    found = {node.type: node for node in tree.nodes}
    texture = found.get("TEX_ENVIRONMENT") or tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(FOLDER / name))
    tree.links.new(texture.outputs["Color"], found["BACKGROUND"].inputs["Color"])


def save_scene(name: str) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / name))


def open_scene(name: str) -> None:
    """A file of the folder; the window keeps its areas."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / name), load_ui=False)


def remember_step(name: str) -> None:
    """Make a change from here a step that can be undone to, as one of the user's is."""
    with bpy.context.temp_override(window=window()):
        bpy.ops.ed.undo_push(message=name)


# What there is


def state() -> dict[str, object]:
    """The scene as a user of Sunsplit sees it, and every data-block by its name."""
    scene = bpy.context.scene
    settings = scene.sunsplit
    return {
        "world": scene.world.name if scene.world else None,
        "nodes": nodes(scene.world),
        "lamps": [one.name for one in scene.objects if one.type == "LIGHT"],
        "converted": is_converted(),
        "report": settings.report,
        "blocks": blocks(),
    }


def blocks() -> dict[str, list[str]]:
    """The names of all data-blocks of the file, by kind."""
    kinds = [p.identifier for p in bpy.data.bl_rna.properties if p.type == "COLLECTION"]
    return {kind: [one.name_full for one in getattr(bpy.data, kind)] for kind in kinds}


def nodes(world: bpy.types.World | None) -> list[str]:
    """What a world is made of, in words that can be compared."""
    if world is None:
        return []
    tree = world.node_tree
    images = [f"{n.name}: {n.image and n.image.name}" for n in tree.nodes if hasattr(n, "image")]
    links = [f"{a.from_node.name}.{a.from_socket.name} > {a.to_node.name}" for a in tree.links]
    sampling = [f"threshold {world.sun_threshold:g}", f"sampling {world.cycles.sampling_method}"]
    return [*(node.name for node in tree.nodes), *images, *links, *sampling]


def running() -> list[str]:
    """Operators that go on while the window is alive."""
    return [one.bl_idname for one in window().modal_operators]


def reports() -> list[str]:
    """What Blender has told the user, oldest first, as the Info editor shows it."""
    manager = bpy.context.window_manager
    manager.clipboard = ""
    area = next(area for area in window().screen.areas if area.type == "DOPESHEET_EDITOR")
    kind, area.ui_type = area.ui_type, "INFO"
    try:
        with bpy.context.temp_override(window=window(), area=area, region=area.regions[-1]):
            bpy.ops.info.select_all(action="SELECT")
            bpy.ops.info.report_copy()
            bpy.ops.info.select_all(action="DESELECT")
    finally:
        area.ui_type = kind
    return manager.clipboard.splitlines()


# The window


def window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def view() -> bpy.types.Area:
    """The 3D view."""
    return next(area for area in window().screen.areas if area.type == "VIEW_3D")


def region(kind: str) -> bpy.types.Region:
    """A region of the 3D view, by its type."""
    return next(one for one in view().regions if one.type == kind)


def place(kind: str) -> list[int]:
    """Left, top, width and height of a region of the 3D view; rows run downwards as in X."""
    one = region(kind)
    return [one.x, window().height - one.y - one.height, one.width, one.height]


def face_the_brightest() -> None:
    """Look from the ground at the sun that gives most light, as Cycles renders it."""
    sun = bpy.context.scene.sunsplit.lamps[0].lamp
    to_light = sun.matrix_world.col[2].xyz
    space = view().spaces.active
    eye = space.region_3d
    eye.view_perspective, eye.view_distance = "PERSP", 7.5
    eye.view_location = 0.2, 0.0, 1.3
    to_light.z = 0.02
    eye.view_rotation = (-to_light).to_track_quat("Z", "Y")
    space.shading.type = "RENDERED"


def category() -> str:
    """The sidebar's tab; empty where it has none or is closed."""
    return region("UI").active_panel_category if view().spaces.active.show_region_ui else ""


def is_converted() -> bool:
    return bpy.context.scene.sunsplit.is_converted


def hovered() -> str:
    """What the button of the sidebar under the mouse does: an operator, or a property's path.

    Blender's own "Copy Python Command" and "Copy Data Path" say it, through the clipboard.
    """
    manager = bpy.context.window_manager
    manager.clipboard = ""
    with bpy.context.temp_override(window=window(), area=view(), region=region("UI")):
        for copy in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
            if copy.poll():
                copy()
                break
    return manager.clipboard.removeprefix("bpy.ops.").partition("(")[0]


DRAWN: dict[str, float] = {}
"""Milliseconds that each of the extension's panels has taken in the last redraw."""


def redraw() -> dict[str, float]:
    """Have the sidebar drawn anew; the panels drawn since the last call, with their times.

    A panel that is folded is not drawn.
    """
    for cls in bpy.types.Panel.__subclasses__():
        if cls.__module__.startswith(MODULE) and not hasattr(cls.draw, "__wrapped__"):
            cls.draw = timed(cls.draw, cls.__name__)
    drawn = dict(DRAWN)
    DRAWN.clear()
    region("UI").tag_redraw()
    return drawn


def timed(work: Callable, name: str) -> Callable:
    @wraps(work)
    def draw(self: object, context: object) -> None:
        started = time.perf_counter()
        work(self, context)
        DRAWN[name] = 1e3 * (time.perf_counter() - started)

    return draw


CALLS: list[float] = []
"""Milliseconds of the extension's operators each time that the window has called one."""


def longest_call() -> float:
    """Of `CALLS` since the last time that this was asked; 0 if there were none."""
    for cls in bpy.types.Operator.__subclasses__():
        if cls.__module__.startswith(MODULE) and hasattr(cls, "modal"):
            for name in ("invoke", "modal"):
                if not hasattr(getattr(cls, name), "__wrapped__"):
                    setattr(cls, name, timed_call(getattr(cls, name)))
    longest = max(CALLS, default=0.0)
    CALLS.clear()
    return longest


def timed_call(work: Callable) -> Callable:
    @wraps(work)
    def call(self: object, context: object, event: object) -> set[str]:
        started = time.perf_counter()
        try:
            return work(self, context, event)
        finally:
            CALLS.append(1e3 * (time.perf_counter() - started))

    return call


# The Asset Browser


def add_library(folder: str) -> None:
    """What a user adds in the preferences, under File Paths."""
    libraries = bpy.context.preferences.filepaths.asset_libraries
    if "Skies" not in libraries:
        libraries.new(name="Skies", directory=str(FOLDER / folder))


def open_assets(on: bool = True) -> None:
    """An Asset Browser in the place of the properties, or these again."""
    old, new = ("PROPERTIES", "ASSETS") if on else ("ASSETS", "PROPERTIES")
    next(area for area in window().screen.areas if area.ui_type == old).ui_type = new


def show_assets(method: str) -> None:
    """What an Asset Browser shows, once it is open; how it imports what is dragged from it."""
    space = assets().spaces.active
    space.params.asset_library_reference = "Skies"
    space.params.import_method = method
    space.params.display_size = 96
    space.show_region_toolbar = False


def assets() -> bpy.types.Area:
    return next(area for area in window().screen.areas if area.ui_type == "ASSETS")


def place_of_assets() -> list[int]:
    """As `place`, of what the Asset Browser shows assets in."""
    inner = next(one for one in assets().regions if one.type == "WINDOW")
    return [inner.x, window().height - inner.y - inner.height, inner.width, inner.height]


def asset_at_mouse() -> str:
    """The name of the asset that is active; empty where none is."""
    area = assets()
    inner = next(one for one in area.regions if one.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=area, region=inner):
        return bpy.context.asset.name if bpy.context.asset else ""


def sky_state() -> dict[str, object]:
    """What a scene has of a sky of an asset library."""
    scene, settings = bpy.context.scene, bpy.context.scene.sunsplit
    lamps = [thing for thing in scene.objects if thing.type == "LIGHT"]
    return {
        "world": scene.world.name,
        "original": settings.original_world.name if settings.original_world else None,
        "lamps": [lamp.name for lamp in lamps],
        "known": [entry.lamp.name for entry in settings.lamps],
        "instances": [t.name for t in scene.objects if t.instance_collection],
        "editable": scene.world.is_editable and all(lamp.is_editable for lamp in lamps),
        "to_light": list(lamps[0].matrix_world.col[2].xyz) if lamps else [],
    }


# The overlay


def look_at_sun(number: int, aside: float) -> None:
    """Turn the 3D view to a lamp of the conversion, an angle in radians aside of it."""
    lamp = bpy.context.scene.sunsplit.lamps[number].lamp
    towards = Euler((0, 0, aside)).to_matrix() @ lamp.matrix_world.col[2].xyz
    space = view().spaces.active
    space.shading.type = "SOLID"
    space.region_3d.view_perspective = "PERSP"
    space.region_3d.view_rotation = (-towards).to_track_quat("Z", "Y")
    region("WINDOW").tag_redraw()


def suns_seen(kind: str = "VIEW_3D") -> list[list]:
    """Name, x and y of each sun that an editor shows and that is in sight; rows downwards."""
    area = next(area for area in window().screen.areas if area.type == kind)
    inner = next(one for one in area.regions if one.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=area, region=inner):
        pick = importlib.import_module(f"{MODULE}.addon.overlay.pick")
        suns, marks = pick.suns_on_screen(bpy.context)
    rows = window().height - 1 - inner.y
    places = marks.place[~marks.aside].round().astype(int).tolist()
    names = [lamp.name for lamp, aside in zip(suns.lamps, marks.aside, strict=True) if not aside]
    return [[name, inner.x + x, rows - y] for name, (x, y) in zip(names, places, strict=True)]


def selected() -> list[str]:
    return sorted(one.name for one in window().view_layer.objects.selected)


def show_overlay(on: bool) -> None:
    bpy.context.scene.sunsplit.show_overlay = on
    for area in window().screen.areas:
        area.tag_redraw()


def viewport_render(name: str) -> None:
    """Blender's own render of the 3D view, into the folder."""
    bpy.context.scene.render.filepath = str(FOLDER / name)
    with bpy.context.temp_override(window=window(), area=view(), region=region("WINDOW")):
        bpy.ops.render.opengl(write_still=True, view_context=True)


def overlay_times(kind: str, changed: bool, times: int) -> list[float]:
    """Milliseconds of the processor for what the overlay of an editor is to draw, so many times.

    changed: as if the view had moved since the redraw before.
    """
    view_module = importlib.import_module(f"{MODULE}.addon.overlay.view")
    image_module = importlib.import_module(f"{MODULE}.addon.overlay.image")
    area = next(area for area in window().screen.areas if area.type == kind)
    inner = next(one for one in area.regions if one.type == "WINDOW")
    of_kind = {"VIEW_3D": view_module.drawing_of, "IMAGE_EDITOR": image_module.drawings_of}
    found = []
    with bpy.context.temp_override(window=window(), area=area, region=inner):
        of_kind[kind](bpy.context)
        for _ in range(times):
            if changed:
                view_module._kept.forget()
                image_module._kept.forget()
            started = time.thread_time()
            assert of_kind[kind](bpy.context) is not None
            found.append(1e3 * (time.thread_time() - started))
    return found


def show_map(name: str) -> None:
    """An image in an Image editor, in the 3D view's place."""
    area = view()
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = bpy.data.images[name]
    inner = next(one for one in area.regions if one.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=area, region=inner):
        bpy.ops.image.view_all(fit_view=True)


def show_view() -> None:
    """The 3D view in its place again."""
    for area in window().screen.areas:
        if area.type == "IMAGE_EDITOR":
            area.type = "VIEW_3D"


main()
