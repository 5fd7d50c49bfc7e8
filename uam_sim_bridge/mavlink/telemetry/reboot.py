"""Whether the autopilot has restarted: its time since boot runs backwards."""

from __future__ import annotations

BACKWARDS = 1.0  # s: less may be messages that overtook each other
_WRAP = 2**32 * 1e-3  # s at which a time in milliseconds starts again: 49.7 days


class RebootDetector:
    """Follows the autopilot's time since boot, as ATTITUDE_QUATERNION and TIMESYNC tell it."""

    def __init__(self) -> None:
        self._latest: float | None = None

    def time_since_boot(self, time: float) -> bool:
        """Take the autopilot's time [s]; True where it has restarted."""
        latest = self._latest
        if latest is None or time > latest:
            self._latest = time
            return False
        if latest - time < BACKWARDS:
            return False
        self._latest = time
        return latest - time < _WRAP - 60.0
