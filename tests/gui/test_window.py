"""Sunsplit in a Blender's window, used with mouse and keyboard."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.benchmarks import window as benchmark
from tests.benchmarks.large_maps import Kind, make
from tests.gui.conftest import complaints
from tests.gui.window import Window

CONVERTED, RESTORED = "is_converted()", "not is_converted()"


@pytest.fixture
def before(window: Window) -> dict:
    """The scene before anything is pressed."""
    return window.ask("state()")


@pytest.fixture
def converted(window: Window, before: dict) -> dict:
    """The scene after a click on the button."""
    window.press("sunsplit.convert")
    window.wait_for(CONVERTED)
    return window.ask("state()")


# Install and enable


def test_installed_zip_shows_its_tab(window: Window, quiet: None):
    assert all(window.ask("present()").values())
    assert window.ask("category()") == "Sunsplit"
    assert window.find("sunsplit.convert")


def test_blender_of_debian_finds_the_zip_valid(opened: Window):
    (package,) = opened.folder.glob("*.zip")
    path = opened.debian.inside(package)
    said = opened.debian.ask("blender", "--command", "extension", "validate", path)
    assert "Success" in said


def test_disabled_it_is_gone_and_enabled_back_again(window: Window, quiet: None):
    window.ask("enable(False)")
    window.settle()
    assert not any(window.ask("present()").values())
    window.ask("enable()", 120)
    window.open_tab()
    assert all(window.ask("present()").values())
    assert window.find("sunsplit.convert")


@pytest.mark.parametrize(
    "action",
    ["bpy.ops.script.reload()", "bpy.ops.wm.read_homefile(use_splash=False, load_ui=False)"],
    ids=["reload scripts", "new file"],
)
def test_reload_and_new_file_keep_it(window: Window, converted: dict, action: str, quiet: None):
    window.ask(f"[*{action}]", 120)
    window.settle()
    assert all(window.ask("present()").values())
    window.open_tab()
    assert window.find("sunsplit.convert")


def test_blender_starts_and_ends_with_it_in_silence(opened: Window):
    """At the end Blender unregisters what is enabled."""
    here = opened.debian.inside(opened.folder)
    module = "bl_ext.user_default.sunsplit"
    code = f"import sys; print('loaded', {module!r} in sys.modules)"
    options = ("--background", "--python-exit-code", "1", "--addons", module)
    said = opened.debian.ask("blender", *options, "--python-expr", code, home=here)
    assert "loaded True" in said
    assert not complaints(said)


# The button


def test_click_converts_the_world(window: Window, before: dict, converted: dict, quiet: None):
    assert not before["lamps"]
    assert converted["lamps"]
    assert converted["world"] != before["world"]
    headline = converted["report"].splitlines()[0]
    assert headline.startswith(f"{len(converted['lamps'])} lamp")
    assert headline in window.ask("reports()")


def test_in_motion_other_frames_are_looked_at_and_the_window_stays_at_its_own(
    window: Window, quiet: None
):
    window.ask("animate()")
    window.settle()
    before = window.ask("animated()")
    assert before == [30, 0.25, 0, 3, 1]
    assert window.ask("look()")[1:] == [1, 100]
    window.settle()
    assert window.ask("animated()") == before
    window.press("sunsplit.convert")
    window.wait_for(CONVERTED)
    assert "frames of 1 to 100" in window.ask("state()")["report"]
    window.settle()
    assert window.ask("animated()")[::4] == [30, 1]
    window.key("ctrl+z")
    window.wait_for(RESTORED)
    assert window.ask("animated()")[::4] == [30, 1]


def test_one_undo_takes_it_back_and_redo_brings_it(
    window: Window, before: dict, converted: dict, quiet: None
):
    window.key("ctrl+z")
    window.wait_for(RESTORED)
    assert window.ask("state()") == before
    window.key("ctrl+shift+z")
    window.wait_for(CONVERTED)
    assert window.ask("state()") == converted
    # What has been redone is as good as new.
    window.press("sunsplit.restore")
    window.wait_for(RESTORED)
    assert window.ask("state()") == before


def test_restore_and_its_undo(window: Window, before: dict, converted: dict, quiet: None):
    window.press("sunsplit.restore")
    window.wait_for(RESTORED)
    assert window.ask("state()") == before
    window.key("ctrl+z")
    window.wait_for(CONVERTED)
    assert window.ask("state()") == converted


def test_restore_after_saving_and_opening(
    window: Window, before: dict, converted: dict, quiet: None
):
    window.ask("save_scene('converted.blend')")
    window.ask("open_scene('converted.blend')")
    assert window.ask("state()") == converted
    window.press("sunsplit.restore")
    window.wait_for(RESTORED)
    assert window.ask("state()") == before


def test_a_world_without_a_map_is_refused_in_a_sentence(window: Window):
    window.ask("[bpy.data.images.remove(bpy.data.images['sky.hdr']), remember_step('No map')]")
    before, said = window.ask("state()"), len(window.ask("reports()"))
    window.press("sunsplit.convert")
    # Between the sentences are the operators that were called.
    (sentence,) = window.wait_for(f"[x for x in reports()[{said}:] if not x.startswith('bpy.')]")
    assert "has no image" in sentence
    assert "Traceback" not in window.console()
    assert window.ask("state()") == before


def test_without_a_world_the_button_is_grey(window: Window):
    window.ask("[setattr(bpy.context.scene, 'world', None), remember_step('No world')]")
    before = window.ask("state()")
    assert not window.ask("bpy.ops.sunsplit.convert.poll()")
    window.press("sunsplit.convert")
    window.settle()
    assert window.ask("state()") == before


def test_a_setting_is_changed_with_the_mouse(window: Window, quiet: None):
    window.unfold("SUNSPLIT_PT_settings")
    window.press("sunsplit.skips")
    window.wait_for("not bpy.context.scene.sunsplit.skips")


# Export

BROWSER = "len(bpy.context.window_manager.windows) == 2"


def test_export_through_the_file_browser(
    window: Window, before: dict, converted: dict, quiet: None
):
    """Return exports; Escape does not; and it is no step to undo."""
    window.ask("setattr(bpy.context.scene.sunsplit.export, 'format', 'pbrt')")
    window.unfold("SUNSPLIT_PT_export")
    written = [window.folder / f"sky.{end}" for end in ("lights.pbrt", "scene.pbrt", "pbrt.exr")]
    for key in ("Escape", "Return"):
        window.press("sunsplit.export")
        window.wait_for(BROWSER)
        window.key(key)
        window.wait_for(f"not {BROWSER}")
        assert [path.is_file() for path in written] == [key == "Return"] * 3
    assert window.ask("state()") == converted
    said = [line for line in window.ask("reports()") if line.startswith("3 files written to ")]
    assert said == [f"3 files written to {window.debian.inside(window.folder)}"]
    window.key("ctrl+z")
    window.wait_for(RESTORED)
    assert window.ask("state()") == before
    for path in written:
        path.unlink()


# Long work


@pytest.fixture(scope="session")
def wide(sunrise: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map that takes seconds to convert."""
    path = tmp_path_factory.mktemp("wide") / "wide.exr"
    make(sunrise, 4096, Kind("exr", "half", "zip"), path, grain=0)
    return path


