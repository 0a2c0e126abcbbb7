"""`sunsplit library` in processes of its own, killed at random moments."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import psutil

from tests.files import COMMAND

ARGUMENTS = ("--workers", "2", "--preview")


def start(library: Path, out: Path, *more: str) -> subprocess.Popen[bytes]:
    """Begin to convert a library, in a session of its own."""
    return subprocess.Popen(
        [*COMMAND, "library", os.fspath(library), "-o", os.fspath(out), *ARGUMENTS, *more],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def undisturbed(library: Path, out: Path) -> float:
    """Convert a library; the seconds that it takes."""
    began = time.perf_counter()
    status = start(library, out).wait(600)
    if status:
        raise AssertionError(f"sunsplit library ended with {status}")
    return time.perf_counter() - began


def killed(library: Path, out: Path, seconds: float, master_only: bool) -> bool:
    """Convert a library and kill that after so many seconds, by SIGKILL: all of its processes, or
    the one that the user has started, which the others then outlive by a moment. Whether it had
    not ended before."""
    process = start(library, out)
    time.sleep(seconds)
    family = psutil.Process(process.pid).children(recursive=True)
    if master_only:
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL)
    status = process.wait(60)
    _, alive = psutil.wait_procs(family, timeout=10)
    if alive:
        raise AssertionError(f"workers have outlived their master: {alive}")
    return status == -signal.SIGKILL


def kills(
    library: Path, folder: Path, seconds: float, count: int, seed: int
) -> Iterator[tuple[Path, float, bool]]:
    """Runs that were killed at random moments of `seconds` and then done to the end: where each
    has written, when it was killed, and whether it really was."""
    lots = random.Random(seed)
    for number in range(count):
        out, moment = folder / f"out {number}", lots.uniform(0.2, seconds)
        hit = killed(library, out, moment, master_only=number % 2 == 1)
        undisturbed(library, out)
        yield out, moment, hit
