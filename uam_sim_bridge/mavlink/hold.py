"""What the autopilot gets while no good command is there: level for a bounded time, then nothing.

Nothing means that the stream stops, and the autopilot's own failsafe (COM_OF_LOSS_T) takes over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uam_control.parameters import ParameterSet, number

_LAST = 0.05  # s, before the end: the autopilot keeps to the last setpoint until its failsafe
_THRUST_TIME = 0.5  # s, over which the thrust of normal flight is averaged


@dataclass(frozen=True)
class HoldParameters(ParameterSet):
    """The reaction to missing or bad commands in flight."""

    hold_time: float = number(
        2.0,
        "how long level setpoints go out in place of commands, before the stream stops",
        "s",
        0.0,
        10.0,
    )
    release_time: float = number(
        1.0,
        "the same where no commands are to be expected: no estimate, or the mission has given up",
        "s",
        0.0,
        10.0,
    )
    hold_gain: float = number(3.0, "tilt → body rate while holding level", "1/s", 0.0, 10.0)
    hold_rate_limit: float = number(
        2.0, "largest body rate while holding level", "rad/s", 0.1, 10.0
    )
    ground_margin: float = number(
        0.3,
        "height above the start, from which an idle command means hold instead of thrust 0",
        "m",
        0.01,
        10.0,
    )


class LevelHold:
    """Level setpoints with the thrust of the flight so far; `rates` (3,) is reused."""

    def __init__(self, parameters: HoldParameters) -> None:
        self.parameters = parameters
        self.rates = np.zeros(3)
        self._thrust: float | None = None
        self._time = -math.inf
        self._since: float | None = None

    @property
    def active(self) -> bool:
        """Whether the last tick was one without a good command."""
        return self._since is not None

    def good(self, time: float, thrust: float) -> None:
        """Note a good command at `time` [s] with its normalised thrust."""
        self._since = None
        dt = time - self._time
        self._time = time
        if self._thrust is None or not 0.0 < dt < _THRUST_TIME:
            self._thrust = thrust
        else:
            self._thrust += dt / _THRUST_TIME * (thrust - self._thrust)

    def reset(self) -> None:
        """Forget the flight: the vehicle is on the ground."""
        self._thrust = self._since = None

    def setpoint(
        self, time: float, attitude: np.ndarray, hopeless: bool = False
    ) -> tuple[np.ndarray, float] | None:
        """Return body rates (3,) [rad/s, FLU] and thrust, or None when the stream is to stop.

        attitude (3,): roll, pitch, yaw [rad]; no rates about an axis of which it is not finite.
        hopeless: no commands are to be expected.
        """
        if self._thrust is None:
            return None
        if self._since is None:
            self._since = time
        longest = self.parameters.release_time if hopeless else self.parameters.hold_time
        left = longest - (time - self._since)
        if left < 0.0:
            return None
        limit, gain = self.parameters.hold_rate_limit, self.parameters.hold_gain
        for axis in range(2):
            angle = attitude[axis] if left > _LAST and math.isfinite(attitude[axis]) else 0.0
            self.rates[axis] = min(limit, max(-limit, -gain * angle))
        return self.rates, self._thrust
