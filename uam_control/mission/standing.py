"""Whether a vehicle that somebody else lands stands on something."""

from __future__ import annotations

SINKING, STILL = 0.2, 0.05  # [m/s] downwards: a landing, and the end of it


class Standing:
    """The vehicle sank, and sinks no more. `value`: until it sinks again.

    The autopilot's land detector needs seconds, and may find no ground under an arm.
    """

    def __init__(self) -> None:
        self.value = self._sank = False

    def update(self, rate: float) -> bool:
        """Take the vertical rate [m/s], up; return whether `value` has changed."""
        before = self.value
        if rate < -SINKING:
            self._sank, self.value = True, False
        elif self._sank and rate > -STILL:
            self.value = True
        return self.value is not before
