"""Hands out items to worker processes and receives the results, in the order in which they come."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import multiprocessing.resource_tracker
import os
import queue
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import dask.config
from distributed import CancelledError, Client, Future, LocalCluster, get_worker
from distributed.scheduler import KilledWorker

from uam_lab.experiments.workers.identity import difference, identity
from uam_lab.experiments.workers.place import WorkersError, Workplace
from uam_lab.flights.processes.child import SINGLE_THREAD, blocked

HOST = "127.0.0.1"
CLOSING = 5.0  # [s] for idle workers to end
SETTINGS = {
    "distributed.worker.multiprocessing-method": "spawn",
    "distributed.nanny.pre-spawn-environ": SINGLE_THREAD,
    # an item survives lost workers; Dask's default gives it up after three
    "distributed.scheduler.allowed-failures": 1000,
    # for a result that a lost worker had; Dask waits 30 s
    "distributed.comm.timeouts.connect": "10s",
    # sampling every 10 ms in every worker
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.disk": False,
}


@contextmanager
def local_cluster(jobs: int) -> Iterator[LocalCluster]:
    """Yield a cluster of `jobs` worker processes, reachable from this machine only.

    A block that ends with an exception kills the workers at once. The workers end with this
    process, however it ends: each monitors a pipe to it.
    """
    with dask.config.set(SETTINGS):
        # so Ctrl-C in the terminal reaches this process only
        multiprocessing.resource_tracker.ensure_running()  # its start unblocks the signal
        with blocked(signal.SIGINT):
            cluster = LocalCluster(
                n_workers=jobs,
                threads_per_worker=1,
                processes=True,
                host=HOST,
                dashboard_address=f"{HOST}:0",
                memory_limit=0,  # none: a flight needs little
                silence_logs=logging.CRITICAL,
            )
        try:
            yield cluster
        except BaseException:
            _kill(cluster)
            raise
        finally:
            try:
                cluster.close(timeout=CLOSING)
            except Exception:  # on a busy machine; all results are there
                _kill(cluster)


def _kill(cluster: LocalCluster) -> None:
    for nanny in list(cluster.workers.values()):
        nanny.auto_restart = False
        if nanny.pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


_prepared: set[str] = set()
_one_at_a_time = threading.Lock()
PER_WORKER = 3  # one that is computed, and two that need no further message to begin
LOST_AT_MOST = 20  # workers that one item may lose; after that the item itself is the cause
CONNECTING = 15.0  # [s] for the scheduler to answer
GONE = 60.0  # [s] without the scheduler, after which the command ends
RECEIVING = 20.0  # [s] for a result; after that its worker counts as lost
POLL = 1.0  # [s] between two looks at the number of workers
WAITING = 10.0  # [s] without a worker, after which the user is told


def run_item(
    work: Callable[[Any], Any],
    item: Any,
    expected: Mapping[str, str],
    prepare: Callable[[], None] | None,
) -> Any:
    """Return work(item). expected: `identity` of the process that handed it out.

    prepare: is called once in this process, before its first item. Raises WorkersError if this
    worker has other versions.
    """
    other = difference(expected, identity())
    if other:
        raise WorkersError(
            f"worker {get_worker().address} has {other}: install the same on every worker"
        )
    with _one_at_a_time:
        if prepare is not None and prepare.__qualname__ not in _prepared:
            prepare()
            _prepared.add(prepare.__qualname__)
    return work(item)


class Window:
    """Items in their order. An item is drawn from `items` only when there is room for it."""

    def __init__(self, items: Iterable[Any], per_worker: int = PER_WORKER) -> None:
        self._source: Iterator[tuple[int, Any]] = enumerate(items)
        self._per_worker = per_worker
        self._out: dict[int, Any] = {}
        self._again: list[int] = []
        self._losses: dict[int, int] = {}

    def __len__(self) -> int:
        """Return the number of items that are handed out, or have to be handed out again."""
        return len(self._out)

    def fill(self, workers: int) -> list[tuple[int, Any]]:
        """Return the numbered items to hand out now; lost ones come first.

        workers: present number; with none, as many items as one worker needs wait for the first.
        """
        found = [(number, self._out[number]) for number in self._again]
        self._again.clear()
        while len(self._out) < self._per_worker * max(workers, 1):
            entry = next(self._source, None)
            if entry is None:
                break
            self._out[entry[0]] = entry[1]
            found.append(entry)
        return found

    def done(self, number: int) -> None:
        """Take the item out of the window."""
        del self._out[number]
        self._losses.pop(number, None)

    def lost(self, number: int) -> bool:
        """Note that the item's worker was lost; return whether it is handed out again."""
        self._losses[number] = self._losses.get(number, 0) + 1
        if self._losses[number] > LOST_AT_MOST:
            return False
        self._again.append(number)
        return True


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
        client = _LimitedClient(address, timeout=CONNECTING, set_as_default=False)
    except Exception as error:  # what answers may be anything: Dask raises different types
        reason = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise WorkersError(
            f"scheduler {address}: {reason}; the address that `dask scheduler` prints is expected, "
            "with its port, not the dashboard's"
        ) from None
    with client:
        yield client


