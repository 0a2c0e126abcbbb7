"""Long work in steps, so that a window stays alive: what touches Blender's data runs in its main
thread, a little at a time; what does not may run in a thread of its own.

A function of steps is a generator. It yields None where the window may have a moment, and `Apart`
for work of the second kind, whose result it is given back. The same steps serve scripts, which
wait for all of them (`run_at_once`), and the window (`jobs.Job`).
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, TypeVar

from ..core.progress import Progress, silent

Result = TypeVar("Result")


@dataclass(frozen=True)
class Apart:
    """Work that may run in another thread.

    work: called with a `Progress` and with a function that runs steps in the main thread and
    returns their result. begin, end: what part of all the work this is, 0 to 1.
    """

    work: Callable[[Progress, Callable[[Steps], Any]], Any]
    begin: float
    end: float

    def heard_by(self, progress: Progress) -> Progress:
        """A listener that is told of this work's progress as of a part of the whole."""
        return lambda stage, fraction: progress(
            stage, self.begin + (self.end - self.begin) * fraction
        )


Steps = Generator[Apart | None, Any, Result]


def run_at_once(steps: Steps[Result], progress: Progress = silent) -> Result:
    """All steps, one after the other; what they return."""
    answer = None
    while True:
        try:
            step = steps.send(answer)
        except StopIteration as done:
            return done.value
        answer = None
        if step is not None:
            answer = step.work(step.heard_by(progress), run_at_once)
