"""State estimator: motion capture + IMU + joints → chi, chi_dot, chi_ddot at the control rate.

Position accelerations come from the IMU, attitude accelerations from the derivative of its body
rates, joint accelerations from the derivative of the joint velocities (paper, Section IV). Each is
low-pass filtered; the corner frequencies are parameters.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.ages import AHEAD
from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL, X
from uam_control.estimation.base import BaseParameters, Estimator
from uam_control.estimation.filters import derivative_step, joint_step, low_pass_step, observer_step
from uam_control.estimation.pose_clock import settled, suspend
from uam_control.estimation.pose_filter import (
    FilterArrays,
    allowed_bandwidth,
    begin_anew,
    correct_waiting,
    filter_arrays,
    insert,
    parts_of,
    predict_next,
    wait,
)
from uam_control.maths.compiled import jit, prepared
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import record
from uam_control.maths.rotations import euler_from_quaternion, matrix_from_quaternion, rotate_back
from uam_control.settings.parameter_set import choice, number

REPORTED, OBSERVER = "reported", "observer"  # where the velocity of a joint comes from
# rad/s; the noise of the estimated bias grows with the cube of the bandwidth
QUIET_BANDWIDTH = 24.0
LONGEST_STEP = 0.05  # s, longest filter step; a longer gap means lost samples
READINGS = 16  # of the joints, that wait for the end of their tick at most


@dataclass(frozen=True)
class EstimatorParameters(BaseParameters):
    """Bandwidths and corner frequencies of the estimator's filters, and gravity."""

    estimator: str = choice(
        "complementary", "the estimator that flies, fixed", ("complementary",), fixed=True
    )
    position_bandwidth: float = number(
        12.0, "correction of position by motion capture", "rad/s", 0.5, 60.0
    )
    attitude_bandwidth: float = number(
        8.0, "correction of attitude by motion capture", "rad/s", 0.5, 60.0
    )
    odometry_bandwidth: float = number(
        6.0, "largest correction of position and attitude by an odometry", "rad/s", 0.5, 60.0
    )
    pose_gate: float = number(
        0.15, "jump of the motion capture from which its poses are rejected", "m", 0.05, 1000.0
    )
    joint_bandwidth: float = number(
        60.0, "correction of joint state by the encoder angle", "rad/s", 1.0, 125.0
    )
    joint_velocity_weight: float = number(
        80.0, "correction of joint state by the encoder velocity", "1/s", 0.0, 200.0
    )
    joint_velocity: str = choice(
        REPORTED,
        "velocity of a joint: the servo's corrects it, or an observer of its angle makes it",
        (REPORTED, OBSERVER),
    )
    joint_observer_bandwidth: float = number(
        20.0, "of the observer; its velocity is 0.23 / bandwidth late", "Hz", 1.0, 60.0
    )
    acceleration_cutoff: float = number(
        5.0, "low-pass on the acceleration of the vehicle", "Hz", 0.1, 100.0
    )
    angular_acceleration_cutoff: float = number(
        10.0, "low-pass on the derivative of the body rates", "Hz", 0.1, 100.0
    )
    joint_acceleration_cutoff: float = number(
        5.0, "low-pass on the derivative of the joint velocities", "Hz", 0.1, 100.0
    )

    def capped(self, interval: float) -> list[str]:
        """Return a line per bandwidth that is too large for a pose every `interval` [s]."""
        allowed = allowed_bandwidth(interval)
        given = ("position_bandwidth", "attitude_bandwidth")
        why = f"{allowed:.3g}: a pose comes every {1e3 * interval:.3g} ms"
        return [
            f"{name} {value:g} rad/s acts as {why}"
            for name in given
            if (value := getattr(self, name)) > allowed
        ]


class EstimatorArrays(NamedTuple):
    """State of a `StateEstimator`, which never replaces them."""

    pose: FilterArrays
    memory: np.ndarray  # see `arrays_of`
    readings: np.ndarray  # (READINGS, 1 + 2 n) stamp, angles, velocities: they wait, in order
    numbers: np.ndarray  # (1,) WHOLE, REAL


# started: whether a pose has come; waiting: number of readings; observed: whether an observer makes
# the velocities of the joints. Stamps of the newest samples [s], NaN before the first, start: of
# the pose at which the estimate began; period [s]: of the newest IMU sample; then the parameters
WHOLE = "started waiting observed"
REAL = (
    "imu_stamp joint_stamp start period angular_cutoff linear_cutoff "
    "joint_bandwidth velocity_weight observer_bandwidth joint_cutoff bandwidth"
)


