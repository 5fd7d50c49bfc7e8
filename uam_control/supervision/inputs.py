"""The supervisor's readings besides state and reference, collected message by message."""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uam_control.ages import STALE
from uam_control.estimation.pose_clock import no_pose, repeated
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Known, Number, put, record
from uam_control.supervision.observation import ReadingArrays, Readings

POSE = ("position", "attitude")  # controllers without which the vehicle does not follow its path
WINDOW = 1.0  # [s] of the wall clock
FALLS = 0.02  # [s] by which the lag falls while what has waited arrives
BIAS_MEMORY = 5.0  # [s] over which the bias is averaged, to which the newest one is compared
WATCHED = ("K", "zeta")  # prefixes of the names of gains with a limit
SUBSYSTEMS = (*POSE, "arm")


# stamps [s], NaN before the first: of the newest messages; moved: of the first pose like the
# newest; bias_first: of the first bias; position, attitude, arm: of the gains; oldest,
# oldest_of_pose: of those; last: of the tick
REAL = (
    "mocap joints autopilot payload moved bias_first bias_last "
    "position attitude arm oldest oldest_of_pose last"
)


class InputArrays(NamedTuple):
    """State of `Inputs`."""

    readings: np.ndarray  # (1,) memory of `Readings`
    known: ReadingArrays
    payload: np.ndarray  # (3,) of `Readings`
    grip: np.ndarray  # (2,) of `Readings`
    bias_mean: np.ndarray  # (3,) [m/s^2]
    newest: np.ndarray  # (7,) see `repeated`
    numbers: np.ndarray  # (1,) REAL


class Inputs:
    """Newest values and their stamps. Ages are differences of stamps and do not depend on the time
    of delivery."""

    _autopilot, _last = Number(), Known()

    def __init__(self, period: float) -> None:
        """period [s]: of control ticks."""
        self._period = period
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget all values: stamps of a new simulation follow."""
        self._readings, self.memory = Readings(), record("", REAL)
        self.memory.view(np.float64)[:] = math.nan
        self._temperatures: dict[str, float] = {}
        self._gaps: deque[tuple[float, int]] = deque()  # stamp [s], ticks missed before it
        self._watched: dict[tuple[str, ...], np.ndarray] = {}
        self._pace = Pace()
        self._make_arrays(np.zeros(3), no_pose())

    def _make_arrays(self, bias_mean: np.ndarray, newest: np.ndarray) -> None:
        r = self._readings
        known = r.memory, r.arrays, r.payload_position, r.grip
        self.arrays = a = InputArrays(*known, bias_mean, newest, self.memory)
        three, places = np.zeros(3), np.zeros(0, dtype=int)
        self.mocap = bound(take_pose, a, 0.0, three, np.zeros(4))
        self.accelerometer_bias = bound(take_bias, a, 0.0, three)
        self._take_gains = bound(take_gains, a, 0, 0.0, three, places)
        self._take_ages = bound(take_ages, a, 0.0)

    @property
    def settled(self) -> bool:
        """Whether every controller has sent gains, and no tick was missed within a second."""
        m = self.memory[0]
        known = not math.isnan(m.position + m.attitude + m.arm + m.last)
        return known and not self._gaps and self._readings.missed_ticks == 0.0

    def joints(self, stamp: float, effort: np.ndarray) -> None:
        """Store joint readings at `stamp` [s]; effort (n,): measured torques [N m]."""
        self.memory["joints"] = stamp
        self.expect(len(effort))
        self._readings.joint_effort[:] = effort

    def expect(self, joints: int) -> None:
        """Make room for the torques of a number of joints, unknown at first."""
        if joints != len(self._readings.joint_effort):
            self._readings.joint_effort = np.full(joints, math.nan)
            self._make_arrays(self.arrays.bias_mean, self.arrays.newest)

    def payload(self, stamp: float, position: np.ndarray) -> None:
        """Store the grip point (3,) [m, world] of the payload, exposed at `stamp` [s]."""
        self.memory["payload"] = stamp
        self._readings.payload_position[:] = position

    def grip(self, grip: np.ndarray) -> None:
        """Store opening [m] and closing force [N] of fingers (2,)."""
        self._readings.grip[:] = grip

    def lift(self, thrust: float, throttle: float) -> None:
        """Store the filtered collective thrust [N] and normalised thrust 0..1."""
        self._readings.lift, self._readings.throttle = thrust, throttle

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
        """Store a connection to the autopilot at `stamp` [s]; delays: see `Readings`, or NaN."""
        self._autopilot = stamp
        self._readings.round_trip, self._readings.loop_delay = round_trip, loop_delay

    def gains(self, stamp: float, subsystem: str, names: Sequence[str], values: np.ndarray) -> None:
        """Store the adapted gains of one of SUBSYSTEMS at `stamp` [s]: names (n), values (n,)."""
        number = SUBSYSTEMS.index(subsystem)
        self._take_gains(number, stamp, values, self.watched(tuple(names)))

    def watched(self, names: tuple[str, ...]) -> np.ndarray:
        """Return the places (m,) of the gains with a limit among `names`."""
        if names not in self._watched:
            places = [i for i, name in enumerate(names) if name.startswith(WATCHED)]
            self._watched[names] = np.array(places, dtype=int)
        return self._watched[names]

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
        while gaps and stamp - gaps[0][0] > 1.0:
            gaps.popleft()
        readings.missed_ticks = float(sum(missed for _, missed in gaps)) if gaps else 0.0
        self._take_ages(stamp)
        return readings


@borrowing
def take_pose(a: InputArrays, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Store a pose, see `Estimator.mocap`; the quaternion turns body → world."""
    m = a.numbers[0]
    m.mocap = stamp
    put(position, a.known.position)
    if not repeated(position, quaternion, a.newest):
        m.moved = stamp


