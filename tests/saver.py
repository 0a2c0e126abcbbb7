"""Saves conversions in processes that may be killed, starved or stripped of their rights.

A saver converts once; then each order forks a process that saves. `kill_at` kills it by SIGKILL
before the event of this number: every file that is opened, locked, linked, renamed or removed and
every folder that is made or removed, as Python's audit hooks tell.
"""

from __future__ import annotations

import errno
import json
import os
import resource
import select
import signal
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent

EVENTS = {"open", "fcntl.flock", "os.link", "os.rename", "os.remove", "os.mkdir", "os.rmdir"}

VARIANTS = {
    "map": {},
    "voronoi": {"residual": "voronoi", "residual_samples": 20},
    "none": {"residual": "none"},
}


class Saver:
    """A process that saves conversions, each named "map", whenever it is asked to."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.saver"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def start(self, folder: Path, variant: str, **order: object) -> None:
        """Begin to save.

        order: preview, times (1), kill_at, no_links, user (id), file_size (most bytes).
        """
        order |= {"folder": str(folder), "variant": variant}
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()

    def answer(self) -> tuple[int, str]:
        """Its exit status, negative for the signal that killed it, and its error."""
        return tuple(json.loads(self.process.stdout.readline()))

    def save(self, folder: Path, variant: str, **order: object) -> tuple[int, str]:
        self.start(folder, variant, **order)
        return self.answer()

    def is_done(self) -> bool:
        """Whether it has an answer."""
        return bool(select.select([self.process.stdout], [], [], 0)[0])

    def close(self) -> None:
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait(30)


def main() -> None:
    # What saving imports, so that not each fork does it again. Nothing is written here: OpenEXR
    # would start threads, and forks have none.
    import OpenEXR  # noqa: F401
    import PIL.PngImagePlugin  # noqa: F401
    import scipy.ndimage  # noqa: F401

    import sunsplit.core.files.conversion  # noqa: F401
    from sunsplit.core.conversion import convert
    from sunsplit.core.settings import ConversionSettings
    from tests.files import noise, sunny
    from tests.maps import environment

    pixels = sunny(64) + noise(32)
    conversions = {
        name: convert(environment(n * pixels, "map"), ConversionSettings(**settings))
        for n, (name, settings) in enumerate(VARIANTS.items(), start=1)
    }
    for line in sys.stdin:
        order = json.loads(line)
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            _obey(order, conversions[order["variant"]], write)
        os.close(write)
        with os.fdopen(read) as said:
            error = said.read()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        print(json.dumps([status, error]), flush=True)


def _obey(order: dict, conversion: object, write: int) -> None:
    from sunsplit.core.files.conversion import save

    status = 0
    try:
        if size := order.get("file_size"):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        if user := order.get("user"):
            os.setuid(user)
        if order.get("no_links"):
            sys.addaudithook(_refuse_links)
        if (event := order.get("kill_at")) is not None:
            _kill_at(event, order["folder"])
        for _ in range(order.get("times", 1)):
            save(conversion, order["folder"], order.get("preview", False))
    except BaseException as error:
        status = 1
        os.write(write, f"{type(error).__name__}: {error}".encode())
    os._exit(status)


def _refuse_links(event: str, arguments: tuple) -> None:
    """As FAT does, and some network drives."""
    if event == "os.link":
        raise PermissionError(errno.EPERM, "Operation not permitted")


def _kill_at(number: int, folder: str) -> None:
    left = number

    def hook(event: str, arguments: tuple) -> None:
        nonlocal left
        if event == "fcntl.flock" or (event in EVENTS and str(arguments[0]).startswith(folder)):
            left -= 1
            if left < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


if __name__ == "__main__":
    main()