class StateEstimator(Estimator):
    """Estimates chi, chi_dot, chi_ddot.

    Pass the samples by `mocap`, `imu` and `joints` as they arrive. Poses and readings wait for the
    next IMU sample or `update`, and are then used in the order of their stamps. `update` returns
    the state at the stamp of the newest IMU sample.
    """

    kind = EstimatorParameters

    def __init__(self, parameters: EstimatorParameters, joints: int) -> None:
        self.memory = record(WHOLE, REAL)
        memory = np.zeros(FIXED + PER_JOINT * joints)
        readings = np.zeros((READINGS, 1 + 2 * joints))
        self.arrays = EstimatorArrays(filter_arrays(), memory, readings, self.memory)
        self._odometry = False
        self.set_parameters(parameters)
        forget_samples(self.arrays)
        self._state, *_ = arrays_of(self.arrays.memory)
        a, sample, angles = self.arrays, np.zeros(3), np.zeros(joints)
        self.mocap = bound(take_mocap, a, 0.0, sample, np.zeros(4))
        self.imu = bound(take_imu, a, 0.0, sample, sample)
        self.joints = bound(take_joints, a, 0.0, angles, angles)
        self._write_biases = prepared(write_biases, a.pose.memory, np.empty((2, 3)))
        self._settle, self._assemble = bound(settle, a), bound(assemble, a)

    def set_parameters(self, parameters: EstimatorParameters) -> None:
        self.parameters = p = parameters
        pose, m = self.arrays.pose, self.memory[0]
        position, attitude = p.position_bandwidth, p.attitude_bandwidth
        if self._odometry:
            position, attitude = (min(one, p.odometry_bandwidth) for one in (position, attitude))
        pose.bandwidths[:] = position, attitude, max(position, attitude)
        pose.gate["distance"], pose.numbers["gravity"] = p.pose_gate, p.gravity
        m.angular_cutoff, m.linear_cutoff = p.angular_acceleration_cutoff, p.acceleration_cutoff
        m.joint_bandwidth, m.velocity_weight = p.joint_bandwidth, p.joint_velocity_weight
        m.observed, m.observer_bandwidth = p.joint_velocity == OBSERVER, p.joint_observer_bandwidth
        m.joint_cutoff, m.bandwidth = p.joint_acceleration_cutoff, position

    def use_odometry(self) -> None:
        self._odometry = True
        self.set_parameters(self.parameters)

    @property
    def refused_poses(self) -> int:
        self._settle()
        return self.arrays.pose.gate["refused"].item()

    @property
    def complete(self) -> bool:
        return complete(self.arrays)

    def forget(self) -> None:
        forget_samples(self.arrays)

    @property
    def bias_known(self) -> bool:
        return bias_known(self.arrays)

    @property
    def imu_bias(self) -> tuple[np.ndarray, np.ndarray]:
        found = np.empty((2, 3))
        self._write_biases(self.arrays.pose.memory, found)
        return found[0], found[1]

    def update(self) -> np.ndarray:
        self._settle()
        self._assemble()
        return self._state


FIXED = 27  # numbers of an estimator's memory without joints
PER_JOINT = 7


