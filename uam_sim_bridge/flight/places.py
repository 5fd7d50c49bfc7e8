"""The places of killed nodes in the ROS domain, which nobody is to take over.

A participant's place is the number by which the middleware counts its ports. One that is started
takes the lowest that is free: that of the killed one. The others go on writing into the dead one's
queue in shared memory for seconds. With its discovery port occupied the new one has a queue of its
own, and is heard at once.
"""

from __future__ import annotations

import socket

from uam_sim_bridge.flight.ports import discovery_port

PLACES = 120  # that fit a domain's range of ports


class Places:
    """A context manager; what is occupied stays so until its end."""

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._held: list[socket.socket] = []

    def occupy(self) -> None:
        """Take the place that the next participant would get."""
        for number in range(PLACES):
            taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            try:
                taken.bind(("127.0.0.1", discovery_port(self._domain, number)))
            except OSError:
                taken.close()
                continue
            self._held.append(taken)
            return

    def __enter__(self) -> Places:
        return self

    def __exit__(self, *exception) -> None:
        for taken in self._held:
            taken.close()
