"""Maps converted by the workers of a Dask cluster.

Which worker does which map is decided here, one map for each of its threads, and not by Dask: so it
is known over which map a worker has died, and which workers could not do it.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import ClusterFailed
from .crew import ClusterMap, ClusterWorker, Crew
from .link import Call, Cancelled, Died, Link, Lost
from .local import Done, Task
from .remote import Answer
from .run_token import remove_token, set_token
from .state import read_record
from .work import MapJob, MapResult

CONVERT = "sunsplit.core.library.remote:convert"
"""What a worker does, by the name under which it knows it."""

LOOK = 0.5
"""Seconds between two looks at which workers there are."""

TICK = 0.1
"""Seconds between two looks at everything else, while no answer comes."""

DEATHS = 3
"""So many workers may die over a map until that is given up."""

Notice = Callable[[str], None]
"""Called with a sentence about the cluster, for the user to read while the work goes on."""


@dataclass(frozen=True)
class Patience:
    """Seconds to wait: for the scheduler at first, and until it is back; until it is said that
    there are no workers, and until that ends the run; until it is said that a worker does not
    answer; for a worker that can do what others could not; until written files are seen here."""

    scheduler: float = 10.0
    back: float = 60.0
    notice: float = 5.0
    workers: float = 300.0
    greeting: float = 30.0
    other_worker: float = 10.0
    files: float = 60.0


PATIENCE = Patience()


@dataclass(frozen=True)
class _Arriving:
    """A map that was converted, and whose files are not seen here yet."""

    map: ClusterMap
    done: Done
    worker: str
    end: float


class ClusterWorkers:
    """Workers of the cluster whose scheduler has this address. To be closed: what is begun then
    comes to its end there, what is not never begins.

    output: folder that all of them share.
    """

    def __init__(self, scheduler: str, output: Path, notice: Notice) -> None:
        self._link, self._crew = Link(scheduler), Crew()
        self._output, self._token = output, ""
        self._notice, self._patience = notice, PATIENCE
        self._arriving: list[_Arriving] = []
        self._looked = 0.0
        self._without_since: float | None = None
        self._has_said_none = False
        self._silent: set[str] = set()

    def __enter__(self) -> ClusterWorkers:
        try:
            self._link.open()
            self._token = set_token(self._output)
            self._connect()
            if self._link.mismatches:
                self._notice(
                    "Python, Dask or what it needs is not the same version on all machines, which "
                    "may not work: install the same everywhere."
                )
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def run(self, tasks: Sequence[Task]) -> Iterator[Done | None]:
        """What comes of the tasks, as it comes, and None now and then while none does. The first
        ones are begun first. Raises ClusterFailed where there is nobody to do them."""
        self._crew.left.extend(ClusterMap(task, MapJob.from_json(task.job)) for task in tasks)
        while self._crew.left or self._crew.calls or self._arriving:
            try:
                self._look()
                self._hand_out()
                yield from self._settled()
            except Lost:
                yield from self._reconnected()
            yield from self._arrived()
            yield from self._given_up()
            yield None

    def _close(self) -> None:
        if self._token:
            remove_token(self._output)
        for call in self._crew.calls:
            self._link.forget(call)
        self._link.close()

    # The scheduler

    def _connect(self) -> None:
        end = time.monotonic() + self._patience.scheduler
        while not self._link.connect():
            if time.monotonic() > end:
                raise ClusterFailed(
                    f"No Dask scheduler answers at {self._link.address}: start one with "
                    "`dask scheduler`, and workers with `dask worker`."
                )

    def _reconnected(self) -> Iterator[None]:
        """What was begun is begun again: a new scheduler knows nothing of it."""
        wait, address = self._patience.back, self._link.address
        self._notice(f"The scheduler at {address} is lost: {wait:g} s for it to come back.")
        end = time.monotonic() + wait
        for worker in list(self._crew.workers):
            self._dropped(worker)
        while not self._link.connect():
            if time.monotonic() > end:
                raise ClusterFailed(
                    f"The scheduler at {address} is lost, and did not come back within {wait:g} s: "
                    "run the same again to go on."
                )
            time.sleep(TICK)
            yield None
        self._looked = 0.0

    # Workers

    def _look(self) -> None:
        """At which workers there are. One that has gone may have died of what it was at."""
        now = time.monotonic()
        if now < self._looked + LOOK:
            return
        self._looked, known = now, self._crew.workers
        there = self._link.workers()
        for address in known.keys() - there.keys():
            for each in self._dropped(address):
                each.has_killed(address)
        for address in there.keys() - known.keys():
            found = self._link.find(address, CONVERT)
            known[address] = ClusterWorker(there[address], found, now)
        self._tell_of_silent_ones(now)
        if known:
            self._without_since = None
        else:
            self._wait_for_workers(now)

    def _tell_of_silent_ones(self, now: float) -> None:
        limit = self._patience.greeting
        for address, worker in self._crew.workers.items():
            if not worker.is_ready and worker.since + limit < now and address not in self._silent:
                self._silent.add(address)
                self._notice(
                    f"The worker {address} has not answered for {limit:g} s: it is busy with other "
                    "work, or has another Dask than the scheduler."
                )

    def _wait_for_workers(self, now: float) -> None:
        self._without_since = now if self._without_since is None else self._without_since
        waited, most = now - self._without_since, self._patience.workers
        if waited > most:
            raise ClusterFailed(
                f"The scheduler at {self._link.address} has had no workers for {most:g} s: start "
                "some with `dask worker`, and run the same again to go on."
            )
        if waited >= self._patience.notice and not self._has_said_none:
            self._has_said_none = True
            self._notice(
                f"The scheduler at {self._link.address} has no workers: waiting for some, for up "
                f"to {most:g} s."
            )

    def _hand_out(self) -> None:
        for worker, each in self._crew.pairs():
            try:
                call = self._link.call(worker.found, each.task.job, self._token)
            except Lost:
                self._crew.left.appendleft(each)
                raise
            worker.busy[call] = each

    def _dropped(self, address: str) -> list[ClusterMap]:
        """Forget a worker, and let Dask forget what it was at: another one will do that."""
        worker = self._crew.workers[address]
        for call in (*worker.busy, worker.found):
            self._link.forget(call)
        return self._crew.dropped(address)

    def _refuse(self, address: str, sentence: str, install: bool) -> None:
        worker = self._crew.workers[address]
        if not worker.refusal:
            worker.refusal, worker.install = sentence, install
            self._notice(f"The worker {address} {sentence}. It is given no maps.")

    # Answers

    def _settled(self) -> Iterator[Done]:
        """What comes of what has been answered by now; it waits a moment for the first one."""
        with suppress(queue.Empty):
            heard = self._link.heard.get(timeout=TICK)
            while True:
                done = self._after(*heard)
                if done:
                    yield done
                heard = self._link.heard.get_nowait()

    def _after(self, call: Call, answer: Answer | None, error: BaseException | None) -> Done | None:
        worker = self._crew.workers.get(call.worker)
        if worker is None or (call is not worker.found and call not in worker.busy):
            return None  # of a worker that was given up
        if isinstance(error, Cancelled):  # not by us: the scheduler knows its worker no more
            self._dropped(call.worker)
            return None
        if call is worker.found:
            self._after_greeting(worker, call.worker, error)
            return None
        each = worker.busy.pop(call)
        if answer is None:
            return self._after_error(each, call.worker, error)
        return self._after_answer(each, call.worker, answer)

    def _after_greeting(
        self, worker: ClusterWorker, address: str, error: BaseException | None
    ) -> None:
        worker.is_ready = True
        if error is not None:
            reason = f"cannot use Sunsplit ({type(error).__name__}: {error})"
            self._refuse(address, f"{reason}: install the same one everywhere", install=True)

    def _after_error(
        self, each: ClusterMap, address: str, error: BaseException | None
    ) -> Done | None:
        if isinstance(error, Died):
            each.has_killed(address)
            self._crew.put_back([each])
            return None
        # A bug: as where a local worker dies of it, other maps are still worth their work.
        raised = " ".join(f"{type(error).__name__}: {error}".split())
        return Done(each.task, None, f"It raised {raised}; see the log of the worker {address}.")

    def _after_answer(self, each: ClusterMap, address: str, answer: Answer) -> Done | None:
        if "obstacle" in answer:
            self._refuse(address, answer["obstacle"], answer["install"])
            self._crew.left.appendleft(each)
            return None
        result = MapResult.from_json(answer["result"])
        if result.obstacle:
            each.refused[address] = _refusal(each.job, result)
            self._crew.left.appendleft(each)
            return None
        if each.begun and result.known:  # by this very run, whose worker could not say so
            result = replace(result, known=False)
        done = Done(each.task, result.to_json())
        if result.row.status != "done":
            return done
        end = time.monotonic() + self._patience.files
        self._arriving.append(_Arriving(each, done, address, end))
        return None

    def _arrived(self) -> Iterator[Done]:
        """What is seen here, too: a file system that is shared may take its time."""
        for arriving in list(self._arriving):
            each = arriving.map
            if _is_there(each.job):
                self._arriving.remove(arriving)
                yield arriving.done
            elif time.monotonic() > arriving.end:
                self._arriving.remove(arriving)
                sentence = f"has written into another {each.job.output} than this machine sees"
                each.refused[arriving.worker] = sentence
                self._crew.put_back([each])

    def _given_up(self) -> Iterator[Done]:
        """Maps that no worker can do."""
        now = time.monotonic()
        for each in self._crew.doubtful():
            sentence = _deadly(each) or self._impossible(each, now)
            if sentence:
                self._crew.left.remove(each)
                yield Done(each.task, None, sentence)

    def _impossible(self, each: ClusterMap, now: float) -> str:
        """Why, once it has been so for a while: another worker may be about to come."""
        why = self._crew.why_nobody(each)
        if not why:
            each.since = None
            return ""
        each.since = now if each.since is None else each.since
        if now < each.since + self._patience.other_worker:
            return ""
        if all(worker.install for worker in self._crew.workers.values()):
            raise ClusterFailed(f"No worker can be used: {why}.")
        return f"No worker can do it: {why}."


def _deadly(each: ClusterMap) -> str:
    if each.task.deaths < DEATHS:
        return ""
    return (
        f"{DEATHS} workers have died over it, {each.died_on} last: it may need more memory than "
        "they are allowed (--memory-limit)."
    )


def _refusal(job: MapJob, result: MapResult) -> str:
    """Of a worker, to be read after its name."""
    if result.obstacle == "unseen":
        return f"does not see {job.source} that is to be shared under this path"
    if result.obstacle == "memory":
        return "has too little memory for it"
    return f"cannot write ({result.row.sentence.rstrip('.')}): share the folder {job.output}"


def _is_there(job: MapJob) -> bool:
    """Whether this machine sees all that a worker says it has written."""
    output = Path(job.output)
    record = read_record(output, job.name)
    if record is None or record.request != job.request:
        return False
    try:
        return all(
            known.times is None or (output / path).stat().st_size == known.times[0]
            for path, known in record.files.items()
        )
    except OSError:
        return False
