"""Processes that stand for hardware go ahead of all ordinary ones.

A servo or a flight controller answers whatever the companion computer does. Emulated on the same
cores it would take turns with the nodes: each answer of the servo bus waited some milliseconds for
a core, and the bus carried half of its rate.
"""

import os
import resource
from pathlib import Path

PRIORITY = 70  # of SCHED_FIFO, 1..99; above those of docs/hardware.md for nodes
TASKS = Path("/proc/self/task")


def prefer() -> int:
    """Put all threads of this process ahead; return their priority, 0 where it is not permitted."""
    permitted = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    priority = PRIORITY if os.geteuid() == 0 else min(PRIORITY, permitted)
    if priority < 1:
        return 0
    for task in TASKS.iterdir():
        try:
            os.sched_setscheduler(int(task.name), os.SCHED_FIFO, os.sched_param(priority))
        except ProcessLookupError:  # the thread has ended
            continue
        except OSError:
            return 0
    return priority
