"""The workers of a cluster as far as they are known, and the maps that they are at."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from .link import Call
from .local import Task
from .work import MapJob


@dataclass(eq=False)
class ClusterMap:
    """A map to be done. refused: by which workers, and why. begun: whether a worker may have done
    it unheard. died_on: the last worker that died over it. since: when it was found that nobody
    can do it."""

    task: Task
    job: MapJob
    refused: dict[str, str] = field(default_factory=dict)
    begun: bool = False
    died_on: str = ""
    since: float | None = None

    def has_killed(self, address: str) -> None:
        """Or a worker has left while it was at this map, which looks the same."""
        self.task.deaths += 1
        self.died_on = address


@dataclass(eq=False)
class ClusterWorker:
    """found: the call that looks for Sunsplit there. since: when that was made.
    refusal: why nothing can be done there. install: whether that is for want of the right
    Sunsplit. busy: what it is at."""

    threads: int
    found: Call
    since: float
    is_ready: bool = False
    refusal: str = ""
    install: bool = False
    busy: dict[Call, ClusterMap] = field(default_factory=dict)

    @property
    def is_usable(self) -> bool:
        return self.is_ready and not self.refusal

    @property
    def load(self) -> float:
        """0 without work, 1 with a map for each thread."""
        return len(self.busy) / self.threads


class Crew:
    """workers: by address. left: maps that no worker is at, what comes next first."""

    def __init__(self) -> None:
        self.workers: dict[str, ClusterWorker] = {}
        self.left: deque[ClusterMap] = deque()

    @property
    def calls(self) -> list[Call]:
        """What was asked for and is not answered."""
        return [call for worker in self.workers.values() for call in worker.busy]

    def dropped(self, address: str) -> list[ClusterMap]:
        """Forget a worker. What it was at is to be done again."""
        maps = list(self.workers.pop(address).busy.values())
        self.put_back(reversed(maps))
        return maps

    def put_back(self, maps: Iterable[ClusterMap]) -> None:
        """Each may have been done unheard."""
        for each in maps:
            each.begun = True
            self.left.appendleft(each)

    def pairs(self) -> Iterator[tuple[ClusterWorker, ClusterMap]]:
        """A worker and the map that it shall do, taken from those left: the least busy worker
        first. The caller makes it busy before the next."""
        while self.left:
            usable = [(w.load, a) for a, w in self.workers.items() if w.is_usable]
            offers = ((a, self._next_for(a)) for _, a in sorted(usable))
            address, chosen = next((offer for offer in offers if offer[1]), ("", None))
            if chosen is None:
                return
            self.left.remove(chosen)
            yield self.workers[address], chosen

    def _next_for(self, address: str) -> ClusterMap | None:
        """A map over which a worker has died is done by a worker that does nothing else."""
        busy = self.workers[address].busy
        if len(busy) >= self.workers[address].threads:
            return None
        if any(each.task.deaths for each in busy.values()):
            return None
        first = next((each for each in self.left if address not in each.refused), None)
        return None if first and first.task.deaths and busy else first

    def doubtful(self) -> list[ClusterMap]:
        """Maps that are left and that perhaps no worker can do."""
        able = any(worker.is_usable for worker in self.workers.values())
        return [m for m in self.left if not able or m.refused or m.task.deaths]

    def why_nobody(self, each: ClusterMap) -> str:
        """Nothing where a worker can do it, or where there are none or one that is still new."""
        reasons = []
        for address, worker in self.workers.items():
            reason = worker.refusal or each.refused.get(address)
            if not reason:
                return ""
            reasons.append(f"{address} {reason}")
        others = len(reasons) - 1
        more = f" ({others} more cannot either)" if others > 0 else ""
        return f"{reasons[0]}{more}" if reasons else ""
