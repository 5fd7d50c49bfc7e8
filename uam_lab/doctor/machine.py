"""The machine: cores, memory, and whether a process is woken in time for `--clock realtime`."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import numpy as np
import psutil

from uam_lab.doctor.finding import Finding, ok, warn

TICK = 0.004  # [s] control period
SLEEPS = 250
CORES = 2  # nine processes need about 1.3 in real time
MEMORY = 2.0  # [GiB]


def checks() -> Iterator[Finding]:
    """Findings about the machine."""
    yield cores(len(os.sched_getaffinity(0)), os.getloadavg()[0])
    yield memory(psutil.virtual_memory().available / 2**30)
    yield timer(oversleep())


def cores(count: int, load: float) -> Finding:
    """count: cores that this process may use; load: of the last minute."""
    found = f"{count} core{'s' * (count > 1)}, load {load:.1f}"
    if count < CORES:
        return warn("cores", found, f"real time needs {CORES}: fly --clock lockstep")
    if load > count:
        return warn(
            "cores",
            f"{found}: others keep it busy",
            "real-time flights will miss ticks; lockstep flights take longer",
        )
    return ok("cores", found)


def memory(free: float) -> Finding:
    """Whether a flight and its report fit into the available memory; free [GiB]."""
    found = f"{free:.1f} GiB available"
    if free < MEMORY:
        return warn(
            "memory",
            found,
            f"a flight with its report wants {MEMORY:g} GiB: --no-video, or end other programs",
        )
    return ok("memory", found)


def oversleep(count: int = SLEEPS, tick: float = TICK) -> np.ndarray:
    """How much longer than `tick` [s] each of `count` sleeps took [s]."""
    late = np.empty(count)
    for i in range(count):
        begun = time.perf_counter()
        time.sleep(tick)
        late[i] = time.perf_counter() - begun - tick
    return late


def timer(late: np.ndarray) -> Finding:
    """Whether real time is sensible; late (n,) [s]."""
    median, most = 1e3 * np.quantile(late, (0.5, 0.99))
    found = (
        f"a {1e3 * TICK:g} ms sleep ends {median:.2f} ms late (median), {most:.2f} ms "
        f"(99th percentile of {len(late)})"
    )
    if most > 1e3 * TICK:
        return warn(
            "timer",
            f"{found}: more than a control period",
            "--clock realtime will miss ticks here; lockstep does not mind",
        )
    return ok("timer", f"{found}: real time is sensible")
