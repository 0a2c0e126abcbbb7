"""The master's side of worker processes: see `serving` for the other one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import psutil

from ..cores import LIMIT
from ..errors import SunsplitError

Answer = dict[str, Any]

MOST_REPEATED = 4096
"""Bytes of what a process has said last."""

ONE_CORE = {
    name: "1" for name in (LIMIT, "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
}
"""Each worker has a core of its own: threads of many workers would wait for one another."""


def converter() -> list[str]:
    """The command of a process that converts maps."""
    # Isolated: with nothing but what it is told to import from, as its master does.
    return [sys.executable, "-I", str(Path(__file__).with_name("worker.py"))]


class NoWorker(SunsplitError):
    """The system does not start a process."""


class Worker:
    """A process that does one job at a time. Raises NoWorker.

    on_answer: called from a thread with this worker and an answer, or None when the process has
    ended, however it came to that. chatters: what it prints is no business of the user's, unless
    it ends by itself with an error.
    """

    def __init__(
        self,
        command: Sequence[str],
        on_answer: Callable[[Worker, Answer | None], None],
        chatters: bool = False,
    ) -> None:
        self._on_answer = on_answer
        self._chatter = tempfile.TemporaryFile() if chatters else None  # noqa: SIM115, see _listen
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._chatter,
                env=os.environ | ONE_CORE,
                encoding="utf-8",
                errors="replace",
            )
        except OSError as error:
            raise NoWorker(f"No worker can be started: {error.strerror or error}.") from error
        self._seen = psutil.Process(self._process.pid)
        self._send({"path": sys.path})
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def start(self, job: dict[str, Any]) -> None:
        """Give it a job. If it has died, that is the answer."""
        self._send(job)

    def memory(self) -> int:
        """Bytes that it holds now; 0 once it has ended."""
        try:
            return self._seen.memory_info().rss
        except psutil.Error:
            return 0

    def kill(self) -> None:
        """End it at once, whatever it does."""
        self._process.kill()
        self._process.wait()
        self._listener.join()

    def ending(self) -> str:
        """How it has ended, in words."""
        status = self._process.wait()
        return f"signal {-status}" if status < 0 else f"exit status {status}"

    def _send(self, what: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        # Where it has ended, and its pipes are closed, `_listen` says so.
        with suppress(BrokenPipeError, ValueError):
            self._process.stdin.write(json.dumps(what) + "\n")
            self._process.stdin.flush()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        assert self._process.stdin is not None
        with self._process.stdout as answers:
            for line in answers:
                if line.startswith("{"):  # Blender may speak before any script of ours does
                    self._on_answer(self, json.loads(line))
        status = self._process.wait()
        with suppress(BrokenPipeError):  # what it was told and has not read
            self._process.stdin.close()
        if self._chatter:
            with self._chatter as said:
                self._repeat(said, status)
        self._on_answer(self, None)

    def _repeat(self, said: IO[bytes], status: int) -> None:
        """A traceback is for whoever can mend what it says."""
        if status > 0 and sys.stderr:
            size = said.seek(0, os.SEEK_END)
            said.seek(max(size - MOST_REPEATED, 0))
            sys.stderr.write(said.read().decode(errors="replace"))
            sys.stderr.flush()
