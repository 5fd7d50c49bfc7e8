"""Starts the mission of a rehearsal as a person does: when the lists have passed, `uam start`."""

import threading
import time
from collections.abc import Callable
from typing import Self

from uam_lab.flights.operator import DECODE, NoFlight, Operator
from uam_lab.flights.processes.guest import Guest
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import PASSED
from uam_msgs_py.node import polling
from uam_msgs_py.node.door import Door

LOOK = 0.2  # [s] between two looks
AGAIN = 1.0  # [s] between two requests to start
PATIENCE = 60.0  # [s] without progress until the start counts as refused


class Starter(threading.Thread):
    """Context manager. `started`: the mission has accepted; `refused`: why not, "" while it tries.

    `waits_for`: what it waits for now, one line.
    """

    def __init__(self, guest: Callable[[str], Guest], checklist: bool) -> None:
        """guest: returns a node in the flight's ROS domain, by its name; checklist: wait for the
        lists."""
        super().__init__(name="starter", daemon=True)
        self._guest, self._required = guest, checklist
        self._ended = threading.Event()
        self.started, self.refused, self.waits_for = False, "", "the nodes"

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.join()

    def run(self) -> None:
        """Watch the lists, request the start."""
        with self._guest("uam_rehearse") as guest:
            lists = polling.listen(guest.node, topics.CHECKLIST)
            operator, door = Operator(guest.node), Door(guest.node, tells=True)
            passed, most = not self._required, -1
            progress, asked = time.monotonic(), 0.0
            while not self._ended.wait(LOOK) and not self.started:
                now = time.monotonic()
                for (_, state), items in door.decoded(lists, DECODE[topics.CHECKLIST]):
                    passed, self.waits_for = passed or state.passed, state.summary
                    count = sum(item.result == PASSED for item in items)
                    if count > most:  # not those that come and go
                        most, progress = count, now
                if now - progress > PATIENCE:
                    self.refused = self.waits_for
                    return
                if passed and now - asked >= AGAIN:
                    asked = now
                    try:
                        self.started, self.waits_for = operator.command("start")
                    except NoFlight as error:
                        self.waits_for = str(error)
