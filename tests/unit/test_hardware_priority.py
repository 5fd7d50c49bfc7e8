"""Processes that stand for hardware go ahead of ordinary ones, where it is permitted."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys

import pytest

from uam_sim_bridge.hardware_priority import PRIORITY

PERMITTED = os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] >= PRIORITY
PROGRAM = """
import json, os, threading
from uam_sim_bridge import hardware_priority
{before}
stay = threading.Event()
threading.Thread(target=stay.wait, daemon=True).start()
given = hardware_priority.prefer()
threads = [int(name) for name in os.listdir("/proc/self/task")]
print(json.dumps([given, [os.sched_getscheduler(one) for one in threads]]))
"""


def ran(before=""):
    """Return the given priority and the scheduler of each thread of another process."""
    command = [sys.executable, "-c", PROGRAM.format(before=before)]
    given, schedulers = json.loads(subprocess.check_output(command, text=True, timeout=60))
    assert len(schedulers) >= 2
    return given, set(schedulers)


@pytest.mark.skipif(not PERMITTED, reason="no real-time priority for this user: ulimit -r")
def test_every_thread_goes_ahead():
    assert ran() == (PRIORITY, {os.SCHED_FIFO})


def test_without_permission_everything_stays_as_it_is():
    refused = (
        "os.geteuid = lambda: 1\nimport resource\n"
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))"
    )
    assert ran(refused) == (0, {os.SCHED_OTHER})
