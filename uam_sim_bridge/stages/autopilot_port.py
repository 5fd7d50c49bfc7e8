"""What the bridge needs of an autopilot, whatever is between them.

| port | used by |
|---|---|
| `mavlink.link.link.OffboardLink` | the bridge's node: MAVLink over UDP, TCP or a serial line |
| `autopilot.joined.JoinedAutopilot` | the direct engine: the stand-in's object, without messages |
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uam_sim_bridge.mavlink.protocol.attitude_target import AttitudeTarget
from uam_sim_bridge.mavlink.protocol.modes import Mode


class AutopilotPort(Protocol):
    """The autopilot's newest report, and the way to it.

    All times are those of control ticks [s]. What is sent at a tick is answered at the next one,
    at the earliest.
    """

    armed: bool
    mode: Mode
    landed: bool
    armed_since: float | None  # [s] tick at which it was first known armed; None while it is not

    def connected(self, time: float) -> bool:
        """Whether a heartbeat came within the last seconds."""
        ...

    @property
    def round_trip(self) -> float | None:
        """How long its answers take [s], the quickest of late; None where not known."""
        ...

    def poll(self, time: float) -> None:
        """Take everything that has arrived, at the tick `time` [s]."""
        ...

    def tick(self, time: float) -> None:
        """Send what is due besides vision and setpoint: heartbeat and the sequence's requests."""
        ...

    def send_vision(
        self,
        stamp: float,
        position: np.ndarray,
        quaternion: np.ndarray,
        position_deviation: float,
        attitude_deviation: float,
    ) -> None:
        """Send a pose exposed at `stamp` [s]: position (3,) [m, ENU], FLU → ENU [w x y z].

        Deviations: standard deviations [m], [rad].
        """
        ...

    def send_setpoint(self, target: AttitudeTarget, time: float) -> None:
        """Send the setpoint of the tick `time` [s]."""
        ...
