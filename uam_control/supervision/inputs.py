"""The supervisor's readings besides state and reference, collected message by message."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from uam_control.ages import STALE
from uam_control.estimation.repeats import Repeats
from uam_control.maths.compiled import jit
from uam_control.supervision.observation import Readings
from uam_control.supervision.pace import Pace

POSE = ("position", "attitude")  # controllers without which the vehicle does not follow its path
BIAS_MEMORY = 5.0  # [s] over which the bias is averaged, to which the newest one is compared
WATCHED = ("K", "zeta")  # prefixes of the names of gains with a limit
SUBSYSTEMS = (*POSE, "arm")


class Inputs:
    """Newest values and their stamps. Ages are differences of stamps and do not depend on the time
    of delivery."""

    def __init__(self, period: float) -> None:
        """period [s]: of control ticks."""
        self._period = period
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget all values: stamps of a new simulation follow."""
        self._readings = Readings()
        self._mocap = self._joints = self._autopilot = math.nan  # stamps [s]
        self._payload = math.nan  # stamp [s]
        self._moved = math.nan  # stamp [s] of the first pose like the newest
        self._repeats = Repeats()
        self._bias: tuple[float, float] | None = None  # stamps [s] of the first and the newest
        self._bias_mean = np.zeros(3)  # [m/s^2]
        self._temperatures: dict[str, float] = {}
        self._oldest = self._oldest_of_pose = math.nan  # [s] stamps of gains
        self._of_pose: dict[str, float] = {}
        self._controllers: dict[str, float] = {}  # stamps of the newest gains [s]
        self._last: float | None = None
        self._gaps: deque[tuple[float, int]] = deque()  # stamp [s], ticks missed before it
        self._watched: dict[tuple[str, ...], np.ndarray] = {}
        self._pace = Pace()

    def mocap(self, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Store a mocap pose exposed at `stamp` [s].

        position (3,) [m, world]; quaternion (4,) body → world [w x y z].
        """
        self._mocap = stamp
        self._readings.mocap_position[:] = position
        if not self._repeats(position, quaternion):
            self._moved = stamp

    def joints(self, stamp: float, effort: np.ndarray) -> None:
        """Store joint readings at `stamp` [s]; effort (n,): measured torques [N m]."""
        self._joints = stamp
        self._readings.joint_effort = np.array(effort, dtype=float)

    def payload(self, stamp: float, position: np.ndarray) -> None:
        """Store the grip point (3,) [m, world] of the payload, exposed at `stamp` [s]."""
        self._payload = stamp
        self._readings.payload_position[:] = position

    def accelerometer_bias(self, stamp: float, bias: np.ndarray) -> None:
        """Store the estimated bias (3,) [m/s^2, FLU] of the accelerometer at `stamp` [s].

        A real bias changes slowly. The estimate changes fast where motion capture and IMU
        contradict each other: exchanged axes, a wrong body.
        """
        if self._bias is None:
            self._bias, self._bias_mean[:] = (stamp, stamp), bias
        first, last = self._bias
        self._bias = first, stamp
        self._readings.contradiction = follow_bias(stamp, first, last, bias, self._bias_mean)

    def lift(self, thrust: float) -> None:
        """Store the filtered collective thrust [N]."""
        self._readings.lift = thrust

    def temperature(self, joint: str, degrees: float) -> None:
        """Store the temperature [deg C] of a joint's servo."""
        self._temperatures[joint] = degrees
        known = [value for value in self._temperatures.values() if not math.isnan(value)]
        self._readings.temperature = max(known, default=math.nan)

    def battery(self, left: float) -> None:
        """Store the state of charge 0..1; NaN if unknown."""
        self._readings.battery = left

    def autopilot(
        self, stamp: float, round_trip: float = math.nan, loop_delay: float = math.nan
    ) -> None:
        """Store that the bridge was connected to the autopilot at `stamp` [s].

        round_trip [s]: of the link; loop_delay [s]: from a setpoint to the gyro's response; NaN if
        unknown.
        """
        self._autopilot = stamp
        self._readings.round_trip, self._readings.loop_delay = round_trip, loop_delay

    def gains(self, stamp: float, subsystem: str, names: Sequence[str], values: np.ndarray) -> None:
        """Store the adapted gains of one of SUBSYSTEMS at `stamp` [s]: names (n), values (n,)."""
        key = tuple(names)
        if key not in self._watched:
            watched = [i for i, n in enumerate(names) if n.startswith(WATCHED)]
            self._watched[key] = np.array(watched, dtype=int)
        largest = largest_of(values, self._watched[key])
        self._readings.gains[SUBSYSTEMS.index(subsystem)] = largest
        self._controllers[subsystem] = stamp
        self._oldest = min(self._controllers.values())
        if subsystem in POSE:
            self._of_pose[subsystem] = stamp
            self._oldest_of_pose = min(self._of_pose.values())

    def wall_clock(self, stamp: float, wall: float) -> None:
        """Store the wall clock's time `wall` [s] of the tick `stamp` [s]."""
        self._pace.tick(stamp, wall)
        self._readings.slower = self._pace.slower

    def at(self, stamp: float) -> Readings:
        """Return the readings at the tick `stamp` [s]; the next call reuses the object."""
        readings, gaps = self._readings, self._gaps
        if self._last is not None:
            missed = round((stamp - self._last) / self._period) - 1
            if missed > 0:
                gaps.append((stamp, missed))
        self._last = stamp
        while gaps and stamp - gaps[0][0] > 1.0:
            gaps.popleft()
        readings.missed_ticks = float(sum(missed for _, missed in gaps)) if gaps else 0.0
        if self._bias is not None and stamp - self._bias[1] > STALE:
            readings.contradiction = math.nan
        readings.stamp = stamp
        readings.mocap_age = stamp - self._mocap
        readings.mocap_still = stamp - self._moved
        readings.joint_age = stamp - self._joints
        readings.autopilot_age = stamp - self._autopilot
        readings.payload_age = stamp - self._payload
        readings.controller_age = stamp - self._oldest
        readings.pose_controller_age = stamp - self._oldest_of_pose
        return readings


@jit
def follow_bias(
    stamp: float, first: float, last: float, bias: np.ndarray, mean: np.ndarray
) -> float:
    """Return the distance [m/s^2] of a bias (3,) from the mean (3,), which then follows it.

    stamp, first, last [s]: of this bias, of the first and of the one before.
    """
    step, memory = max(stamp - last, 0.0), min(max(stamp - first, 1e-3), BIAS_MEMORY)
    gain = min(step / memory, 1.0)
    squared = 0.0
    for i in range(3):
        away = bias[i] - mean[i]
        squared += away * away
        mean[i] += gain * away
    return math.sqrt(squared)


@jit
def largest_of(values: np.ndarray, places: np.ndarray) -> float:
    """Return the largest |value| at `places` (m,) of values (n,); NaN for m = 0 or with a NaN."""
    found = math.nan
    for place in places:
        size = abs(values[place])
        if math.isnan(size):
            return size
        if not found >= size:
            found = size
    return found
