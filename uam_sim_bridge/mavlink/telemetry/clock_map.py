"""Stamps of the autopilot's samples in the companion's clock."""

from __future__ import annotations

from uam_sim_bridge.mavlink.telemetry.time_sync import TimeSync

SLEW = 50_000  # [ns] per sample: 1 % of the time at 250 Hz


class ClockMap:
    """Follows the offset of `TimeSync` by at most SLEW per sample.

    The first answers over a slow link may be wrong by many milliseconds. A better one must not let
    the stamps go back.
    """

    def __init__(self, sync: TimeSync) -> None:
        self._sync = sync
        self._offset: int | None = None  # [ns] autopilot's clock - companion's clock

    def companion(self, stamp: int) -> int | None:
        """Return the stamp [ns] of a sample in the companion's clock; stamp: the autopilot's [ns].

        None before five answers, and after a reboot until there are five again.
        """
        sync = self._sync
        if sync.offset is None or sync.quickest is None:
            self._offset = None
            return None
        measured = round(sync.offset * 1e9)
        if self._offset is None:
            self._offset = measured
        self._offset += max(-SLEW, min(SLEW, measured - self._offset))
        return stamp - self._offset
