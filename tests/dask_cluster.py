"""A Dask cluster on this machine: a scheduler and workers in processes of their own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import psutil

PATIENCE = 40.0
"""Seconds for what takes one or two on an idle machine."""


class Cluster:
    """Processes that end with it. folder: for their logs and scratch files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: list[Process] = []
        self._workers: list[Process] = []
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.kill()

    def scheduler(self) -> Process:
        """A new one at the same address. It answers when this returns."""
        process = self._started(
            ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port)]
        )
        process.wait_for("Scheduler at")
        return process

    def worker(
        self,
        *options: str,
        threads: int = 1,
        nanny: bool = False,
        before: Sequence[str] = (),
        **environment: str,
    ) -> Process:
        """The scheduler knows it when this returns. before: commands of a shell with file systems
        of its own."""
        arguments = ["distributed.cli.dask_worker", self.address, "--nthreads", str(threads)]
        arguments += ["--nanny" if nanny else "--no-nanny", "--local-directory", str(self._folder)]
        process = self._started([*arguments, *options], before, environment)
        self._workers.append(process)
        process.wait_for("Registered to")
        return process

    def dismiss_workers(self) -> None:
        """Kill them all. When this returns, the one scheduler that has been started knows it."""
        for worker in self._workers:
            worker.kill()
        scheduler = self._processes[0]
        wait(lambda: scheduler.said().count("Remove worker") >= len(self._workers))

    def _started(
        self,
        arguments: Sequence[str],
        before: Sequence[str] = (),
        environment: dict[str, str] | None = None,
    ) -> Process:
        command = [sys.executable, "-m", *arguments, "--no-dashboard"]
        if before:
            script = " && ".join([*before, 'exec "$@"'])
            command = ["unshare", "--mount", "sh", "-c", script, "sh", *command]
        log = self._folder / f"{len(self._processes)}.log"
        process = Process(command, log, os.environ | (environment or {}))
        self._processes.append(process)
        return process


class Process:
    """One of a cluster's, with what it starts."""

    def __init__(self, command: Sequence[str], log: Path, environment: dict[str, str]) -> None:
        self._log = log
        with log.open("wb") as file:
            self._process = subprocess.Popen(
                command, stdout=file, stderr=file, env=environment, start_new_session=True
            )
        self.pid = self._process.pid

    def said(self) -> str:
        return self._log.read_text(errors="replace")

    def wait_for(self, text: str) -> None:
        """Until it has said that."""
        wait(lambda: text in self.said() or self._process.poll() is not None)
        assert text in self.said(), self.said()

    def stop(self) -> None:
        """It stands still, until it goes on."""
        os.kill(self.pid, signal.SIGSTOP)

    def go_on(self) -> None:
        os.kill(self.pid, signal.SIGCONT)

    def kill(self) -> None:
        """With all that it has started. It may have ended before."""
        if self._process.poll() is None:
            os.killpg(self.pid, signal.SIGKILL)
            self._process.wait()

    def child(self) -> psutil.Process:
        """The worker of a nanny: Python's resource tracker is not it."""
        children = psutil.Process(self.pid).children(recursive=True)
        return next(c for c in children if "spawn_main" in " ".join(c.cmdline()))

    def sees(self, path: Path) -> Path:
        """What this process has at a path, for others to look at."""
        return Path(f"/proc/{self.pid}/root{path}")


def wait(until: Callable[[], object], seconds: float = PATIENCE, pause: float = 0.02) -> None:
    """Until something holds; an AssertionError when it does not for too long."""
    end = time.monotonic() + seconds
    while not until():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(pause)
