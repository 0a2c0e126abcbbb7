"""A worker of `core.library.local` that dies, hoards or prints, as it is told."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

sys.stdin.readline()  # the greeting
sys.path.insert(0, str(Path(__file__).parent.parent))

from sunsplit.core.library.serving import serve  # noqa: E402


def work(job: dict) -> dict:
    if "kill" in job:
        os.kill(os.getpid(), signal.SIGKILL)
    if "first" in job and not Path(job["first"]).exists():
        Path(job["first"]).touch()
        os._exit(7)
    held = []
    for _ in range(job.get("hold", 0)):
        held.append(np.ones(1 << 17))  # one megabyte, in steps that can be seen coming
        time.sleep(0.005)
    time.sleep(job.get("sleep", 0))
    if "print" in job:
        print("a library prints")
        os.write(1, b"and another one\n")
    if "raise" in job:
        raise RuntimeError(job["raise"])
    return job | {"pid": os.getpid(), "began": time.monotonic()}


serve(work)
