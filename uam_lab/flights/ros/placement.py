"""Cores of the processes of a lockstep flight.

In lockstep the processes of a tick wait for each other. A wake-up on the same core is cheaper than
one on another core, and the caches are warm. So what computes between sensors and setpoint has one
core, all others share a second one. Recorder, scene and cockpit do not interrupt those that the
tick waits for (SCHED_BATCH), and are interrupted by them (nice). Where the nodes that fly have a
real-time priority, plant and autopilot have it, too: they wait for each other.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence

from uam_lab.flights.flight_options import BUILTIN, ONLOOKERS
from uam_lab.flights.flight_settings import AUTOPILOT, FlightSettings
from uam_msgs_py.node import wiring

FIRST_CORE = {
    wiring.FLIGHT_CONTROLLER,
    *(wiring.ESTIMATOR, wiring.POSITION, wiring.ATTITUDE, wiring.WHOLE_BODY, wiring.BRIDGE),
}
YIELDING = {wiring.RECORDER, *ONLOOKERS}
ANSWERING = {wiring.PLANT, AUTOPILOT}
NICE = 10  # of those that yield: a tenth of the core where the tick does not leave it to them


def pair(usable: Sequence[int], instance: int) -> tuple[int, int] | None:
    """Return two of the usable cores, other ones for the next instance; None if there is one."""
    if len(usable) < 2:
        return None
    first = 2 * instance % len(usable)
    return usable[first], usable[(first + 1) % len(usable)]


def placing(settings: FlightSettings, instance: int, name: str) -> Callable[[int], None]:
    """Return what places the process `name`, by its id, right after its start.

    It does nothing in real time, with an autopilot of its own threads, or with cores that the user
    has chosen (`--cores`).
    """
    cores = pair(sorted(os.sched_getaffinity(0)), instance)
    lockstep = settings.clock == "lockstep" and settings.autopilot == BUILTIN
    if cores is None or not lockstep or settings.process.cores:
        return lambda process: None

    def place(process: int) -> None:
        with contextlib.suppress(OSError):  # it has ended, or the system does not permit it
            os.sched_setaffinity(process, {cores[name not in FIRST_CORE]})
            if settings.process.fifo_priority and name in ANSWERING:
                priority = os.sched_param(settings.process.fifo_priority)
                os.sched_setscheduler(process, os.SCHED_FIFO, priority)
            if name in YIELDING:
                os.sched_setscheduler(process, os.SCHED_BATCH, os.sched_param(0))
                given = os.getpriority(os.PRIO_PROCESS, process)
                os.setpriority(os.PRIO_PROCESS, process, max(NICE, given))

    return place
