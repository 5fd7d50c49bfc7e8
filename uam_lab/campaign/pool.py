"""Flies the trials of a campaign in parallel processes, one per core unless told otherwise."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed

from uam_lab.campaign.trial import Trial, TrialResult, fly
from uam_lab.flight.direct.warm_up import is_cold, warm_up
from uam_lab.processes.child import SINGLE_THREAD


def cores() -> int:
    """How many processes may run at once on this machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def fly_all(
    trials: Sequence[Trial],
    jobs: int,
    work: Callable[[Trial], TrialResult] | None = None,
    progress: Callable[[int, TrialResult], None] = lambda done, result: None,
) -> list[TrialResult]:
    """Fly every trial; results in the order of the trials, whatever order they finished in.

    work: what a process does with a trial (default: fly it, keep the figures); must be importable.
    progress: called with the number of flights done and the newest result.
    """
    if is_cold():
        warm_up()
    work = work or figures_of
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
            # Those that fly now, and the next ones, would otherwise be waited for.
            for worker in multiprocessing.active_children():
                if worker not in others:
                    worker.terminate()
            raise
    return results


def figures_of(trial: Trial) -> TrialResult:
    """Fly; the time series is thrown away."""
    return fly(trial)[0]


def _executor(jobs: int) -> ProcessPoolExecutor:
    """Fresh processes of one thread each, deaf to Ctrl-C, which is for the main process."""
    for name, threads in SINGLE_THREAD.items():
        os.environ.setdefault(name, threads)
    return ProcessPoolExecutor(
        jobs, mp_context=multiprocessing.get_context("spawn"), initializer=prepare_worker
    )


def prepare_worker() -> None:
    """Make this child process deaf to Ctrl-C, and end it with the main process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent is gone, however that happened: by itself none does."""
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)
