"""Largest age of the poses with which the estimate still settles, found with `StateEstimator`.

The latency of motion capture is in no other loop: while IMU and poses agree, the estimate does not
depend on it. An error of the estimate decays through the poses, and their latency acts there.
"""

import math

import numpy as np

from uam_control.coordinates import CHI, PITCH, X
from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.maths.rotations import quaternion_from_euler

STEP, OLDEST = 0.008, 0.240  # [s] of the ages that are tried
ERROR = 0.02  # [m], [rad] at the start
DURATION = 4.0  # [s]
SETTLED = 0.25  # of the error, at the end


def pose_delay(parameters: EstimatorParameters, period: float, rate: float) -> float:
    """Return the largest age [s] of a pose at its arrival, at which and below which it settles.

    period [s]: of the IMU; rate [Hz]: of motion capture.
    """
    largest = 0.0
    for age in np.arange(0.0, OLDEST + 0.5 * STEP, STEP):
        if remaining(parameters, float(age), period, rate) > SETTLED:
            break
        largest = float(age)
    return largest


def remaining(parameters: EstimatorParameters, age: float, period: float, rate: float) -> float:
    """Return the share of the error that remains after DURATION with poses of `age` [s]."""
    estimator = StateEstimator(parameters, 0)
    rest, level = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    weight = np.array([0.0, 0.0, parameters.gravity])
    # the first pose is wrong, the others are those of a vehicle at rest
    wrong = quaternion_from_euler(np.array([0.0, ERROR, 0.0]))
    estimator.mocap(0.0, np.array([ERROR, 0.0, 0.0]), wrong)
    due, worst = 0.0, 0.0
    for tick in range(1, round(DURATION / period)):
        time = tick * period
        estimator.imu(time, rest, weight)
        state = estimator.update()
        if time >= due:
            due += 1.0 / rate
            jitter = 1e-9 * tick  # two equal poses count as a frozen tracker
            if time > age:
                estimator.mocap(time - age, np.array([jitter, 0.0, 0.0]), level)
        if time > 0.75 * DURATION:
            worst = max(worst, abs(state[CHI, X]), abs(state[CHI, PITCH]))
    return worst / ERROR if math.isfinite(worst) else math.inf
