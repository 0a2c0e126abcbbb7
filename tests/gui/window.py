"""A Blender in its window, seen from outside: a mouse, a keyboard, pictures of its display.

    with open_window(debian(), sky) as window:
        window.install(package)
        window.ask("new_scene()")
        window.open_tab()
        window.press("sunsplit.convert")
        window.wait_for("is_converted()")
        window.key("ctrl+z")

`ask` evaluates an expression inside (see inside.py); `press` finds a button by what it does,
wherever the layout has put it, and clicks it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

from PIL import Image, ImageChops, ImageGrab

from tests.gui.debian import Debian

WIDTH, HEIGHT = 1280, 900

INSIDE = Path(__file__).parent / "inside.py"

STEP = 15
"""Pixels from one try to the next where a button is looked for: a button is 20 high."""


DRAGS = 10
"""Movements of a drag."""

WITH_US = ("setpriv", "--pdeathsig", "KILL")
"""A program behind these words ends when the tests end, even when they are killed."""

FOLDING = 0.3
"""Seconds that a panel takes to fold."""

TABS, MARGIN = 28, 8
"""Pixels: width of the tabs at the sidebar's right side; what is left below the last panel."""


class NotSeen(AssertionError):
    """What should have happened in the window and has not, with what Blender printed."""


@dataclass(frozen=True)
class Window:
    """A running Blender. folder: what it and the tests share, as the tests see it."""

    debian: Debian
    folder: Path
    display: str
    process: subprocess.Popen
    found: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Where buttons were found last: looked at first."""

    # Inside

    def ask(self, expression: str, seconds: float = 60) -> Any:
        """The value of an expression inside. It comes as soon as Blender is not busy."""
        part = self.folder / "ask.part"
        part.write_text(json.dumps(expression), encoding="utf-8")
        part.rename(self.folder / "ask.json")
        answer = self.folder / "answer.json"
        self._wait(answer.exists, f"answer to {expression}", seconds)
        found = json.loads(answer.read_text(encoding="utf-8"))
        answer.unlink()
        if "error" in found:
            raise NotSeen(f"{expression}\n{found['error']}")
        return found["value"]

    def wait_for(self, expression: str, seconds: float = 60) -> Any:
        """The value of an expression inside once it is true."""
        found: list[Any] = []

        def true() -> bool:
            found[:] = [self.ask(expression, seconds)]
            return bool(found[0])

        self._wait(true, expression, seconds)
        return found[0]

    def _wait(self, condition: Callable[[], bool], what: str, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not condition():
            if self.process.poll() is not None:
                raise NotSeen(f"Blender ended ({self.process.returncode}):\n{self.console()}")
            if time.monotonic() > end:
                raise NotSeen(f"No {what} within {seconds} s:\n{self.console()}")
            time.sleep(0.005)

    def console(self) -> str:
        """All that Blender has printed."""
        return (self.folder / "console").read_text(encoding="utf-8", errors="replace")

    def heartbeats(self) -> list[float]:
        """When Blender's timer ran, in seconds of `time.monotonic`."""
        lines = (self.folder / "heartbeat").read_text(encoding="ascii").split("\n")
        return [float(line) for line in lines[:-1]]  # the last one may be half written

    def longest_gap(self, start: float, end: float) -> float:
        """Seconds, at most, between two heartbeats in a span of `time.monotonic`."""
        beats = self.heartbeats()
        pairs = [(a, b) for a, b in pairwise(beats) if b > start and a < end]
        return max(b - a for a, b in pairs)

    def install(self, package: Path) -> list[str]:
        """Install a zip in the running Blender."""
        shutil.copy2(package, self.folder / package.name)
        return self.ask(f"install({package.name!r})", 120)

    # Mouse and keyboard

    def move(self, x: int, y: int) -> None:
        self._do("mousemove", x, y)

    def click(self, x: int, y: int) -> None:
        self.move(x, y)
        self.settle()
        self._do("click", 1)

    def hold(self, key: str) -> None:
        self._do("keydown", key)
        self.settle()

    def release(self, key: str) -> None:
        self._do("keyup", key)

    def key(self, name: str) -> None:
        """Press a key over the 3D view, as `ctrl+z` or `Escape`."""
        left, top, width, height = self.ask("place('WINDOW')")
        self.move(left + width // 2, top + height // 2)
        self.settle()
        self._do("key", name)

    def drag(self, button: int, across: int, down: int) -> None:
        """Drag with a button of the mouse held, from where it is; a little way at a time."""
        self._do("mousedown", button)
        for _ in range(DRAGS):
            self._do("mousemove_relative", "--", across // DRAGS, down // DRAGS)
            self.settle()
        self._do("mouseup", button)

    def carry(self, start: tuple[int, int], end: tuple[int, int]) -> None:
        """Drag a thing with the mouse from one place to another, and drop it there."""
        self.move(*start)
        self.settle()
        self._do("mousedown", 1)
        self.settle()
        for _ in range(DRAGS):  # away from where it was pressed, for Blender to take it for a drag
            self._do("mousemove_relative", "--", -4, 2)
            self.settle()
        x, y = start[0] - 4 * DRAGS, start[1] + 2 * DRAGS
        for n in range(1, DRAGS + 1):
            self.move(x + (end[0] - x) * n // DRAGS, y + (end[1] - y) * n // DRAGS)
            self.settle()
        self._do("mouseup", 1)
        self.settle()

    def quit(self) -> None:
        """Close Blender as a user does; it must end well."""
        self.key("ctrl+q")
        if status := self.process.wait(60):
            raise NotSeen(f"Blender ended with status {status}:\n{self.console()}")

    def settle(self) -> None:
        """Wait until Blender has handled what the mouse did, and drawn."""
        for _ in range(2):  # a tick may be under way
            self.ask("None")

    def _do(self, *words: object) -> None:
        command = ["xdotool", *map(str, words)]
        subprocess.run(command, check=True, env=os.environ | {"DISPLAY": self.display}, timeout=60)

    # The sidebar

    def open_tab(self, name: str = "Sunsplit") -> None:
        """Open the sidebar by N, and turn its tabs by the wheel until the right one is there."""
        if not self.ask("view().spaces.active.show_region_ui"):
            self.key("n")
            self.wait_for("view().spaces.active.show_region_ui and region('UI').width > 100")
        left, top, width, height = self.ask("place('UI')")
        self.move(left + width // 2, top + height // 2)
        self.settle()
        seen: list[str] = []
        while (tab := self.ask("category()")) != name:
            if seen.count(tab) > 2:
                raise NotSeen(f"no tab {name} among {sorted(set(seen))}")
            seen.append(tab)
            self._do("keydown", "ctrl", "click", 5, "keyup", "ctrl")
            self.settle()
            self.settle()

    def find(self, name: str) -> tuple[int, int]:
        """Where the sidebar has the button of an operator or property, as `sunsplit.convert`."""
        known = [self.found[name]] if name in self.found else []
        for x, y in chain(known, self._rows()):
            self.move(x, y)
            self.settle()
            if self.ask("hovered()") == name:
                self.settle()  # the mouse may have been seen at the row before
                if self.ask("hovered()") == name:
                    self.found[name] = x, y
                    return x, y
        raise NotSeen(f"No button {name} in the sidebar.")

    def unfold(self, panel: str) -> None:
        """Click on the header of a folded panel, as `SUNSPLIT_PT_settings`, where it is in sight.

        A header is found by what a click does; a click on another one is taken back.
        """
        before = self._drawn()
        if panel in before:
            return
        for x, y in self._rows():
            self.move(x, y)
            self.settle()
            if self.ask("hovered()"):
                continue
            seen = self._sidebar()
            self._do("click", 1)
            self.settle()
            if self._sidebar() == seen:  # no header
                continue
            after = self._drawn()
            if panel in after:
                return
            if after != before:
                self._do("click", 1)
                before = self._drawn()
        raise NotSeen(f"No header of {panel} in the sidebar.")

    def _rows(self) -> Iterator[tuple[int, int]]:
        """Points down the sidebar, where buttons are that are half as wide as it or wider.

        First those in sight, then all there are: the sidebar is turned by the wheel.
        """
        left, top, width, height = self.ask("place('UI')")
        x = left + round(0.6 * (width - TABS))
        rows = [(x, y) for y in range(top + STEP, top + height, STEP)]
        yield from rows
        middle = (x, top + height // 2)
        seen, turned = None, self._turned(middle, up=True)
        while seen != turned:
            yield from rows
            seen, turned = turned, self._turned(middle, up=False)

    def _turned(self, middle: tuple[int, int], up: bool) -> Image.Image:
        """Turn the sidebar to its top, or a little down; what is seen then."""
        self.move(*middle)
        self.settle()
        self._do("click", "--repeat", 50 if up else 5, "--delay", 10, 4 if up else 5)
        self.settle()
        return self._sidebar()

    def _drawn(self) -> set[str]:
        """The panels that are not folded."""
        time.sleep(FOLDING)
        self.ask("redraw()")
        return set(self.ask("redraw()"))  # between two ticks, Blender draws what it has to

    def press(self, name: str) -> None:
        """Click the button of an operator."""
        self._do("mousemove", *self.find(name), "click", 1)

    # Pictures

    def picture(self) -> Image.Image:
        """The display with the mouse out of the way."""
        left, top, _, height = self.ask("place('WINDOW')")
        self.move(left + 100, top + height - 20)
        self.settle()
        self.settle()
        return ImageGrab.grab(xdisplay=self.display)

    def panel_picture(self) -> Image.Image:
        """The sidebar without its tabs, as far down as there is something in it."""
        self.picture()
        sidebar = self._sidebar()
        width, height = sidebar.size
        empty = Image.new("RGB", sidebar.size, sidebar.getpixel((width // 2, height - 3)))
        box = ImageChops.difference(sidebar, empty).getbbox()
        if box is None:
            raise NotSeen("The sidebar is empty.")
        return sidebar.crop((0, 0, width, min(box[3] + MARGIN, height)))

    def _sidebar(self) -> Image.Image:
        """What the sidebar shows, but its tabs."""
        left, top, width, height = self.ask("place('UI')")
        box = (left, top, left + width - TABS, top + height)
        return ImageGrab.grab(box, xdisplay=self.display).convert("RGB")


@contextmanager
def open_window(debian: Debian, sky: Path) -> Iterator[Window]:
    """A Blender in a display of its own, with a map at hand; it ends with the block."""
    with ExitStack() as stack:
        folder = stack.enter_context(debian.shared_folder())
        shutil.copy2(sky, folder / "sky.hdr")
        shutil.copy2(INSIDE, folder / INSIDE.name)
        display = stack.enter_context(_display())
        here = debian.inside(folder)
        command = ["blender", "--window-geometry", "0", "0", str(WIDTH), str(HEIGHT)]
        command += ["--python-exit-code", "1", "--python", f"{here}/{INSIDE.name}", "--", here]
        with (folder / "console").open("w") as console:
            process = subprocess.Popen(
                [*WITH_US, *debian.command(*command)],
                env=debian.environment(here) | {"DISPLAY": display},
                stdout=console,
                stderr=console,
            )
        stack.callback(_end, process)
        window = Window(debian, folder, display, process)
        window.ask("None")
        yield window


@contextmanager
def _display() -> Iterator[str]:
    """An X display of a number that nobody else has."""
    read, write = os.pipe()
    screen = ["-screen", "0", f"{WIDTH}x{HEIGHT}x24"]
    process = subprocess.Popen(
        [*WITH_US, "Xvfb", "-displayfd", str(write), *screen, "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        with os.fdopen(read) as file:
            number = file.readline().strip()
        if not number:
            raise NotSeen("Xvfb did not start.")
        yield f":{number}"
    finally:
        _end(process)


def _end(process: subprocess.Popen) -> None:
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
