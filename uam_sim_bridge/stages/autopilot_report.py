"""What the bridge tells of the autopilot, and when: on a change and five times a second."""

from __future__ import annotations

from typing import NamedTuple

from uam_control.stamps import nanoseconds, seconds
from uam_sim_bridge.mavlink.offboard.sequence import OffboardSequence, Phase
from uam_sim_bridge.mavlink.protocol.modes import Mode
from uam_sim_bridge.stages.autopilot_port import AutopilotPort

REPORT_PERIOD = 200_000_000  # [ns]


class AutopilotReport(NamedTuple):
    """The autopilot as known at a tick.

    armed_since [ns]: tick at which it was first known armed, None while it is not; reasons: why it
    is not armed or has left OFFBOARD; round_trip [s]: None where not known.
    """

    connected: bool
    mode: Mode
    armed: bool
    phase: Phase
    reasons: tuple[str, ...]
    armed_since: int | None = None
    round_trip: float | None = None

    def differs(self, other: AutopilotReport | None) -> bool:
        """Whether more than numbers differ from `other`."""
        return other is None or self[:5] != other[:5]


class AutopilotReports:
    """Says when a report is due. `last`: the newest report that was due."""

    def __init__(self, autopilot: AutopilotPort, sequence: OffboardSequence) -> None:
        self._autopilot, self._sequence = autopilot, sequence
        self._due = -1  # [ns]
        self.last: AutopilotReport | None = None

    def due(self, stamp: int) -> AutopilotReport | None:
        """Return the report that is due at the tick `stamp` [ns], None for none."""
        autopilot, sequence = self._autopilot, self._sequence
        connected = autopilot.connected(seconds(stamp))
        what = (connected, autopilot.mode, autopilot.armed, sequence.phase, sequence.reasons)
        if self.last is not None and self.last[:5] == what and stamp < self._due:
            return None
        since = autopilot.armed_since
        self._due = stamp + REPORT_PERIOD
        self.last = AutopilotReport(
            *what, None if since is None else nanoseconds(since), autopilot.round_trip
        )
        return self.last
