"""Checks of the machine: cores, memory, and timer accuracy for `--clock realtime`."""

import os
import time
from collections.abc import Iterator

import numpy as np
import psutil

from uam_lab.flights.processes.shared_memory import shortage
from uam_lab.preflight.doctor.finding import Finding, fail, ok, warn

TICK = 0.004  # [s] control period
SLEEPS = 250
CORES = 2  # nine processes need about 1.3 in real time
MEMORY = 2.0  # [GiB]


def checks() -> Iterator[Finding]:
    yield cores(len(os.sched_getaffinity(0)), os.getloadavg()[0])
    yield memory(psutil.virtual_memory().available / 2**30)
    yield shared(shortage())
    yield timer(oversleep())


def cores(count: int, load: float) -> Finding:
    """Check the number of usable cores (count) and the load of the last minute."""
    found = f"{count} core{'s' * (count > 1)}, load {load:.1f}"
    if count < CORES:
        return warn("cores", found, f"real time needs {CORES}: fly --clock lockstep")
    if load > count:
        return warn(
            "cores",
            f"{found}: other programs use the processor",
            "real-time flights will miss ticks; lockstep flights take longer",
        )
    return ok("cores", found)


def memory(free: float) -> Finding:
    """Check that the available memory is enough for a flight and its report; free [GiB]."""
    found = f"{free:.1f} GiB available"
    if free < MEMORY:
        return warn(
            "memory",
            found,
            f"a flight with its report needs {MEMORY:g} GiB: --no-video, or end other programs",
        )
    return ok("memory", found)


def shared(shortage: str) -> Finding:
    """Check the room for shared memory; shortage: see `shared_memory.shortage`."""
    if shortage:
        found, _, advice = shortage.partition("; ")
        return fail("shared memory", found, advice)
    return ok("shared memory", "room in /dev/shm")


def oversleep(count: int = SLEEPS, tick: float = TICK) -> np.ndarray:
    """Return by how much each of `count` sleeps of `tick` [s] was too long, (count,) [s]."""
    late = np.empty(count)
    for i in range(count):
        begun = time.perf_counter()
        time.sleep(tick)
        late[i] = time.perf_counter() - begun - tick
    return late


def timer(late: np.ndarray) -> Finding:
    """Check the timer for real-time flights; late (n,) [s]: see `oversleep`."""
    median, most = 1e3 * np.quantile(late, (0.5, 0.99))
    found = (
        f"a {1e3 * TICK:g} ms sleep ends {median:.2f} ms late (median), {most:.2f} ms "
        f"(99th percentile of {len(late)})"
    )
    if most > 1e3 * TICK:
        return warn(
            "timer",
            f"{found}: more than a control period",
            "--clock realtime will miss ticks here; use --clock lockstep",
        )
    return ok("timer", f"{found}: accurate enough for real time")
