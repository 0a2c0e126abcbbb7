"""Who does the work: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..cores import usable
from ..settings import BadSetting
from .cluster import ClusterWorkers, Notice
from .local import LocalWorkers
from .memory import LEAST, MEGABYTE, usable_memory
from .processes import converter


@dataclass(frozen=True)
class Team:
    """workers: processes of this machine. memory: bytes that they may hold together. scheduler:
    address of a cluster that converts maps instead. notice: hears of what goes on there."""

    workers: int
    memory: int
    scheduler: str | None = None
    notice: Notice = lambda _: None

    @classmethod
    def of(
        cls,
        workers: int | None,
        memory: int | None,
        scheduler: str | None,
        notice: Notice | None,
    ) -> Team:
        """As a user has asked for; None: as many workers as there are cores, and a part of the
        memory that is free. Raises BadSetting."""
        if workers is not None and workers < 1:
            raise BadSetting(f"workers must be at least 1, not {workers}.")
        if scheduler is not None and (workers is not None or memory is not None):
            raise BadSetting(
                "--workers and --memory are for work on this machine: with --scheduler, "
                "`dask worker --nthreads N --memory-limit SIZE` says that for each machine."
            )
        memory = usable_memory() if memory is None else memory
        if memory < LEAST:
            raise BadSetting(f"memory must be at least {LEAST // MEGABYTE}M.")
        return cls(workers or usable(), memory, scheduler, notice or (lambda _: None))

    def for_maps(self, output: Path) -> LocalWorkers | ClusterWorkers:
        """Who converts maps. output: folder of all that is written."""
        if self.scheduler is not None:
            return ClusterWorkers(self.scheduler, output.absolute(), self.notice)
        return LocalWorkers(converter(), self.workers, self.memory)

    def for_assets(self, command: Sequence[str]) -> LocalWorkers:
        """Who makes .blend files: Blenders, of this command."""
        return LocalWorkers(command, self.workers, self.memory, chatter=True)
