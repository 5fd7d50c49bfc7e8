"""What a flight in lockstep waits for, said by name: a process that is stopped, a slow answer."""

from __future__ import annotations

import time

from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.processes import Processes
from uam_lab.flights.ros.status_listener import StatusListener
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_msgs_py.node.namespace import prefix
from uam_msgs_py.node.polling import listen
from uam_sim_bridge.nodes.plant_health import TICKS, WAITING
from uam_sim_bridge.patience import Patience

LONGEST_STOP = 60.0  # [s] a process may be stopped; no time limit for one that runs
LOOK_PERIOD = 0.5  # [s] between two looks at the processes
SAY_PERIOD = 10.0  # [s] between two lines


class Waits:
    """Call `look` often: it says what the plant waits for."""

    def __init__(self, children: Processes, listener: StatusListener, observer: Observer) -> None:
        self._children, self._observer = children, observer
        self._door = listener.door
        self._plant = prefix(listener.node.get_namespace()) + wiring.PLANT
        self._diagnostics = listen(listener.node, topics.DIAGNOSTICS)
        self._patience: dict[str, Patience] = {}  # of the stopped processes
        self._due = self._said = 0.0  # [s] time.monotonic()

    def look(self) -> None:
        """Say what is waited for; raise NodeFailed for a process that stays stopped."""
        now = time.monotonic()
        for message in self._door.messages(self._diagnostics):
            for status in message.status:
                begun = any(one.key == TICKS and one.value != "0" for one in status.values)
                if status.name == self._plant and status.message.startswith(WAITING) and begun:
                    self._say(f"the flight is {status.message}")
        if now < self._due:
            return
        self._due = now + LOOK_PERIOD
        stopped = self._children.stopped()
        self._patience = {
            one.name: self._patience.get(one.name) or Patience(LONGEST_STOP) for one in stopped
        }
        for one in stopped:
            left = self._patience[one.name].left
            if not left:
                raise one
            self._say(f"{one.name} is stopped (SIGSTOP): the flight waits {left:.0f} s for it")

    def _say(self, text: str) -> None:
        now = time.monotonic()
        if now - self._said >= SAY_PERIOD:
            self._said = now
            self._observer.message(text)