@jit
def arrays_of(
    memory: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return state (3, 6 + n), joints (2, n): angles [rad] and velocities [rad/s], and the filters:
    of the joints (2, n), of the body rates (2, 3), of the acceleration (3,).

    They are views of memory, FIXED + PER_JOINT n numbers: a call passes one array instead of five.
    """
    n = (len(memory) - FIXED) // PER_JOINT
    size, two = ALPHA + n, 2 * n
    a = 3 * size
    b = a + two
    c = b + two
    return (
        memory[:a].reshape((3, size)),
        memory[a:b].reshape((2, n)),
        memory[b:c].reshape((2, n)),
        memory[c : c + 6].reshape((2, 3)),
        memory[c + 6 :],
    )


@jit
def forget_samples(a: EstimatorArrays) -> None:
    """Begin anew; parameters stay."""
    m = a.numbers[0]
    m.started = m.waiting = 0
    m.period = 0.0
    m.imu_stamp = m.joint_stamp = math.nan
    a.memory[:] = 0.0
    begin_anew(a.pose)


@jit
def take_mocap(
    a: EstimatorArrays, stamp: float, position: np.ndarray, quaternion: np.ndarray
) -> None:
    """See `Estimator.mocap`; the quaternion turns body → world."""
    m = a.numbers[0]
    if not a.pose.numbers[0].count and not (m.started and stamp < m.start):
        motion, _, _ = parts_of(a.pose.memory)
        motion.position[:] = position
        motion.quaternion[:] = quaternion
        m.started, m.start = 1, stamp
    wait(a.pose, stamp, position, quaternion)


@jit
def take_imu(
    a: EstimatorArrays, stamp: float, gyro: np.ndarray, specific_force: np.ndarray
) -> None:
    """Take an IMU sample of `stamp` [s]: gyro (3,) [rad/s], specific_force (3,) [m/s^2], FLU."""
    follow_waiting(a)
    m = a.numbers[0]
    first, step = math.isnan(m.imu_stamp), stamp - m.imu_stamp
    m.imu_stamp = stamp
    if step > LONGEST_STEP:
        suspend(a.pose.gate, stamp)
        step = LONGEST_STEP
    m.period = 0.0 if first or not step > 0.0 else step
    if m.started and m.period > 0.0:
        predict_next(a.pose, stamp, m.period, gyro, specific_force)


@jit
def take_joints(a: EstimatorArrays, stamp: float, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
    """Let joint readings at `stamp` [s] wait: alpha (n,) [rad], alpha_dot (n,) [rad/s]."""
    m = a.numbers[0]
    m.waiting = insert(a.readings, m.waiting, stamp, alpha, alpha_dot)


@jit
def settle(a: EstimatorArrays) -> None:
    """Use what waits and is not newer than the newest IMU sample."""
    follow_waiting(a)
    correct_waiting(a.pose)


@jit
def follow_waiting(a: EstimatorArrays) -> None:
    """Use the joint readings that wait, in the order of their stamps."""
    m, n = a.numbers[0], (a.readings.shape[1] - 1) // 2
    for i in range(m.waiting):
        row = a.readings[i]
        follow_joints(a, row[0], row[1 : 1 + n], row[1 + n :])
        row[:] = 0.0  # used readings are no state of the estimator
    m.waiting = 0


@jit
def follow_joints(
    a: EstimatorArrays, stamp: float, alpha: np.ndarray, alpha_dot: np.ndarray
) -> None:
    """Use joint readings, see `take_joints`; write the accelerations into the state.

    One that is a little older than the newest is ignored; with older ones the clock has been set.
    """
    m = a.numbers[0]
    first, since = math.isnan(m.joint_stamp), stamp - m.joint_stamp
    if -AHEAD < since <= 0.0:
        return
    m.joint_stamp = stamp
    state, joints, joints_filter, _, _ = arrays_of(a.memory)
    if first:
        joints[0] = alpha
        if not m.observed:
            joints[1] = alpha_dot
        return
    dt = min(max(since, 0.0), LONGEST_STEP)
    if not m.observed:
        joint_step(alpha, alpha_dot, m.joint_bandwidth, m.velocity_weight, dt, joints)
    elif since > 0.0:
        observer_step(alpha, m.observer_bandwidth, since, joints)
    derivative_step(joints[1], m.joint_cutoff, dt, joints_filter, state[CHI_DDOT, ALPHA:])


@jit
def complete(a: EstimatorArrays) -> bool:
    """Return whether every input has delivered a sample."""
    m = a.numbers[0]
    return m.started != 0 and not (math.isnan(m.imu_stamp) or math.isnan(m.joint_stamp))


@jit
def bias_known(a: EstimatorArrays) -> bool:
    """Return whether neither a gap of IMU or poses nor noise covers the estimated biases."""
    m = a.numbers[0]
    return m.bandwidth <= QUIET_BANDWIDTH and settled(a.pose.gate, m.imu_stamp)


@jit
def write_biases(pose: np.ndarray, found: np.ndarray) -> None:
    """Write the biases of gyroscope and accelerometer into found (2, 3), FLU; pose: `parts_of`."""
    motion, _, _ = parts_of(pose)
    found[0] = motion.gyro_bias
    found[1] = rotate_back(matrix_from_quaternion(motion.quaternion), motion.accelerometer_bias)


@jit
def assemble(a: EstimatorArrays) -> None:
    """Filter the accelerations over the period of the IMU and write the state into memory.

    An observer's angles are those at the stamp of the IMU sample.
    """
    m = a.numbers[0]
    motion, _, _ = parts_of(a.pose.memory)
    state, joints, _, rates_filter, filtered = arrays_of(a.memory)
    rates = motion.rates
    if m.period > 0.0:
        turning = state[CHI_DDOT, ROLL:ALPHA]
        derivative_step(rates, m.angular_cutoff, m.period, rates_filter, turning)
        low_pass_step(motion.acceleration, m.linear_cutoff, m.period, filtered)
    euler = euler_from_quaternion(motion.quaternion)
    for i in range(3):
        state[CHI, X + i], state[CHI, ROLL + i] = motion.position[i], euler[i]
        state[CHI_DOT, X + i], state[CHI_DOT, ROLL + i] = motion.velocity[i], rates[i]
        state[CHI_DDOT, X + i] = filtered[i]
    for i in range(joints.shape[1]):
        state[CHI, ALPHA + i], state[CHI_DOT, ALPHA + i] = joints[0, i], joints[1, i]
    if m.observed and not math.isnan(m.imu_stamp):
        late = min(max(m.imu_stamp - m.joint_stamp, -LONGEST_STEP), LONGEST_STEP)
        for i in range(joints.shape[1]):
            state[CHI, ALPHA + i] += late * joints[1, i]
