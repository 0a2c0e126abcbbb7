"""The overlay in a Blender's window: seen, clicked on with the mouse, and never rendered."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image, ImageGrab

from tests.benchmarks import overlay as benchmark
from tests.gui.window import HEIGHT, WIDTH, NotSeen, Window

REGION = (255, 64, 199)
"""What region A is outlined in."""


@pytest.fixture
def suns(window: Window) -> Iterator[Window]:
    """A converted scene, seen a little aside of its brightest sun; nothing is selected."""
    window.ask("[*bpy.ops.sunsplit.convert(lights=4, skips=False)]", 120)
    window.ask("[look_at_sun(0, 0.15), remember_step('Converted')]")
    window.settle()
    yield window
    window.ask("[show_overlay(True), show_view()]")


def alone(window: Window, kind: str = "VIEW_3D") -> tuple[str, int, int]:
    """The sun that stands farthest from all others: no click there can mean another one."""
    seen = window.ask(f"suns_seen({kind!r})")
    places = np.array([place for _, *place in seen], float)
    away = np.linalg.norm(places[:, None] - places, axis=-1) + 1e9 * np.eye(len(seen))
    name, x, y = seen[int(away.min(axis=1).argmax())]
    return name, x, y


def still(window: Window) -> np.ndarray:
    """The display once it has stopped changing, the mouse in a corner."""
    window.move(WIDTH - 1, HEIGHT - 1)
    before = None
    for _ in range(30):
        window.settle()
        now = np.asarray(ImageGrab.grab(xdisplay=window.display), int)
        if before is not None and np.array_equal(now, before):
            return now
        before = now
    raise NotSeen("The display does not come to rest.")


def view_of(window: Window) -> np.ndarray:
    left, top, width, height = window.ask("place('WINDOW')")
    return still(window)[top : top + height, left : left + width]


def test_suns_are_drawn_and_switched_off(suns: Window, quiet: None):
    left, top, *_ = suns.ask("place('WINDOW')")
    pictures = []
    for on in (True, False, True):
        suns.ask(f"show_overlay({on})")
        pictures.append(view_of(suns))
    before, without, again = pictures
    for shown in (before, again):
        changed = np.abs(shown - without).max(axis=-1) > 20
        for name, x, y in suns.ask("suns_seen()"):
            around = changed[y - top - 3 : y - top + 4, x - left - 3 : x - left + 4]
            assert around.any(), name
        # Lines and words, no more.
        assert changed.mean() < 0.05


def test_renders_of_the_view_have_no_overlay(suns: Window, quiet: None):
    suns.ask("viewport_render('view.png')", 120)  # Blender's first one has other lines
    pictures = []
    for on in (True, False):
        suns.ask(f"show_overlay({on})")
        suns.settle()
        suns.ask("viewport_render('view.png')", 120)
        pictures.append(np.asarray(Image.open(suns.folder / "view.png"), int))
    assert np.array_equal(*pictures)
    assert np.ptp(pictures[0]) > 0


def test_a_click_on_a_sun_selects_its_lamp(suns: Window, quiet: None):
    name, x, y = alone(suns)
    suns.click(x, y)
    suns.wait_for(f"selected() == [{name!r}]")
    assert suns.ask("bpy.context.view_layer.objects.active.name") == name
    # Beside suns and things Blender's own selecting goes on.
    left, top, _, height = suns.ask("place('WINDOW')")
    suns.click(left + 30, top + height - 30)
    suns.wait_for("selected() == []")
    suns.key("ctrl+z")
    suns.wait_for(f"selected() == [{name!r}]")


def test_shift_adds_to_what_is_selected(suns: Window, quiet: None):
    suns.ask("bpy.data.objects['Cube'].select_set(True)")
    name, x, y = alone(suns)
    suns.move(x, y)
    suns.settle()
    suns.hold("shift")
    suns.click(x, y)
    suns.release("shift")
    suns.wait_for(f"selected() == {sorted(['Cube', name])}")


def test_switched_off_nothing_is_clicked_on(suns: Window, quiet: None):
    _, x, y = alone(suns)
    suns.ask("show_overlay(False)")
    suns.click(x, y)
    suns.settle()
    suns.settle()
    assert not any("Sun" in name for name in suns.ask("selected()"))


def test_over_the_map_suns_are_seen_and_clicked_on(suns: Window, quiet: None):
    suns.ask("show_map('sky.hdr')")
    suns.settle()
    picture = still(suns)
    assert (np.abs(picture - REGION).max(axis=-1) < 40).sum() > 20
    suns.ask("show_overlay(False)")
    without = still(suns)
    assert (np.abs(without - REGION).max(axis=-1) < 40).sum() < 5
    suns.ask("show_overlay(True)")
    suns.settle()
    name, x, y = alone(suns, "IMAGE_EDITOR")
    suns.click(x, y)
    suns.wait_for(f"selected() == [{name!r}]")


def test_benchmark(suns: Window, quiet: None):
    """A small version of the benchmark: that it measures, not how fast it is."""
    results = benchmark.measure(suns, lights=6, redraws=3)
    assert [len(one.times) for one in results] == [3] * 6
    assert all("6 suns" in one.what and min(one.times) > 0 for one in results)
