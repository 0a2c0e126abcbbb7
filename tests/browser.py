"""A real browser, Chromium, for pages that the program writes."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str | None:
    """The system's program, which `./run test` installs where it can."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


@contextmanager
def browser(*arguments: str) -> Iterator[Browser]:
    """Without a window, with more arguments; it ends with the block. Needs `chromium()`."""
    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=chromium(), args=arguments)
        try:
            yield opened
        finally:
            opened.close()