@borrowing
def take_bias(a: InputArrays, stamp: float, bias: np.ndarray) -> None:
    """Store the estimated bias (3,) [m/s^2, FLU] of the accelerometer at `stamp` [s].

    A real bias changes slowly. The estimate changes fast where motion capture and IMU
    contradict each other: exchanged axes, a wrong body.
    """
    m = a.numbers[0]
    if math.isnan(m.bias_first):
        m.bias_first = m.bias_last = stamp
        put(bias, a.bias_mean)
    step, memory = max(stamp - m.bias_last, 0.0), min(max(stamp - m.bias_first, 1e-3), BIAS_MEMORY)
    gain, squared = min(step / memory, 1.0), 0.0
    for i in range(3):
        away = bias[i] - a.bias_mean[i]
        squared += away * away
        a.bias_mean[i] += gain * away
    m.bias_last, a.readings[0].contradiction = stamp, math.sqrt(squared)


@borrowing
def take_gains(
    a: InputArrays, number: int, stamp: float, values: np.ndarray, watched: np.ndarray
) -> None:
    """Store the adapted gains (n,) of a controller, by its number in SUBSYSTEMS, at `stamp` [s];
    watched: see `Inputs.watched`."""
    m = a.numbers[0]
    a.known.gains[number] = largest_of(values, watched)
    if number == 0:
        m.position = stamp
    elif number == 1:
        m.attitude = stamp
    else:
        m.arm = stamp
    m.oldest_of_pose = np.fmin(m.position, m.attitude)
    m.oldest = np.fmin(m.oldest_of_pose, m.arm)


@borrowing
def take_ages(a: InputArrays, stamp: float) -> None:
    """Write the ages at the tick `stamp` [s]."""
    m, r = a.numbers[0], a.readings[0]
    m.last = r.stamp = stamp
    if stamp - m.bias_last > STALE:
        r.contradiction = math.nan
    r.mocap_age = stamp - m.mocap
    r.mocap_still = stamp - m.moved
    r.joint_age = stamp - m.joints
    r.autopilot_age = stamp - m.autopilot
    r.payload_age = stamp - m.payload
    r.controller_age = stamp - m.oldest
    r.pose_controller_age = stamp - m.oldest_of_pose


@borrowing
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


class Pace:
    """`slower`: 1 − real-time factor of the last WINDOW, NaN before that; below 0: faster.

    An autopilot with its own clock (hardware in the loop) cannot fly a vehicle whose time passes
    more slowly: its rate loop and its estimator integrate over the wrong time.
    """

    def __init__(self) -> None:
        self.slower = math.nan
        self._seen: deque[tuple[float, float]] = deque()  # wall clock, stamp [s]

    def tick(self, stamp: float, wall: float) -> None:
        """Register the tick `stamp` [s] at the wall clock's time `wall` [s]."""
        seen = self._seen
        if seen and (stamp < seen[-1][1] or wall < seen[-1][0]):  # a clock that began anew
            seen.clear()
            self.slower = math.nan
        seen.append((wall, stamp))
        while len(seen) > 2 and wall - seen[1][0] >= WINDOW:
            seen.popleft()
        begun, first = seen[0]
        if wall - begun >= WINDOW:
            self.slower = 1.0 - (stamp - first) / (wall - begun)


class Waited:
    """Finds the ticks that have waited while a process stood still: they are old.

    The lag of a tick is the wall clock's time less its stamp. A lag that is larger than before by
    more than STALE, and falls, is that of ticks that have waited. If it stays for STALE, the time
    of the stamps stood still, too: no tick has waited.
    """

    def __init__(self) -> None:
        self._lag = self._late = self._since = math.inf

    def late(self, stamp: float, wall: float) -> float:
        """Return for how long [s] the tick `stamp` [s], which begins at `wall` [s], has waited."""
        lag = wall - stamp
        if lag - self._lag > STALE:
            if lag < self._late - FALLS:
                self._late, self._since = lag, wall
            if wall - self._since < STALE:
                return lag - self._lag
        self._lag, self._late = lag, math.inf
        return 0.0
