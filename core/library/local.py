"""Maps converted by processes of this machine, as many at once as fit into its memory."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import psutil

from .processes import Answer, Worker

LOOK = 0.05
"""Seconds between two looks at the memory that is in use."""

SPARE = 0.95
"""Of the limit: what is in use must not exceed it between two looks."""

DEATHS = 2
"""So often a worker may die over a job until that is given up: once may be bad luck."""


@dataclass
class Task:
    """A job for a worker. memory: bytes that it takes at most, by what is known before."""

    job: dict[str, Any]
    memory: int
    deaths: int = 0
    alone: bool = False


@dataclass(frozen=True)
class Done:
    """A task and its answer; or, where no worker lived to give it, why not."""

    task: Task
    answer: Answer | None
    sentence: str = ""


class LocalWorkers:
    """Processes that do tasks. To be closed, which ends them at once.

    memory: bytes that they and this process may hold together. chatter: they print what is of no
    interest, see `Worker`.
    """

    def __init__(
        self, command: Sequence[str], count: int, memory: int, chatter: bool = False
    ) -> None:
        self._command, self._count, self._memory = command, count, memory
        self._chatter = chatter
        self._events: queue.SimpleQueue[tuple[Worker, Answer | None]] = queue.SimpleQueue()
        self._busy: dict[Worker, Task] = {}
        self._idle: list[Worker] = []
        self._killed: set[Worker] = set()
        self._looked = 0.0

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in (*self._idle, *self._busy):
            worker.kill()

    def run(self, tasks: Sequence[Task]) -> Iterator[Done | None]:
        """What comes of the tasks, as it comes, and None now and then while none does. The first
        ones are begun first, unless they do not fit beside what is being done."""
        waiting = list(tasks)
        while waiting or self._busy:
            self._hand_out(waiting)
            self._watch()
            try:
                worker, answer = self._events.get(timeout=LOOK)
            except queue.Empty:
                yield None
                continue
            done = self._settled(worker, answer, waiting)
            if done:
                yield done

    def _settled(self, worker: Worker, answer: Answer | None, waiting: list[Task]) -> Done | None:
        task = self._busy.pop(worker, None)
        if task is None:
            if worker in self._idle:  # it has ended with nothing to do
                self._idle.remove(worker)
            return None
        if answer is not None:
            self._idle.append(worker)
            return Done(task, answer)
        return self._after_death(worker, task, waiting)

    def _after_death(self, worker: Worker, task: Task, waiting: list[Task]) -> Done | None:
        task.deaths += 1
        for_memory = worker in self._killed
        self._killed.discard(worker)
        if task.deaths < DEATHS and not (for_memory and task.alone):
            # For memory or not: what dies with others may live by itself.
            task.alone = True
            waiting.append(task)
            return None
        if for_memory:
            sentence = "It needs more memory than there is: allow more by --memory."
        else:
            sentence = f"The worker died over it ({worker.ending()})."
        return Done(task, None, sentence)

    def _hand_out(self, waiting: list[Task]) -> None:
        while waiting and len(self._busy) < self._count:
            chosen = next((task for task in waiting if self._fits(task)), None)
            if chosen is None:
                return
            waiting.remove(chosen)
            worker = self._idle.pop() if self._idle else self._new_worker()
            self._busy[worker] = chosen
            worker.start(chosen.job)

    def _new_worker(self) -> Worker:
        return Worker(self._command, self._heard, self._chatter)

    def _heard(self, worker: Worker, answer: Answer | None) -> None:
        self._events.put((worker, answer))

    def _fits(self, task: Task) -> bool:
        if not self._busy:
            self._free_memory(task)
            return True  # if not by itself, then not at all
        if task.alone or any(other.alone for other in self._busy.values()):
            return False
        used = sum(max(worker.memory(), other.memory) for worker, other in self._busy.items())
        idle = sum(worker.memory() for worker in self._idle[:-1])
        return own_memory() + used + idle + task.memory <= SPARE * self._memory

    def _free_memory(self, task: Task) -> None:
        """Workers keep memory that they have used: let them go where that would be missing."""
        held = own_memory() + sum(worker.memory() for worker in self._idle)
        if held + task.memory > SPARE * self._memory:
            for worker in self._idle:
                worker.kill()
            self._idle.clear()

    def _watch(self) -> None:
        """Stop the task that was begun last where more memory is in use than was foreseen."""
        if time.monotonic() < self._looked + LOOK:
            return
        self._looked = time.monotonic()
        held = own_memory() + sum(worker.memory() for worker in (*self._idle, *self._busy))
        if held <= SPARE * self._memory:
            return
        if self._idle:
            self._idle.pop().kill()
        elif self._busy:
            latest = list(self._busy)[-1]
            self._killed.add(latest)
            latest.kill()


def own_memory() -> int:
    """Bytes that this process holds."""
    return psutil.Process().memory_info().rss
