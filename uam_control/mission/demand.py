"""What a reference needs, and what of it exceeds a limit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Excess(NamedTuple):
    """A quantity beyond its limit; value: the worst, at `time` [s]; first [s]: where it begins.

    origin: of a limit that is in no parameter, in words; ramp: the run-up or run-out it is in.
    """

    quantity: str
    value: float
    limit: float
    unit: str
    time: float
    first: float
    origin: str = ""
    ramp: str = ""

    @property
    def beyond(self) -> float:
        """The distance from the limit."""
        return abs(self.value - self.limit)

    @property
    def text(self) -> str:
        """The excess in words."""
        beyond = "exceeds" if self.value > self.limit else "is below"
        limit = f"{self.limit:.3g} {self.unit}" + (f", {self.origin}," if self.origin else "")
        ramp = f"{self.ramp}: " if self.ramp else ""
        return (
            f"{ramp}{self.quantity} {self.value:.3g} {self.unit} {beyond} {limit} "
            f"at {self.time:.1f} s (from {self.first:.1f} s on)"
        )


class Demand(NamedTuple):
    """What a reference needs at times (m,) [s] of mission time.

    position (m, 3) [m]; speed (m,) [m/s]; thrust (m,) [N]; tilt (m,) [rad]; body_rates (m, 3)
    [rad/s, FLU]; turn (m,) [rad/s^2]: change of those of roll and pitch; yaw_rate (m,) [rad/s];
    angles (m, n) [rad]; joint_rates (m, n) [rad/s];
    joint_torques (m, n) [N m] and magnet_force (m,) [N], the payload's apparent weight, NaN if the
    arm's masses are unknown.
    """

    times: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    thrust: np.ndarray
    tilt: np.ndarray
    body_rates: np.ndarray
    turn: np.ndarray
    yaw_rate: np.ndarray
    angles: np.ndarray
    joint_rates: np.ndarray
    joint_torques: np.ndarray
    magnet_force: np.ndarray

    def within(self, part: slice | np.ndarray) -> Demand:
        """Return that of a part of the times."""
        return Demand(*(values[part] for values in self))
