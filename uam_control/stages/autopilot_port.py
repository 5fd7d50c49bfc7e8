"""The interface between the bridge and an autopilot.

| port | used by |
|---|---|
| `mavlink.link.link.OffboardLink` | the bridge's node: MAVLink over UDP, TCP or a serial line |
| `autopilot.joined.JoinedAutopilot` | the direct engine: the stand-in's object, without messages |
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from uam_control.offboard.modes import Mode
from uam_control.setpoints.desired import Target
from uam_control.setpoints.vision_pose import VisionPose


class PortSteps(NamedTuple):
    """Compiled methods of a port to an autopilot in the same process, on the `arrays` of the port.

    now [s]: of the tick. ready(a, now): whether messages come and setpoints go as usual; poll(a,
    now); send_vision(a, exposed, pose): exposed [s], pose (7,): position [m, ENU] and quaternion
    [w x y z]; send_setpoint(a, now, rates, thrust): rates (3,) [rad/s, FLU].
    """

    ready: Callable
    poll: Callable
    send_vision: Callable
    send_setpoint: Callable


class AutopilotPort(Protocol):
    """The autopilot's latest reported state, and the messages to it.

    All times are those of control ticks [s]. The answer to a message arrives one tick later at the
    earliest.
    """

    armed: bool
    mode: Mode
    landed: bool
    intended: Mode  # chosen last by a person or a companion; UNKNOWN if not reported
    failsafe: bool  # the autopilot flies its own failsafe
    killed: bool  # the kill switch or flight termination holds the motors
    armed_since: float | None  # [s] tick at which it was first known armed; None while it is not
    steps: PortSteps | None  # None: has none now

    def connected(self, time: float) -> bool:
        """Whether the last heartbeat is younger than DISCONNECTED at `time` [s]."""
        ...

    def silent(self, time: float) -> bool:
        """Whether nothing has come from it for `loss_time` at `time` [s], after a first message.

        If the link is cut in both directions, its failsafe has begun.
        """
        ...

    @property
    def loss_time(self) -> float:
        """For how long [s] the autopilot stays in OFFBOARD without setpoints: COM_OF_LOSS_T."""
        ...

    @property
    def round_trip(self) -> float | None:
        """Shortest round trip [s] of the latest messages; None if unknown."""
        ...

    def poll(self, time: float) -> None:
        """Receive the messages that have arrived by the tick `time` [s]."""
        ...

    def tick(self, time: float) -> None:
        """Send the heartbeat and the sequence's requests that are due at `time` [s]."""
        ...

    def send_vision(self, pose: VisionPose) -> None:
        """Send a mocap pose."""
        ...

    def send_setpoint(self, target: Target, time: float) -> None:
        """Send the setpoint of the tick `time` [s]."""
        ...
