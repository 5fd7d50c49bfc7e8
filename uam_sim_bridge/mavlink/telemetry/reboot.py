"""Detects a restart of the autopilot: its time since boot jumps back."""

from __future__ import annotations

BACKWARDS = 1.0  # s: a smaller step back may be messages out of order
_WRAP = 2**32 * 1e-3  # s, period of a 32-bit time in milliseconds: 49.7 days


class RebootDetector:
    """Compares successive times since boot of ATTITUDE_QUATERNION and TIMESYNC."""

    def __init__(self) -> None:
        self._latest: float | None = None

    def time_since_boot(self, time: float) -> bool:
        """Return True if `time` [s since boot] shows a restart."""
        latest = self._latest
        if latest is None or time > latest:
            self._latest = time
            return False
        if latest - time < BACKWARDS:
            return False
        self._latest = time
        return latest - time < _WRAP - 60.0
