"""Steps beside a living window: a little in each tick of a timer, the rest in a thread."""

from __future__ import annotations

import os
import queue
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import bpy

from .steps import Apart, Steps

AT_A_TIME = 0.015
"""Seconds of a tick that steps may take before the window has its turn."""

TICK = 0.01
"""Seconds between ticks."""

NICENESS = 10
"""Of a thread and those that it starts: a window that wants to be drawn has ten times its share of
the cores. No more than that, as libraries may keep threads that they start meanwhile."""

HANDLERS = ("undo_pre", "redo_pre", "load_pre")
"""What takes the data away that steps hold on to."""


class Cancelled(Exception):
    """The user does not want the result any more."""


class Job:
    """Steps on their way.

    stage, fraction: what is being done, and how much of it all is done. result: of the steps;
    error: what they, or their thread, have raised. There is one job at a time: `running`.
    """

    running: Job | None = None
    _left_behind: threading.Thread | None = None

    def __init__(self, steps: Steps) -> None:
        self.stage, self.fraction = "", 0.0
        self.result: Any = None
        self.error: BaseException | None = None
        self._steps = steps
        self._asked: queue.SimpleQueue[tuple[Steps, Future]] = queue.SimpleQueue()
        self._cancelled = threading.Event()
        self._thread: threading.Thread | None = None
        self._answer: Future | None = None
        Job.running = self
        for name in HANDLERS:
            getattr(bpy.app.handlers, name).append(self._on_data_going)

    def advance(self) -> bool:
        """Go on for a moment; whether that was the last one."""
        if not self._is_at_work():
            return True
        if Job._left_behind is not None and Job._left_behind.is_alive():
            return False
        until = time.perf_counter() + AT_A_TIME
        while self._is_at_work() and time.perf_counter() < until:
            if self._answer is None:
                self._step(None)
            elif self._answer.done():
                answer, self._answer, self._thread = self._answer, None, None
                self._step(answer)
            elif not self._serve(until):
                break
        return not self._is_at_work()

    def cancel(self) -> None:
        """Stop: nothing more touches Blender's data. A thread that cannot stop at once is left
        behind, and the next job waits for it."""
        if self._is_at_work():
            self._cancelled.set()
            self._steps.close()
            Job._left_behind = self._thread
            self._end()

    @property
    def is_cancelled(self) -> bool:
        return self._cancelled.is_set()

    def _is_at_work(self) -> bool:
        return Job.running is self

    def _step(self, answer: Future | None) -> None:
        """The next step, after work apart with its result or error."""
        try:
            error = answer.exception() if answer else None
            if error is not None:
                step = self._steps.throw(error)
            else:
                step = self._steps.send(answer.result() if answer else None)
        except StopIteration as done:
            self.result = done.value
            self._end()
        except BaseException as wrong:
            self.error = wrong
            self._end()
        else:
            if step is not None:
                self._begin(step)

    def _begin(self, apart: Apart) -> None:
        self._answer = Future()
        self._thread = threading.Thread(
            target=_work, args=(self._answer, apart, self._listen, self._in_main), daemon=True
        )
        self._thread.start()

    def _listen(self, stage: str, fraction: float) -> None:
        if self._cancelled.is_set():
            raise Cancelled
        self.stage, self.fraction = stage, fraction

    def _in_main(self, steps: Steps) -> Any:  # noqa: ANN401 - whatever the steps return
        """Called by the thread: steps for the main thread, waited for."""
        answer: Future = Future()
        self._asked.put((steps, answer))
        while True:
            try:
                return answer.result(timeout=0.1)
            except TimeoutError:
                if self._cancelled.is_set():
                    raise Cancelled from None

    def _serve(self, until: float) -> bool:
        """Go on with what the thread has asked for; False if there is nothing, or not now."""
        try:
            steps, answer = self._asked.get_nowait()
        except queue.Empty:
            return False
        try:
            while time.perf_counter() < until:
                next(steps)
        except StopIteration as done:
            answer.set_result(done.value)
        except BaseException as wrong:
            answer.set_exception(wrong)
        else:
            self._asked.put((steps, answer))
            return False
        return True

    def _end(self) -> None:
        Job.running = None
        for name in HANDLERS:
            handlers = getattr(bpy.app.handlers, name)
            if self._on_data_going in handlers:
                handlers.remove(self._on_data_going)

    def _on_data_going(self, *_: object) -> None:
        self.cancel()


def _work(answer: Future, apart: Apart, listen: Callable, in_main: Callable) -> None:
    _give_way()
    try:
        answer.set_result(apart.work(apart.heard_by(listen), in_main))
    except BaseException as wrong:
        answer.set_exception(wrong)


def _give_way() -> None:
    """Let the window go first: on Linux, where this call is about a single thread."""
    if sys.platform == "linux":
        thread = os.PRIO_PROCESS, threading.get_native_id()
        os.setpriority(*thread, max(os.getpriority(*thread), NICENESS))