class _LimitedClient(Client):
    """Gives up on a port that accepts and stays silent: Dask's handshake has no time limit."""

    async def _start(self, timeout: float, **options: Any) -> Client:
        try:
            return await asyncio.wait_for(super()._start(timeout=timeout, **options), timeout)
        except Exception as error:
            await self._close()  # else it complains when it is collected
            if isinstance(error, TimeoutError) and not str(error):
                raise TimeoutError(f"no answer within {timeout:g} s") from None
            raise


class Workers:
    """Connected workers, see `workers`."""

    def __init__(
        self, client: Client, prepare: Callable[[], None] | None, say: Callable[[str], None]
    ) -> None:
        self._client, self._prepare, self._say = client, prepare, say
        self._name = f"flight-{uuid.uuid4().hex[:8]}"
        self._submitted = 0

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
        self._futures: dict[int, Future] = {}
        self._finished: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._alive = self._looked = self._staffed = time.monotonic()
        self._told, self._threads = False, self.threads()
        self._expected = identity()
        window = Window(items, per_worker)
        try:
            while True:
                if self._client.status == "closed":
                    raise WorkersError("the connection to the scheduler is lost")
                for number, item in window.fill(self._threads):
                    self._submit(work, number, item)
                if not window:
                    return
                received = self._receive(window)
                if received is not None:
                    yield received
                if time.monotonic() - self._looked >= POLL:
                    self._look()
                    idle()
        finally:
            left = list(self._futures.values())
            if left:
                with contextlib.suppress(Exception):
                    self._client.cancel(left, force=True)

    def threads(self) -> int:
        """Return the present number of threads of all workers."""
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError):  # no scheduler at present
            return 0

    def _submit(self, work: Callable[[Any], Any], number: int, item: Any) -> None:
        self._submitted += 1
        given = work, item, self._expected, self._prepare
        key = f"{self._name}-{self._submitted}"
        future = self._client.submit(run_item, *given, key=key, pure=False)
        self._futures[number] = future
        finished = self._finished  # of this call of `completed`
        future.add_done_callback(lambda _: finished.put(number))

    def _receive(self, window: Window) -> tuple[int, Any] | None:
        """Return number and result of an item; None if there is none yet, or if it was lost."""
        try:
            number = self._finished.get(timeout=POLL)
        except queue.Empty:
            return None
        future = self._futures.pop(number)
        if future.status == "error":
            _failed(window, future.exception(), number)
            return None
        try:
            result = future.result(RECEIVING)
        except (TimeoutError, CancelledError):  # its worker was lost with it
            future.cancel()
            _failed(window, None, number)
            return None
        window.done(number)
        return number, result

    def _look(self) -> None:
        """Notice a change of the number of workers, and a lost scheduler."""
        now = self._looked = time.monotonic()
        if self._client.status == "running":
            self._alive = now
            self._threads = self.threads()
        elif now - self._alive > GONE:
            raise WorkersError("the connection to the scheduler is lost")
        if self._threads:
            self._staffed, self._told = now, False
        elif now - self._staffed > WAITING and not self._told:
            self._say("waiting for a worker")
            self._told = True


def _failed(window: Window, error: BaseException | None, number: int) -> None:
    """Have a lost item computed again; raise every other error. error: None if it was lost."""
    if error is None or isinstance(error, KilledWorker):
        if not window.lost(number):
            raise WorkersError(f"{number}: every worker that began it was lost")
    elif isinstance(error, ModuleNotFoundError):
        raise WorkersError(f"a worker cannot import {error.name}: install uam there") from error
    else:
        raise error
