"""This process: scheduler, cores, locked memory by `ProcessParameters`; when it collects garbage.

Each function raises ParameterError in one line with the way to allow what the system refuses. The
scheduler and the cores are set for every thread: Fast DDS receives in threads of its own.

Python collects at any allocation, also in the middle of a tick. A node's own objects are frozen at
its start, so that a collection has only the few objects since then to look at.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from uam_control.settings.parameter_set import ParameterError
from uam_control.settings.process_parameters import ProcessParameters, cores_of

LIMITS = "/etc/security/limits.d/99-uam.conf"
MCL_CURRENT, MCL_FUTURE = 1, 2  # of sys/mman.h
TASKS = Path("/proc/self/task")


def apply(options: ProcessParameters) -> None:
    """Apply the options to all threads of this process. Raises ParameterError."""
    if cores := cores_of(options.cores):
        allowed = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
        _for_each_thread(
            lambda thread: os.sched_setaffinity(thread, cores),
            f"cores: {options.cores}; this process may use {allowed}",
        )
    if options.fifo_priority:
        rule = os.sched_param(options.fifo_priority)
        _for_each_thread(
            lambda thread: os.sched_setscheduler(thread, os.SCHED_FIFO, rule),
            f"fifo_priority: {options.fifo_priority} is not permitted; allow it: "
            f"'@dialout - rtprio 80' in {LIMITS} and log in again, or CAP_SYS_NICE",
        )
    if options.nice:
        _for_each_thread(
            lambda thread: os.setpriority(os.PRIO_PROCESS, thread, options.nice),
            f"nice: {options.nice} is not permitted; allow it: '@dialout - nice -20' in {LIMITS} "
            "and log in again, or CAP_SYS_NICE",
        )
    if options.lock_memory:
        _lock_memory()


def _for_each_thread(change: Callable[[int], None], refusal: str) -> None:
    for task in TASKS.iterdir():
        try:
            change(int(task.name))
        except ProcessLookupError:  # the thread has ended
            continue
        except (OSError, ValueError) as error:
            raise ParameterError(f"{refusal} ({getattr(error, 'strerror', error)})") from None


def _lock_memory() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        return
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    raise ParameterError(
        f"lock_memory: only {limit / 1e6:.0f} MB may be locked; allow it: "
        f"'@dialout - memlock unlimited' in {LIMITS} and log in again, or CAP_IPC_LOCK "
        f"({os.strerror(ctypes.get_errno())})"
    )


def try_out(options: ProcessParameters) -> None:
    """Apply the options in a process of its own that ends at once. Raises ParameterError.

    A flight is refused by this before it starts any node.
    """
    if options == ProcessParameters():
        return
    command = [sys.executable, "-m", __name__, json.dumps(options.to_mapping())]
    tried = subprocess.run(command, capture_output=True, text=True, check=False, encoding="utf-8")
    if tried.returncode:
        said = (tried.stderr or tried.stdout).strip().splitlines()
        raise ParameterError(said[-1] if said else f"exit status {tried.returncode}")


if __name__ == "__main__":  # of `try_out`
    try:
        apply(ProcessParameters.from_mapping(json.loads(sys.argv[1])))
    except ParameterError as error:
        sys.exit(str(error))


class GarbageCollection:
    """Takes collection over from Python. Context manager: Python collects again after the block."""

    def __init__(self, between_ticks: bool = True):
        """between_ticks: False leaves the moment to Python."""
        self._between_ticks = between_ticks

    def __enter__(self) -> GarbageCollection:
        gc.collect()
        gc.freeze()  # excludes the existing objects from collections in flight
        if self._between_ticks:
            gc.disable()
        return self

    def __exit__(self, *exception) -> None:
        gc.enable()

    def at_rest(self) -> None:
        """Collect the oldest generation that is due, by Python's own thresholds; called at rest."""
        if not self._between_ticks:
            return
        due = [
            generation
            for generation, (count, threshold) in enumerate(
                zip(gc.get_count(), gc.get_threshold(), strict=True)
            )
            if threshold and count > threshold
        ]
        if due:
            gc.collect(due[-1])
