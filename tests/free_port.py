"""A free port for a test."""

import os
from itertools import count

from uam_sim_bridge.ports import KINDS, in_use

# Above the ports that the system gives to whoever asks for any one, the middleware among them: one
# of those may be taken again before the test has bound it.
FIRST, LAST = 61000, 65535
_numbers = count(os.getpid() * 97)  # tests that run at once begin apart


def free_port() -> int:
    """Return a port of this machine that is free for TCP and UDP, another one at each call."""
    ports = (FIRST + number % (LAST - FIRST + 1) for number in _numbers)
    return next(port for port in ports if not any(in_use(kind, port) for kind in KINDS.values()))
