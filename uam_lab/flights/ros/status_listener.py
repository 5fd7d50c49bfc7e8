"""Receives the status of a flight for the progress display: two topics, twice a second."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile

from uam_control.stamps import SECOND
from uam_lab.flights.observer import FlightStatus
from uam_lab.flights.processes.guest import Guest
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import AutopilotState, MissionStatus
from uam_msgs_py.node import wiring
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.polling import listen
from uam_msgs_py.node.rightful import RightfulNodes

# The topic keeps one message; here no change of phase may be lost between two polls.
EVERY_STATUS = QoSProfile(
    depth=topics.DEPTH,
    reliability=topics.MISSION_STATUS.qos.reliability,
    durability=topics.MISSION_STATUS.qos.durability,
)


class StatusListener(Guest):
    """Context manager with a node in a separate ROS context; polled, so it needs no executor."""

    def __init__(
        self,
        environment: Mapping[str, str],
        domain: int,
        namespace: str = "",
        arguments: Sequence[str] = (),
        publishers: str = "",
    ):
        """See `Guest`; publishers: the parameter of that name of the flight's nodes."""
        super().__init__(wiring.FLIGHT, environment, domain, namespace, arguments)
        self._mission = listen(self.node, topics.MISSION_STATUS, EVERY_STATUS)
        self._autopilot = listen(self.node, topics.AUTOPILOT_STATE)
        rightful = RightfulNodes(self.node.get_namespace(), publishers)
        self.door = Door(self.node, tells=True)
        self.door.guard(self._mission, topics.MISSION_STATUS.name, rightful, lambda: False)
        self.door.guard(self._autopilot, topics.AUTOPILOT_STATE.name, rightful, lambda: False)
        self._state = AutopilotState()
        self._heard = False  # whether the autopilot's state is known
        self._last: tuple[float, float] | None = None  # simulated and wall time [s]
        self.newest: list[FlightStatus] = []  # at most one
        self.stamp, self.mission_time = 0, None  # [ns], [s] of the newest status after take-off
        self.phase = ""  # of that status

    def poll(self) -> list[FlightStatus]:
        """Return the status messages received since the last call."""
        for _, state in self.door.decoded(self._autopilot, AutopilotState.from_message):
            self._state, self._heard = state, True
        found = list(self.door.decoded(self._mission, self._status))
        self.newest = found[-1:] or self.newest
        return found

    def _status(self, message: DiagnosticArray) -> FlightStatus:
        stamp, mission = MissionStatus.from_message(message)
        if mission.time >= 0.0:
            self.stamp, self.mission_time, self.phase = stamp, mission.time, mission.phase
        state = self._state
        reasons = f": {state.reasons}" if state.reasons else ""
        return FlightStatus(
            phase=mission.phase,
            time=mission.time,
            position_error=mission.position_error,
            attitude_error=mission.attitude_error,
            arm_error=mission.arm_error,
            tilt=mission.tilt,
            real_time_factor=self._real_time_factor(stamp / SECOND),
            autopilot=f"{state.summary}{reasons}" if self._heard else "",
            state=mission.state,
            cause=mission.cause,
            released_to=state.released_to,
            done=mission.done,
        )

    def _real_time_factor(self, simulated: float) -> float:
        """Return simulated time / wall time since the first status."""
        wall = time.monotonic()
        if self._last is None:
            self._last = simulated, wall
        since = wall - self._last[1]
        return (simulated - self._last[0]) / since if since > 0.0 else 0.0
