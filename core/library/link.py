"""The connection to a Dask scheduler: the only module that knows Dask.

Functions are sent by their names alone, so that nothing but a worker has to find them.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import operator
import pkgutil
import queue
import secrets
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import ClusterFailed

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT = 5.0
"""Seconds that one attempt to reach the scheduler may take."""

REPLY = 15.0
"""Seconds after which a scheduler that says nothing is taken for lost."""

_TALKATIVE = ("distributed", "tornado", "asyncio")
"""Loggers that report every lost connection; what matters of that is said here."""


class Lost(Exception):
    """The scheduler does not answer."""


class Cancelled(Exception):
    """Nobody will answer: the scheduler has forgotten what it was asked."""


class Died(Exception):
    """Dask has given a call up, as its worker died over it again and again."""


@dataclass(frozen=True, eq=False)
class Call:
    """Something that a worker was asked to do."""

    worker: str
    future: Future


Heard = tuple[Call, Any, BaseException | None]
"""A call and what came of it: a value, or what it raised there."""


class Link:
    """A client of the scheduler at an address. To be closed, which cancels what is not done.

    mismatches: of versions of Python, Dask and what it needs, on the machines that there are.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.heard: queue.SimpleQueue[Heard] = queue.SimpleQueue()
        self.mismatches: list[Warning] = []
        self._client: Client | None = None
        self._quiet = ExitStack()

    def open(self) -> None:
        """Before anything else. Raises ClusterFailed where there is no Dask."""
        _refuse_without_dask()
        self._quiet.enter_context(_quiet())

    def close(self) -> None:
        """At the end; it may come twice."""
        with self._quiet:
            self._leave()

    def connect(self) -> bool:
        """Try once. Raises ClusterFailed where that is no address."""
        from distributed import Client
        from distributed.versions import VersionMismatchWarning

        self._leave()
        try:
            with _without(VersionMismatchWarning) as self.mismatches, _uncollected():
                self._client = Client(
                    self.address,
                    timeout=CONNECT,
                    name="sunsplit",
                    set_as_default=False,
                    direct_to_workers=False,
                )
        except (OSError, TimeoutError):
            return False
        except (ValueError, TypeError, ImportError) as error:
            raise ClusterFailed(f"{self.address} is no scheduler's address: {error}.") from error
        return True

    def _leave(self) -> None:
        """Close the connection, if there is one."""
        client, self._client = self._client, None
        if client:
            with suppress(OSError, TimeoutError):
                client.close(timeout=CONNECT)

    def workers(self) -> dict[str, int]:
        """Addresses of all workers there are now, and how many threads each has. Raises Lost."""
        if self._client is None or self._client.status != "running":
            raise Lost
        try:
            return dict(self._client.nthreads(callback_timeout=REPLY))
        except (OSError, TimeoutError, CancelledError) as error:
            raise Lost from error

    def find(self, worker: str, name: str) -> Call:
        """Ask a worker for what has this name, "module:name"; it stays there. Raises Lost."""
        return self._asked(worker, False, pkgutil.resolve_name, name)

    def call(self, found: Call, *arguments: object) -> Call:
        """Ask a worker to call what it has found. Raises Lost."""
        return self._asked(found.worker, True, operator.call, found.future, *arguments)

    def forget(self, call: Call) -> None:
        """It need not be done any more."""
        if self._client and self._client.status == "running":
            with suppress(OSError, TimeoutError, CancelledError):
                call.future.cancel()

    def _asked(self, worker: str, with_value: bool, function: object, *arguments: object) -> Call:
        if self._client is None or self._client.status != "running":
            raise Lost
        key = f"sunsplit-{secrets.token_hex(8)}"
        try:
            future = self._client.submit(
                function, *arguments, key=key, workers=[worker], allow_other_workers=False
            )
        except CancelledError as error:  # what was found is forgotten, with its scheduler
            raise Lost from error
        call = Call(worker, future)
        self._client.loop.add_callback(self._listen, call, with_value)
        return call

    async def _listen(self, call: Call, with_value: bool) -> None:
        """In the client's own thread, which can wait for all calls at once."""
        from distributed.scheduler import KilledWorker

        value, error = None, None
        try:
            if with_value:
                value = await call.future
            else:
                error = await call.future.exception()
        except (Exception, asyncio.CancelledError) as raised:
            error = raised
        if isinstance(error, (CancelledError, asyncio.CancelledError)):
            error = Cancelled()
        elif isinstance(error, KilledWorker):
            error = Died("it dies of that")
        self.heard.put((call, value, error))


def _refuse_without_dask() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise ClusterFailed(
            'A cluster needs Dask, which is not installed: pip install "sunsplit[cluster]".'
        ) from error


@contextmanager
def _without(kind: type[Warning]) -> Iterator[list[Warning]]:
    """The warnings of this kind, which are not shown, when the block has ended."""
    found: list[Warning] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", kind)
        yield found
    for each in caught:
        if issubclass(each.category, kind):
            found.append(each.message)
        else:
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)


@contextmanager
def _uncollected() -> Iterator[None]:
    """No garbage is collected meanwhile: a client that never reached its scheduler may be among it,
    which then closes, and would wait for ever for the lock of the one that begins."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@contextmanager
def _quiet() -> Iterator[None]:
    known = [logging.getLogger(name) for name in list(logging.root.manager.loggerDict)]
    loggers = [logger for logger in known if logger.name.split(".")[0] in _TALKATIVE]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
