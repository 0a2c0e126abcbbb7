"""Maps converted by the workers of a Dask cluster.

Which worker does which map is decided here, one map for each of its threads, and not by Dask: so it
is known over which map a worker has died, and which workers could not do it.
"""

from __future__ import annotations

import queue
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..errors import CannotWrite, ClusterFailed
from .link import Call, Cancelled, Died, Link, Lost
from .local import Done, Task
from .remote import TOKEN, Answer
from .state import STATE, read_record
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
    there are no workers, and until that ends the run; for a worker that can do what others could
    not; until written files are seen here, too."""

    scheduler: float = 10.0
    back: float = 60.0
    notice: float = 5.0
    workers: float = 300.0
    other_worker: float = 10.0
    files: float = 60.0


PATIENCE = Patience()


@dataclass(eq=False)
class _Map:
    """refused: by which workers, and why. begun: whether a worker may have done it unheard.
    died_on: the last worker that died over it. since: when it was found that nobody can do it."""

    task: Task
    job: MapJob
    refused: dict[str, str] = field(default_factory=dict)
    begun: bool = False
    died_on: str = ""
    since: float | None = None


@dataclass(eq=False)
class _Worker:
    """found: the call that looks for Sunsplit there. refusal: why nothing can be done there.
    install: whether that is for want of the right Sunsplit. busy: what it does, oldest first."""

    threads: int
    found: Call
    is_ready: bool = False
    refusal: str = ""
    install: bool = False
    busy: dict[Call, _Map] = field(default_factory=dict)

    @property
    def is_usable(self) -> bool:
        return self.is_ready and not self.refusal


@dataclass(frozen=True)
class _Arriving:
    """A map that was converted, and whose files are not seen here yet."""

    map: _Map
    done: Done
    worker: str
    end: float


class ClusterWorkers:
    """Workers of the cluster whose scheduler has this address. To be closed: what is begun then
    comes to its end there, what is not never begins.

    output: folder that all of them share.
    """

    def __init__(
        self, scheduler: str, output: Path, notice: Notice, patience: Patience | None = None
    ) -> None:
        self._link = Link(scheduler)
        self._output, self._token = output, secrets.token_hex(16)
        self._notice, self._patience = notice, patience or PATIENCE
        self._left: deque[_Map] = deque()
        self._workers: dict[str, _Worker] = {}
        self._arriving: list[_Arriving] = []
        self._looked = 0.0
        self._without_since: float | None = None
        self._told: set[str] = set()

    def __enter__(self) -> ClusterWorkers:
        try:
            self._link.open()
            self._set_token()
            self._connect()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def run(self, tasks: Sequence[Task]) -> Iterator[Done | None]:
        """What comes of the tasks, as it comes, and None now and then while none does. The first
        ones are begun first. Raises ClusterFailed where there is nobody to do them."""
        self._left.extend(_Map(task, MapJob.from_json(task.job)) for task in tasks)
        while self._left or self._arriving or any(w.busy for w in self._workers.values()):
            try:
                self._look()
                self._hand_out()
                yield from self._settled()
            except Lost:
                yield from self._reconnected()
            yield from self._arrived()
            yield from self._given_up()
            yield None

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
        for worker in list(self._workers):
            self._drop(worker)
        while not self._link.connect():
            if time.monotonic() > end:
                raise ClusterFailed(
                    f"The scheduler at {address} is lost, and did not come back within {wait:g} s: "
                    "run the same again to go on."
                )
            time.sleep(TICK)
            yield None
        self._looked = 0.0

    def _close(self) -> None:
        """What is begun comes to its end on its worker; what is not finds no token."""
        with suppress(OSError):
            self._token_path.unlink(missing_ok=True)
        for worker in self._workers.values():
            for call in worker.busy:
                self._link.forget(call)
        self._link.close()

    @property
    def _token_path(self) -> Path:
        return self._output / STATE / TOKEN

    def _set_token(self) -> None:
        draft = self._token_path.with_name(f".{self._token}")
        try:
            draft.write_text(self._token, encoding="utf-8")
            draft.replace(self._token_path)
        except OSError as error:
            reason = error.strerror or error
            raise CannotWrite(f"Cannot write into {self._output}: {reason}.") from error

    # Workers

    def _look(self) -> None:
        """At which workers there are."""
        now = time.monotonic()
        if now < self._looked + LOOK:
            return
        self._looked = now
        there = self._link.workers()
        for address in self._workers.keys() - there.keys():
            self._bury(address)
        for address in there.keys() - self._workers.keys():
            found = self._link.find(address, CONVERT)
            self._workers[address] = _Worker(there[address], found)
        self._wait_for_workers(now)

    def _wait_for_workers(self, now: float) -> None:
        if self._workers:
            self._without_since = None
            return
        self._without_since = now if self._without_since is None else self._without_since
        waited, most = now - self._without_since, self._patience.workers
        if waited > most:
            raise ClusterFailed(
                f"The scheduler at {self._link.address} has had no workers for {most:g} s: start "
                "some with `dask worker`, and run the same again to go on."
            )
        if waited >= self._patience.notice:
            self._notice_once(
                f"The scheduler at {self._link.address} has no workers: waiting for some, for up "
                f"to {most:g} s."
            )

    def _bury(self, address: str) -> None:
        """A worker has died, or has left: the maps that it was at may be why."""
        for each in self._drop(address):
            each.task.deaths += 1
            each.died_on = address

    def _drop(self, address: str) -> list[_Map]:
        """Forget a worker; what it did is to be done again."""
        maps = list(self._workers.pop(address).busy.values())
        for each in reversed(maps):
            self._put_back(each)
        return maps

    def _put_back(self, each: _Map) -> None:
        each.begun = True
        self._left.appendleft(each)

    def _refuse(self, address: str, sentence: str, install: bool) -> None:
        worker = self._workers[address]
        if not worker.refusal:
            worker.refusal, worker.install = sentence, install
            self._notice(f"The worker {address} {sentence}. It is given no maps.")

    # Maps

    def _hand_out(self) -> None:
        """To the least busy worker first."""
        while self._left:
            by_load = sorted(
                ((len(w.busy) / w.threads, a) for a, w in self._workers.items() if w.is_usable)
            )
            for _, address in by_load:
                if chosen := self._next_for(address):
                    break
            else:
                return
            self._left.remove(chosen)
            worker = self._workers[address]
            worker.busy[self._link.call(worker.found, chosen.task.job, self._token)] = chosen

    def _next_for(self, address: str) -> _Map | None:
        """A map over which a worker has died is done by a worker that does nothing else."""
        busy = self._workers[address].busy
        if len(busy) >= self._workers[address].threads:
            return None
        if any(each.task.deaths for each in busy.values()):
            return None
        first = next((each for each in self._left if address not in each.refused), None)
        return None if first and first.task.deaths and busy else first

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
        worker = self._workers.get(call.worker)
        if worker and call is worker.found:
            self._greeted(worker, call.worker, error)
        elif worker and call in worker.busy:
            if isinstance(error, Cancelled):  # not by us: the scheduler knows its worker no more
                self._drop(call.worker)
                return None
            each = worker.busy.pop(call)
            if answer is None:
                return self._after_error(each, call.worker, error)
            return self._after_answer(each, call.worker, answer)
        return None

    def _greeted(self, worker: _Worker, address: str, error: BaseException | None) -> None:
        if isinstance(error, Cancelled):
            self._drop(address)
        elif error is None:
            worker.is_ready = True
        else:
            reason = f"cannot use Sunsplit ({type(error).__name__}: {error})"
            self._refuse(address, f"{reason}: install the same one everywhere", install=True)

    def _after_error(self, each: _Map, address: str, error: BaseException) -> Done | None:
        if isinstance(error, Died):
            each.task.deaths += 1
            each.died_on = address
            self._put_back(each)
            return None
        # A bug: as where a local worker dies of it, other maps are still worth their work.
        raised = " ".join(f"{type(error).__name__}: {error}".split())
        return Done(each.task, None, f"It raised {raised}; see the log of the worker {address}.")

    def _after_answer(self, each: _Map, address: str, answer: Answer) -> Done | None:
        if "obstacle" in answer:
            self._refuse(address, answer["obstacle"], answer["install"])
            self._left.appendleft(each)
            return None
        result = MapResult.from_json(answer["result"])
        if result.obstacle:
            each.refused[address] = _refusal(each.job, result)
            self._left.appendleft(each)
            return None
        if each.begun and result.known:  # by this very run, whose worker could not say so
            result = replace(result, known=False)
        done = Done(each.task, result.to_json())
        if result.row.status == "done":
            end = time.monotonic() + self._patience.files
            self._arriving.append(_Arriving(each, done, address, end))
            return None
        return done

    def _arrived(self) -> Iterator[Done]:
        """What is seen here, too: a file system that is shared may take its time."""
        for arriving in list(self._arriving):
            each = arriving.map
            there = _is_there(each.job)
            if there or time.monotonic() > arriving.end:
                self._arriving.remove(arriving)
            if there:
                yield arriving.done
            elif arriving not in self._arriving:
                sentence = f"has written into another {each.job.output} than this machine sees"
                each.refused[arriving.worker] = sentence
                self._put_back(each)

    def _given_up(self) -> Iterator[Done]:
        """Maps that no worker can do."""
        now, able = time.monotonic(), any(w.is_usable for w in self._workers.values())
        for each in list(self._left):
            if each.task.deaths >= DEATHS:
                sentence = (
                    f"{DEATHS} workers have died over it, {each.died_on} last: it may need more "
                    "memory than they are allowed (--memory-limit)."
                )
            elif (able and not each.refused) or not (why := self._why_nobody(each)):
                each.since = None
                continue
            else:
                each.since = now if each.since is None else each.since
                if now < each.since + self._patience.other_worker:
                    continue
                sentence = f"No worker can do it: {why}."
                if all(w.install for w in self._workers.values()):
                    raise ClusterFailed(sentence.replace("do it", "be used"))
            self._left.remove(each)
            yield Done(each.task, None, sentence)

    def _why_nobody(self, each: _Map) -> str:
        """ "" where a worker can, or where there are none or one that has not said so far."""
        reasons = []
        for address, worker in self._workers.items():
            reason = worker.refusal or each.refused.get(address)
            if not reason:
                return ""
            reasons.append(f"{address} {reason}")
        others = len(reasons) - 1
        more = f" ({others} more cannot either)" if others > 0 else ""
        return f"{reasons[0]}{more}" if reasons else ""

    def _notice_once(self, sentence: str) -> None:
        if sentence not in self._told:
            self._told.add(sentence)
            self._notice(sentence)


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
