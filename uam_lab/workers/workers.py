"""Hands out items to worker processes and receives the results, in the order in which they come."""

from __future__ import annotations

import contextlib
import queue
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from distributed import Client, Future
from distributed.scheduler import KilledWorker

from uam_lab.workers import task
from uam_lab.workers.identity import identity
from uam_lab.workers.local_cluster import local_cluster
from uam_lab.workers.place import WorkersError, Workplace
from uam_lab.workers.window import PER_WORKER, Window

CONNECTING = 15.0  # [s] for the scheduler to answer
GONE = 60.0  # [s] without the scheduler, after which the command ends
POLL = 1.0  # [s] between two looks at the number of workers
WAITING = 10.0  # [s] without a worker, after which the user is told


@contextmanager
def workers(
    place: Workplace,
    prepare: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Iterator[Workers]:
    """Yield the workers of a place. Raises WorkersError if there is no scheduler.

    prepare: importable function that each worker calls once, before its first item. say: receives
    the address of the dashboard, and when there is nobody to work.
    """
    with contextlib.ExitStack() as stack:
        if place.scheduler:
            client = stack.enter_context(_connected(place.scheduler))
        else:
            cluster = stack.enter_context(local_cluster(place.jobs))
            client = stack.enter_context(Client(cluster, set_as_default=False))
        say(f"dashboard {client.dashboard_link}")
        yield Workers(client, prepare, say)


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    try:
        client = Client(address, timeout=CONNECTING, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] or type(error).__name__
        raise WorkersError(f"scheduler {address}: {reason}") from None
    with client:
        yield client


class Workers:
    """Connected workers, see `workers`."""

    def __init__(
        self,
        client: Client,
        prepare: Callable[[], None] | None,
        say: Callable[[str], None],
    ) -> None:
        self._client, self._prepare, self._say = client, prepare, say

    def threads(self) -> int:
        """Return the present number of threads of all workers."""
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError):  # no scheduler at present
            return 0

    def completed(
        self,
        work: Callable[[Any], Any],
        items: Iterable[Any],
        per_worker: int = PER_WORKER,
        idle: Callable[[], None] = lambda: None,
    ) -> Iterator[tuple[int, Any]]:
        """Yield the number of an item and work(item), each item once, in the order of completion.

        The items of a lost worker are computed again. idle: called about every second. Raises
        what `work` raises, WorkersError if workers or scheduler cannot be used.
        """
        return _Run(self, self._client, self._prepare, self._say).completed(
            work, Window(items, per_worker), idle
        )


class _Run:
    """One call of `Workers.completed`."""

    def __init__(
        self,
        crew: Workers,
        client: Client,
        prepare: Callable[[], None] | None,
        say: Callable[[str], None],
    ) -> None:
        self._crew, self._client, self._prepare, self._say = crew, client, prepare, say
        self._name = f"flight-{uuid.uuid4().hex[:8]}"
        self._expected = identity()
        self._futures: dict[int, Future] = {}
        self._finished: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._submitted = 0
        self._alive = self._looked = self._staffed = time.monotonic()
        self._threads, self._told = 0, False

    def completed(
        self, work: Callable[[Any], Any], window: Window, idle: Callable[[], None]
    ) -> Iterator[tuple[int, Any]]:
        self._threads = self._crew.threads()
        try:
            while True:
                for number, item in window.fill(self._threads):
                    self._submit(work, number, item)
                if not window:
                    return
                with contextlib.suppress(queue.Empty):
                    number = self._finished.get(timeout=POLL)
                    future = self._futures.pop(number)
                    if future.status == "finished":
                        result = future.result()
                        window.done(number)
                        yield number, result
                    else:
                        self._failed(future, window, number)
                if time.monotonic() - self._looked >= POLL:
                    self._look()
                    idle()
        finally:
            left = list(self._futures.values())
            if left:
                with contextlib.suppress(Exception):
                    self._client.cancel(left, force=True)

    def _submit(self, work: Callable[[Any], Any], number: int, item: Any) -> None:
        self._submitted += 1
        future = self._client.submit(
            task.run,
            work,
            item,
            self._expected,
            self._prepare,
            key=f"{self._name}-{self._submitted}",
            pure=False,
        )
        self._futures[number] = future
        future.add_done_callback(lambda _: self._finished.put(number))

    def _failed(self, future: Future, window: Window, number: int) -> None:
        """Have a lost item computed again; raise every other error."""
        if future.status != "error":
            raise WorkersError(f"the scheduler gave up a flight ({future.status})")
        error = future.exception()
        if isinstance(error, KilledWorker) and window.lost(number):
            return
        if isinstance(error, ModuleNotFoundError):
            raise WorkersError(f"a worker cannot import {error.name}: install uam there") from error
        if isinstance(error, KilledWorker):
            raise WorkersError(f"{number}: every worker that began it was lost") from error
        raise error

    def _look(self) -> None:
        """Notice a change of the number of workers, and a lost scheduler."""
        now = self._looked = time.monotonic()
        if self._client.status == "running":
            self._alive = now
            self._threads = self._crew.threads()
        elif self._client.status == "closed" or now - self._alive > GONE:
            raise WorkersError("the connection to the scheduler is lost")
        if self._threads:
            self._staffed, self._told = now, False
        elif now - self._staffed > WAITING and not self._told:
            self._say("waiting for a worker")
            self._told = True
