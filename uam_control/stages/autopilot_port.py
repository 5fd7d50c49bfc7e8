"""The interface between the bridge and an autopilot, and the bridge's report of it.

| port | used by |
|---|---|
| `mavlink.link.link.OffboardLink` | the bridge's node: MAVLink over UDP, TCP or a serial line |
| `autopilot.joined.JoinedAutopilot` | the direct engine: the stand-in's object, without messages |
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

from uam_control.maths.memory import Number, record
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.setpoints.loop_delay import LoopDelay
from uam_control.setpoints.targets import Target, VisionPose
from uam_control.stamps import SECOND, nanoseconds

REPORT_PERIOD = 200_000_000  # [ns]
KILL_SWITCH = "the kill switch is engaged, or flight termination is active"


class PortSteps(NamedTuple):
    """Compiled methods of a port to an autopilot in this process, on its `arrays`."""

    ready: Callable  # (a, now): whether messages come and setpoints go as usual
    poll: Callable  # (a, now [s])
    send_vision: Callable  # (a, exposed [s], pose (7,): position [m, ENU], quaternion [w x y z])
    send_setpoint: Callable  # (a, now, rates (3,) [rad/s, FLU], thrust)


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

    def silent(self, time: float) -> bool:
        """Whether nothing has come from it for `loss_time` at `time` [s], after a first message.

        If the link is cut in both directions, its failsafe has begun.
        """

    @property
    def loss_time(self) -> float:
        """For how long [s] the autopilot stays in OFFBOARD without setpoints: COM_OF_LOSS_T."""

    @property
    def round_trip(self) -> float | None:
        """Shortest round trip [s] of the latest messages; None if unknown."""

    def poll(self, time: float) -> None:
        """Receive the messages that have arrived by the tick `time` [s]."""

    def tick(self, time: float) -> None:
        """Send the heartbeat and the sequence's requests that are due at `time` [s]."""

    def send_vision(self, pose: VisionPose) -> None:
        """Send a mocap pose."""

    def send_setpoint(self, target: Target, time: float) -> None:
        """Send the setpoint of the tick `time` [s]."""


class AutopilotReport(NamedTuple):
    """The autopilot's state as received by a tick."""

    connected: bool
    mode: Mode
    armed: bool
    phase: Phase
    reasons: tuple[str, ...]  # against arming, or for leaving OFFBOARD
    released_to: str = ""  # who has control in place of the companion
    landed: bool = False  # by the autopilot's land detector
    failed: str = ""  # why the bridge flies no more
    stopped: bool = False  # a kill has ended the flight
    lands: bool = False  # its mode does so by itself, or it is silent, and may
    armed_since: int | None = None  # [ns] first tick with an armed autopilot
    round_trip: float | None = None  # [s] None: unknown
    loop_delay: float | None = None  # [s] None: unknown

    def differs(self, other: AutopilotReport | None) -> bool:
        """Whether a field other than `armed_since` and the delays differs from `other`."""
        return other is None or self[:10] != other[:10]


class AutopilotReports:
    """Makes the reports when they are due. `next` [ns]: when the next one is due, even if
    nothing changes."""

    next = Number()

    def __init__(
        self, autopilot: AutopilotPort, sequence: OffboardSequence, loop_delay: LoopDelay
    ) -> None:
        self._autopilot, self._sequence = autopilot, sequence
        self._loop_delay = loop_delay
        self.memory = record("next")
        self.next = -1
        self._reported: tuple | None = None  # what a change of brings a report

    def due(self, stamp: int) -> AutopilotReport | None:
        """Return the report that is due at the tick `stamp` [ns], None for none."""
        what = self._what(stamp)
        if stamp < self.next and what == self._reported:
            return None
        autopilot = self._autopilot
        since, delay = autopilot.armed_since, self._loop_delay.value
        self.next, self._reported = stamp + REPORT_PERIOD, what
        return AutopilotReport(
            *what,
            None if since is None else nanoseconds(since),
            autopilot.round_trip,
            None if math.isnan(delay) else delay,
        )

    def settled(self, stamp: int) -> bool:
        """Return whether the autopilot is connected at the tick `stamp` [ns], and all is reported
        but the time."""
        what = self._what(stamp)
        return what[0] and what == self._reported

    def _what(self, stamp: int) -> tuple:
        """Return what a change of brings a report at the tick `stamp` [ns]; `connected` first."""
        autopilot, sequence = self._autopilot, self._sequence
        return (
            autopilot.connected(stamp / SECOND),
            autopilot.mode,
            autopilot.armed,
            sequence.phase,
            sequence.reasons,
            sequence.released_to,
            autopilot.landed,
            sequence.failure or (KILL_SWITCH if autopilot.killed else ""),
            sequence.stopped,
            autopilot.mode.lands or autopilot.silent(stamp / SECOND),
        )
