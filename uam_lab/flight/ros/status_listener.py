"""Receives the status of a flight for the progress display: two topics, twice a second."""

from __future__ import annotations

import time
from collections.abc import Mapping

from uam_control.stamps import SECOND
from uam_lab.flight.progress import Status
from uam_lab.processes.guest import Guest
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import AutopilotState, MissionStatus
from uam_msgs_py.node.polling import listen, messages


class StatusListener(Guest):
    """Context manager with a node in a separate ROS context; polled, so it needs no executor."""

    def __init__(self, environment: Mapping[str, str], domain: int):
        """environment: of the flight's processes; ROS reads some of its variables here too."""
        super().__init__("uam_fly", environment, domain)
        self._mission = listen(self.node, topics.MISSION_STATUS)
        self._autopilot = listen(self.node, topics.AUTOPILOT_STATE)
        self._autopilot_text = ""
        self._last: tuple[float, float] | None = None  # simulated and wall time [s]
        self.stamp, self.mission_time = 0, None  # [ns], [s] of the newest status after take-off

    def poll(self) -> Status | None:
        """Return the newest status, None without a new one since the last call."""
        for message in messages(self._autopilot):
            _, state = AutopilotState.from_message(message)
            reasons = f": {state.reasons}" if state.reasons else ""
            self._autopilot_text = f"{state.summary}{reasons}"
        newest = None
        for message in messages(self._mission):
            newest = message
        if newest is None:
            return None
        stamp, mission = MissionStatus.from_message(newest)
        if mission.time >= 0.0:
            self.stamp, self.mission_time = stamp, mission.time
        return Status(
            phase=mission.phase,
            time=mission.time,
            position_error=mission.position_error,
            attitude_error=mission.attitude_error,
            arm_error=mission.arm_error,
            real_time_factor=self._real_time_factor(stamp / SECOND),
            autopilot=self._autopilot_text,
        )

    def _real_time_factor(self, simulated: float) -> float:
        """Return simulated time / wall time since the first status."""
        wall = time.monotonic()
        if self._last is None:
            self._last = simulated, wall
        since = wall - self._last[1]
        return (simulated - self._last[0]) / since if since > 0.0 else 0.0
