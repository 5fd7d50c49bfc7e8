"""Estimator: joints, pose and IMU sample of a tick → state."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.ages import UNAIDED
from uam_control.estimation.estimator import (
    LONGEST_STEP,
    QUIET_BANDWIDTH,
    follow_joints,
    predict_and_assemble,
)
from uam_control.estimation.history import OLDEST_MATCH
from uam_control.estimation.pose_filter import (
    HISTORY,
    LARGEST_GAIN,
    LATE,
    LATE_SHARE,
    correct_stored,
    match_stored,
    parts_of,
)
from uam_control.estimation.pose_gate import CONTRADICTED
from uam_control.estimation.pose_gate import MEMORY as GATE_MEMORY
from uam_control.maths.compiled import borrowing
from uam_control.stages.estimator_stage import BIAS_PERIOD, MEMORY, EstimatorStage, believable
from uam_control.stages.tick_stamps import WINDOW
from uam_control.stamps import SECOND
from uam_lab.flights.direct.steady.memory import load_pose, numbers, put, record, store_pose

NOTHING, STEADY, DIVERGED = range(3)  # what `estimate` has done


class Estimation(NamedTuple):
    """State of the estimator. pose, own: its memories; newest (7,): pose that corrected it last;
    bandwidths (2,) [rad/s]; memory: see WHOLE and REAL."""

    pose: np.ndarray
    own: np.ndarray
    newest: np.ndarray
    bandwidths: np.ndarray
    memory: np.ndarray


WHOLE = "stamp period count bias_due age_known largest_age"
REAL = (
    "imu_stamp joint_stamp step age "
    "last_correction compared widest "
    "gate gate_suspended gate_last gate_interrupted "
    "gravity angular_cutoff linear_cutoff joint_bandwidth velocity_weight joint_cutoff bandwidth"
)


class EstimationPart:
    """The part of an `EstimatorStage`."""

    def __init__(self, stage: EstimatorStage) -> None:
        self._stage = stage
        self._of: object = None  # the estimator to which the arrays belong
        self._begun = 0  # [ns] stamp at `load`
        self._new_arrays()

    def _new_arrays(self) -> None:
        self._of = estimator = self._stage.estimator
        self.arrays = Estimation(
            estimator._pose.memory,
            estimator._memory,
            np.zeros(7),
            np.zeros(2),
            record(WHOLE, REAL),
        )

    def load(self) -> bool:
        """Copy the state into the arrays; return whether its ticks may be steady."""
        stage, ticks = self._stage, self._stage.ticks
        estimator, age = stage.estimator, stage.pose_age
        pose, p = estimator._pose, estimator.parameters
        gate = pose.gate
        ready = (
            not stage._waiting
            and not stage.held_back
            and ticks._sample == ticks.stamp
            and not ticks._difference
            and not pose.ahead
            and not pose._clock_ahead
            and pose._last_correction is not None
            and gate._rejecting_since is None
            and age._arrived is None
        )
        if not ready:
            return False
        if self._of is not estimator:
            self._new_arrays()
        a, self._begun = self.arrays, ticks.stamp
        if not load_pose(pose._repeats, a.newest):
            return False
        a.bandwidths[:] = pose._bandwidths
        a.memory[0] = (
            *(ticks.stamp, ticks.period, pose._count, stage.bias_due),
            *(age.mean is not None, age.largest),
            *(estimator._imu_stamp, estimator._joint_stamp, estimator._period, age.mean or 0.0),
            *(pose._last_correction, pose._compared, pose._widest),
            *(gate.distance, gate._suspended, gate._last, gate._interrupted),
            *(pose.gravity, p.angular_acceleration_cutoff, p.acceleration_cutoff),
            *(p.joint_bandwidth, p.joint_velocity_weight, p.joint_acceleration_cutoff),
            p.position_bandwidth,
        )
        return True

    def store(self) -> None:
        """Copy the state back."""
        stage, a = self._stage, self.arrays
        estimator, ticks, age = stage.estimator, stage.ticks, stage.pose_age
        pose, gate = estimator._pose, estimator._pose.gate
        m = numbers(a.memory)
        stamp, period = m["stamp"], ticks.period
        first = max(self._begun, stamp - (WINDOW + 1) * period) + period
        ticks._window.extend(range(first, stamp + 1, period))
        ticks.stamp = ticks._sample = stamp
        pose._count, stage.bias_due = m["count"], bool(m["bias_due"])
        age.largest = m["largest_age"]
        age.mean = m["age"] if m["age_known"] else None
        estimator._imu_stamp, estimator._joint_stamp = m["imu_stamp"], m["joint_stamp"]
        estimator._period = m["step"]
        pose._last_correction, pose._compared = m["last_correction"], m["compared"]
        gate._suspended, gate._last = m["gate_suspended"], m["gate_last"]
        store_pose(a.newest, pose._repeats)


@borrowing
def same(position: np.ndarray, quaternion: np.ndarray, newest: np.ndarray) -> bool:
    """Return whether position (3,) and quaternion (4,) equal newest (7,), as `Repeats` does."""
    for i in range(7):
        value, before = position[i] if i < 3 else quaternion[i - 3], newest[i]
        if value != before or math.copysign(1.0, value) != math.copysign(1.0, before):
            return False
    return True


@borrowing
def keep_pose(position: np.ndarray, quaternion: np.ndarray, newest: np.ndarray) -> None:
    """Write position (3,) and quaternion (4,) to newest (7,)."""
    put(position, newest[:3])
    put(quaternion, newest[3:])


@borrowing
def estimate(
    a: Estimation,
    stamp: int,
    gyro: np.ndarray,
    force: np.ndarray,
    pose_stamp: int,
    position: np.ndarray,
    quaternion: np.ndarray,
    joint_stamp: int,
    angles: np.ndarray,
    speeds: np.ndarray,
    state: np.ndarray,
) -> int:
    """Do what `EstimatorStage` does with the samples of a tick, or NOTHING.

    Stamps in [ns]; pose_stamp: -1 without a pose; state (3, 6 + n): of the estimator.
    """
    m = a.memory[0]
    if stamp != m.stamp + m.period:
        return NOTHING
    if pose_stamp >= 0 and not correct_pose(a, pose_stamp / SECOND, position, quaternion):
        return NOTHING
    at = joint_stamp / SECOND
    dt = min(max(at - m.joint_stamp, 0.0), LONGEST_STEP)
    m.joint_stamp = at
    follow_joints(a.own, angles, speeds, m.joint_bandwidth, m.velocity_weight, m.joint_cutoff, dt)
    known = m.bandwidth <= QUIET_BANDWIDTH and m.imu_stamp - m.gate_interrupted > GATE_MEMORY
    m.bias_due = stamp // BIAS_PERIOD != m.stamp // BIAS_PERIOD and known
    m.stamp = stamp
    if pose_stamp >= 0:
        age = stamp - pose_stamp
        m.age = m.age + (age - m.age) / MEMORY if m.age_known else float(age)
        m.age_known = 1
        m.largest_age = max(m.largest_age, age)
    now = stamp / SECOND
    m.step = now - m.imu_stamp
    m.imu_stamp = now
    row = m.count % HISTORY
    m.count += 1
    predict_and_assemble(
        *(a.pose, a.own, row, now, m.step, m.gravity),
        *(gyro, force, m.angular_cutoff, m.linear_cutoff),
    )
    return STEADY if believable(state) else DIVERGED


@borrowing
def correct_pose(a: Estimation, stamp: float, position: np.ndarray, quaternion: np.ndarray) -> bool:
    """Do what `PoseFilter.correct` does with a pose of `stamp` [s] that is used; False: nothing."""
    m = a.memory[0]
    newest = (m.count - 1) % HISTORY
    _, stamps, _ = parts_of(a.pose)
    last = stamps[newest]
    compared, gap, jump, bias = match_stored(a.pose, newest, stamp, position)
    trusted = stamp - m.gate_suspended > GATE_MEMORY and not bias > CONTRADICTED
    usual = (
        stamp <= last
        and abs(stamp - compared) <= OLDEST_MATCH
        and compared != m.compared
        and not same(position, quaternion, a.newest)
        and stamp - m.gate_last <= UNAIDED
        and not (jump > m.gate and trusted)
        and last - compared <= LATE
    )
    dt = max(stamp - m.last_correction, 1e-3)
    step = max(dt, gap, LATE_SHARE * (last - compared))
    if not usual or step * m.widest > LARGEST_GAIN:
        return False
    keep_pose(position, quaternion, a.newest)
    if bias > CONTRADICTED:
        m.gate_suspended = stamp
    m.gate_last = stamp
    m.last_correction, m.compared = stamp, compared
    correct_stored(a.pose, dt, a.bandwidths, position, quaternion)
    return True