@pytest.fixture
def started(window: Window, wide: Path) -> dict:
    """The scene under the wide map, as it was before the click; the conversion goes on."""
    shutil.copy2(wide, window.folder)
    window.ask("[light_by('wide.exr'), forget(), remember_step('Wide map')]")
    before = window.ask("state()")
    window.press("sunsplit.convert")
    window.wait_for("'SUNSPLIT_OT_convert' in running()")
    return before


def test_escape_leaves_the_scene_as_it_was(window: Window, started: dict, quiet: None):
    window.key("Escape")
    window.wait_for("not running()")
    assert window.ask("state()") == started
    window.press("sunsplit.convert")
    window.wait_for(CONVERTED, 120)
    window.key("ctrl+z")
    window.wait_for(RESTORED)
    assert window.ask("state()") == started


def test_window_is_alive_while_it_converts(window: Window, started: dict, quiet: None):
    """Nothing of the scene changes until all is there; the picture does: it shows progress."""
    first = window.picture()
    assert window.ask("running()") == ["SUNSPLIT_OT_convert"]
    assert window.ask("state()") == started
    while window.ask("running()") and window.picture() == first:
        pass
    assert window.picture() != first
    window.wait_for(f"{CONVERTED} and not running()", 120)
    assert window.ask("state()")["lamps"]


# What it costs


def test_benchmark(window: Window, sunrise: Path, quiet: None):
    """A small version of the benchmark: that it measures, not how fast it is."""
    results = benchmark.measure(window, [sunrise], redraws=3, repeats=1)
    assert all(min(one.times) > 0 for one in results)
    assert len(results[0].times) == 3
    lines = benchmark.table(results, "5.2").splitlines()
    assert sum(line.startswith("| ") for line in lines) == 2 + len(results)
