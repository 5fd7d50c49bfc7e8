"""State estimator: motion capture + IMU + joints → chi, chi_dot, chi_ddot at the control rate.

Position accelerations come from the IMU, attitude accelerations from the derivative of its body
rates, joint accelerations from the derivative of the joint velocities (paper, Section IV). Each is
low-pass filtered; the corner frequencies are parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL, X
from uam_control.estimation.filters import derivative_step, joint_step, low_pass_step
from uam_control.estimation.pose_filter import (
    EstimatedMotion,
    PoseFilter,
    allowed_bandwidth,
    parts_of,
    predict_next,
)
from uam_control.maths.compiled import jit, prepared
from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_quaternion,
    rotate_back,
)
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.vehicle import GRAVITY

# rad/s; the noise of the estimated bias grows with the cube of the bandwidth
QUIET_BANDWIDTH = 24.0
LONGEST_STEP = 0.05  # s, longest filter step; a longer gap means lost samples


@dataclass(frozen=True)
class EstimatorParameters(ParameterSet):
    """Bandwidths and corner frequencies of the estimator's filters, and gravity."""

    position_bandwidth: float = number(
        12.0, "correction of position by motion capture", "rad/s", 0.5, 60.0
    )
    attitude_bandwidth: float = number(
        8.0, "correction of attitude by motion capture", "rad/s", 0.5, 60.0
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
    acceleration_cutoff: float = number(
        5.0, "low-pass on the acceleration of the vehicle", "Hz", 0.1, 100.0
    )
    angular_acceleration_cutoff: float = number(
        10.0, "low-pass on the derivative of the body rates", "Hz", 0.1, 100.0
    )
    joint_acceleration_cutoff: float = number(
        5.0, "low-pass on the derivative of the joint velocities", "Hz", 0.1, 100.0
    )
    gravity: float = number(GRAVITY, "acceleration of gravity", "m/s^2", 0.0, 30.0)

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


class StateEstimator:
    """Estimates chi, chi_dot, chi_ddot.

    Pass the samples in order of arrival by `mocap`, `imu` and `joints`; `update` returns the state
    at the stamp of the newest IMU sample. `imu_update` is both, in less time.
    """

    def __init__(self, parameters: EstimatorParameters, joints: int) -> None:
        """joints: how many the arm has."""
        self.parameters = parameters
        p = parameters
        self._pose = PoseFilter(p.position_bandwidth, p.attitude_bandwidth, p.pose_gate, p.gravity)
        self._memory = np.zeros(memory_size(joints))
        self._state, self._joints, *_ = arrays_of(self._memory)
        self._imu_stamp: float | None = None
        self._joint_stamp: float | None = None
        self._started = False
        self._period = 0.0
        pose, own, sample, angles = self._pose.memory, self._memory, np.zeros(3), np.zeros(joints)
        self._follow_joints = prepared(follow_joints, own, angles, angles, 0.0, 0.0, 0.0, 0.0)
        self._write_biases = prepared(write_biases, pose, np.empty((2, 3)))
        self._assemble = prepared(assemble_stored, pose, own, 0.0, 0.0, 0.0)
        self._predict_and_assemble = prepared(
            predict_and_assemble, pose, own, 0, 0.0, 0.0, 0.0, sample, sample, 0.0, 0.0
        )

    def set_parameters(self, parameters: EstimatorParameters) -> None:
        """Use `parameters` (validated) from the next sample on."""
        self.parameters = parameters
        self._pose.set_bandwidths(parameters.position_bandwidth, parameters.attitude_bandwidth)
        self._pose.gate.distance = parameters.pose_gate
        self._pose.gravity = parameters.gravity

    @property
    def refused_poses(self) -> int:
        """Return the number of poses rejected because of a jump."""
        return self._pose.gate.refused

    @property
    def waiting_for(self) -> list[str]:
        """Return the names of the inputs without any sample so far."""
        seen = {
            "imu": self._imu_stamp is not None,
            "mocap": self._started,
            "joints": self._joint_stamp is not None,
        }
        return [name for name, received in seen.items() if not received]

    @property
    def quaternion(self) -> np.ndarray:
        """Return the attitude quaternion (4,), body → world [w x y z]."""
        return self._pose.quaternion

    @property
    def bias_known(self) -> bool:
        """Whether neither a gap of IMU or poses nor noise covers the estimated biases."""
        quiet = self.parameters.position_bandwidth <= QUIET_BANDWIDTH
        return quiet and self._imu_stamp is not None and self._pose.gate.settled(self._imu_stamp)

    @property
    def imu_bias(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the estimated biases (3,) of gyroscope [rad/s] and accelerometer [m/s^2], FLU."""
        found = np.empty((2, 3))
        self._write_biases(self._pose.memory, found)
        return found[0], found[1]

    def mocap(self, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Process a pose exposed at `stamp` [s].

        position (3,) [m, world]; quaternion (4,) body → world [w x y z].
        """
        if not self._started:
            self._pose.start(position, quaternion)
            self._started = True
        self._pose.correct(stamp, position, quaternion)

    def imu(self, stamp: float, gyro: np.ndarray, specific_force: np.ndarray) -> None:
        """Process an IMU sample at `stamp` [s].

        gyro (3,) [rad/s, FLU]; specific_force (3,) [m/s^2, FLU].
        """
        if self._take_imu(stamp):
            self._pose.predict(stamp, self._period, gyro, specific_force)

    def _take_imu(self, stamp: float) -> bool:
        """Take the stamp [s] of an IMU sample; return whether the sample is to be integrated."""
        last, self._imu_stamp = self._imu_stamp, stamp
        if last is None:
            self._period = 0.0
            return False
        step = stamp - last
        if step > LONGEST_STEP:
            self._pose.gate.suspend(stamp)
            step = LONGEST_STEP
        self._period = step if step > 0.0 else 0.0
        return self._started and step > 0.0

    def imu_update(self, stamp: float, gyro: np.ndarray, specific_force: np.ndarray) -> np.ndarray:
        """Process an IMU sample as `imu` does, and return the state as `update` does."""
        p, pose, integrate = self.parameters, self._pose, self._take_imu(stamp)
        if not integrate or pose.ahead:
            if integrate:
                pose.predict(stamp, self._period, gyro, specific_force)
            return self.update()
        self._predict_and_assemble(
            pose.memory,
            self._memory,
            pose.next_row(),
            stamp,
            self._period,
            pose.gravity,
            gyro,
            specific_force,
            p.angular_acceleration_cutoff,
            p.acceleration_cutoff,
        )
        return self._state

    def joints(self, stamp: float, alpha: np.ndarray, alpha_dot: np.ndarray) -> None:
        """Process joint readings at `stamp` [s]: alpha (n,) [rad], alpha_dot (n,) [rad/s]."""
        p = self.parameters
        last, self._joint_stamp = self._joint_stamp, stamp
        if last is None:
            self._joints[0] = alpha
            self._joints[1] = alpha_dot
            return
        dt = min(max(stamp - last, 0.0), LONGEST_STEP)
        self._follow_joints(
            self._memory,
            alpha,
            alpha_dot,
            p.joint_bandwidth,
            p.joint_velocity_weight,
            p.joint_acceleration_cutoff,
            dt,
        )

    def update(self) -> np.ndarray:
        """Return the state (3, 6 + n) at the newest IMU stamp; the next call reuses the array."""
        p = self.parameters
        self._assemble(
            self._pose.memory,
            self._memory,
            self._period,
            p.angular_acceleration_cutoff,
            p.acceleration_cutoff,
        )
        return self._state


FIXED = 27  # numbers of an estimator's memory without joints
PER_JOINT = 7


def memory_size(joints: int) -> int:
    """Return the length of an estimator's memory, see `arrays_of`."""
    return FIXED + PER_JOINT * joints


@jit
def arrays_of(
    memory: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return state (3, 6 + n), joints (2, n): angles [rad] and velocities [rad/s], and the filters:
    of the joints (2, n), of the body rates (2, 3), of the acceleration (3,).

    They are views of memory, see `memory_size`: a call passes one array instead of five.
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
def follow_joints(
    memory: np.ndarray,
    alpha: np.ndarray,
    alpha_dot: np.ndarray,
    bandwidth: float,
    velocity_weight: float,
    acceleration_cutoff: float,
    dt: float,
) -> None:
    """Advance the joints by dt [s] with readings alpha (n,) [rad], alpha_dot (n,) [rad/s].

    memory: see `arrays_of`; bandwidth, velocity_weight: see `joint_step`; acceleration_cutoff [Hz]:
    see `derivative_step`. Writes the accelerations into the state.
    """
    state, joints, joints_filter, _, _ = arrays_of(memory)
    joint_step(alpha, alpha_dot, bandwidth, velocity_weight, dt, joints)
    derivative_step(joints[1], acceleration_cutoff, dt, joints_filter, state[CHI_DDOT, ALPHA:])


@jit
def write_biases(pose: np.ndarray, found: np.ndarray) -> None:
    """Write the biases of gyroscope and accelerometer into found (2, 3), FLU; pose: `parts_of`."""
    motion, _, _ = parts_of(pose)
    found[0] = motion.gyro_bias
    found[1] = rotate_back(matrix_from_quaternion(motion.quaternion), motion.accelerometer_bias)


@jit
def predict_and_assemble(
    pose: np.ndarray,
    memory: np.ndarray,
    row: int,
    stamp: float,
    period: float,
    gravity: float,
    gyro: np.ndarray,
    specific_force: np.ndarray,
    angular_cutoff: float,
    linear_cutoff: float,
) -> None:
    """Integrate an IMU sample, see `predict_next`, and write the state, see `assemble_stored`."""
    predict_next(pose, row, stamp, period, gravity, gyro, specific_force)
    assemble_stored(pose, memory, period, angular_cutoff, linear_cutoff)


@jit
def assemble_stored(
    pose: np.ndarray, memory: np.ndarray, period: float, angular_cutoff: float, linear_cutoff: float
) -> None:
    """Write the state into memory, see `arrays_of` and `assemble`; pose: see `parts_of`."""
    motion, _, _ = parts_of(pose)
    state, joints, _, rates_filter, acceleration = arrays_of(memory)
    assemble(
        motion, joints, period, angular_cutoff, linear_cutoff, rates_filter, acceleration, state
    )


@jit
def assemble(
    motion: EstimatedMotion,
    joints: np.ndarray,
    period: float,
    angular_cutoff: float,
    linear_cutoff: float,
    rates_filter: np.ndarray,
    filtered: np.ndarray,
    state: np.ndarray,
) -> None:
    """Filter the accelerations over `period` [s] and write the state (3, 6 + n).

    joints (2, n): angles [rad] and velocities [rad/s]; cutoffs [Hz]; rates_filter (2, 3),
    filtered (3,): states of the filters, updated.
    """
    rates = motion.rates
    if period > 0.0:
        derivative_step(rates, angular_cutoff, period, rates_filter, state[CHI_DDOT, ROLL:ALPHA])
        low_pass_step(motion.acceleration, linear_cutoff, period, filtered)
    euler = euler_from_quaternion(motion.quaternion)
    for i in range(3):
        state[CHI, X + i], state[CHI, ROLL + i] = motion.position[i], euler[i]
        state[CHI_DOT, X + i], state[CHI_DOT, ROLL + i] = motion.velocity[i], rates[i]
        state[CHI_DDOT, X + i] = filtered[i]
    for i in range(joints.shape[1]):
        state[CHI, ALPHA + i], state[CHI_DOT, ALPHA + i] = joints[0, i], joints[1, i]
