"""The autopilot's IMU on /imu/data, for a vehicle without an IMU of its own on the companion."""

from __future__ import annotations

import time

from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import ImuWriter
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.namespace import frame
from uam_sim_bridge.mavlink.link.link import OffboardLink

SILENT = 0.1  # [s] after the newest tick from which this serves the link
WAKE_UP = 0.001  # [s] of wall time between two looks at the link: no other message announces it


class CompanionClock:
    """The clock of the other sensors' stamps: the system's, or the topic /clock of a simulator."""

    def __init__(self, node: UamNode, simulated: bool) -> None:
        """simulated: listen to /clock."""
        self._simulated, self._stamp = simulated, 0
        if simulated:
            node.listen(topics.CLOCK, self._on_clock, required=False)

    def _on_clock(self, data: bytes) -> None:
        self._stamp = stamp_of(data)

    def now(self) -> float:
        """Return the time [s]; 0 before the first message of /clock."""
        return self._stamp / SECOND if self._simulated else time.time()


class AutopilotImuTopic:
    """Publishes the samples as they arrive. Before the first tick it also serves the link."""

    def __init__(self, node: UamNode, link: OffboardLink, clock: CompanionClock) -> None:
        self._link, self._clock = link, clock
        self._publisher = node.publisher(topics.IMU)
        self._writer = ImuWriter(frame(node, topics.BODY))
        self._count = 0

    def serve(self, tick: int | None) -> None:
        """Receive from the link and publish; tick [ns]: the newest, None before the first.

        The ticks send heartbeats and requests. Without ticks this does: a tick needs a sample, and
        a sample needs those, before the first tick and after a reboot of the autopilot.
        """
        now = self._clock.now()
        ticking = tick is not None and now - tick / SECOND < SILENT
        if ticking:
            now = tick / SECOND
        if now <= 0.0:
            return
        self._link.poll(now)
        if not ticking:
            self._link.maintain(now)
        for stamp, gyro, force in self._link.imu.samples():
            self._count += 1
            self._publisher.publish(self._writer.fill(stamp, gyro, force))

    def values(self) -> dict[str, object]:
        """Return the values for /diagnostics."""
        return {"IMU samples": self._count, "IMU samples refused": self._link.imu.refused}
