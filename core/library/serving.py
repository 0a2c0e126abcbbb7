"""A worker process: a job comes in as a line of JSON, its answer leaves as one.

The other side is `processes`. What libraries print goes to stderr, never in between.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

ORPHANED = 3
"""Exit status of a worker whose master has gone in the midst of a job."""


def serve(work: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Do the jobs that come in on stdin, one at a time, until there are no more.

    When the master dies, so does this process, at once: nobody would take its answer, and what is
    half written is put right by the next one who writes there. What `work` raises is a bug: it
    ends this process with a traceback on stderr.
    """
    # Ctrl-C in a terminal reaches all its processes: the master decides what becomes of workers.
    with suppress(ValueError):  # not in the main thread
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    busy = threading.Event()
    threading.Thread(target=_listen, args=(jobs, busy), daemon=True).start()
    while (line := jobs.get()) is not None:
        answer = work(json.loads(line))
        busy.clear()
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def _listen(jobs: queue.SimpleQueue[str | None], busy: threading.Event) -> None:
    for line in sys.stdin:
        busy.set()
        jobs.put(line)
    if busy.is_set():
        os._exit(ORPHANED)
    jobs.put(None)
