"""Flies the trials of a campaign in parallel processes, by default one per core."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed

from uam_lab.campaign.trial import Trial, TrialResult, measure
from uam_lab.flight.direct.warm_up import prepare
from uam_lab.processes.child import SINGLE_THREAD


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def fly_all(
    trials: Sequence[Trial],
    jobs: int,
    work: Callable[[Trial], TrialResult] = measure,
    progress: Callable[[int, TrialResult], None] = lambda done, result: None,
) -> list[TrialResult]:
    """Fly every trial; return the results in the order of the trials.

    work: importable function from trial to result. progress: called with the number of finished
    flights and the newest result.
    """
    prepare()
    results: list[TrialResult | None] = [None] * len(trials)
    others = multiprocessing.active_children()
    with _executor(jobs) as executor:
        waiting = {executor.submit(work, trial): i for i, trial in enumerate(trials)}
        try:
            for done, future in enumerate(as_completed(waiting), 1):
                result = results[waiting[future]] = future.result()
                progress(done, result)
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            # without this the executor waits for the running and the next trials
            for worker in multiprocessing.active_children():
                if worker not in others:
                    worker.terminate()
            raise
    return results


def _executor(jobs: int) -> ProcessPoolExecutor:
    """Return an executor of new single-threaded processes, each set up by `prepare_worker`."""
    for name, threads in SINGLE_THREAD.items():
        os.environ.setdefault(name, threads)
    return ProcessPoolExecutor(
        jobs, mp_context=multiprocessing.get_context("spawn"), initializer=prepare_worker
    )


def prepare_worker() -> None:
    """Ignore Ctrl-C in this child process (the main process handles it); end it with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent has ended; otherwise it would continue to run."""
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)
