"""Worker processes of this machine: Dask's scheduler in this process, one thread in each worker."""

import contextlib
import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import dask.config
from distributed import LocalCluster

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
