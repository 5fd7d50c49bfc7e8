"""The failsafe descent: level attitude, constant sink speed (PX4's mode Descend)."""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import jit
from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE, DOWN, GRAVITY
from uam_sim_bridge.autopilot.params import Parameters

_MIN_COSINE = 0.5  # smallest cosine of the tilt for which the thrust is corrected


@jit
def descend(
    euler: np.ndarray,
    sink_rate: float,
    integral: float,
    dt: float,
    gains: np.ndarray,
    setpoint: np.ndarray,
) -> float:
    """Write body rates [rad/s, FRD] and thrust into setpoint (4,); return the new integral.

    euler (3,): roll, pitch, yaw [rad], FRD in NED; sink_rate [m/s] down; integral: acceleration
    [m/s^2] down; dt [s]; gains (8,): roll P, pitch P, sink speed, P, I, hover thrust, smallest and
    largest thrust.
    """
    setpoint[0] = -gains[0] * euler[0]
    setpoint[1] = -gains[1] * euler[1]
    setpoint[2] = 0.0
    error = gains[2] - sink_rate
    integral = min(GRAVITY, max(-GRAVITY, integral + gains[4] * error * dt))
    upward = GRAVITY - gains[3] * error - integral
    cosine = max(_MIN_COSINE, math.cos(euler[0]) * math.cos(euler[1]))
    thrust = gains[5] * upward / GRAVITY / cosine
    setpoint[3] = min(gains[7], max(gains[6], thrust))
    return integral


class Descent:
    """The descent. `integral` [m/s^2]: set it to 0 at each start of a descent."""

    def __init__(self, parameters: Parameters) -> None:
        self.setpoint = np.zeros(4)
        self.integral = 0.0
        self.configure(parameters)

    def configure(self, parameters: Parameters) -> None:
        """Take the gains from the autopilot's parameters."""
        self._gains = np.array(
            parameters.vector(
                "MC_ROLL_P",
                "MC_PITCH_P",
                "MPC_LAND_SPEED",
                "MPC_Z_VEL_P_ACC",
                "MPC_Z_VEL_I_ACC",
                "MPC_THR_HOVER",
                "MPC_THR_MIN",
                "MPC_THR_MAX",
            )
        )

    def update(self, estimate: np.ndarray, dt: float) -> np.ndarray:
        """Return the setpoint (4,): body rates [rad/s, FRD], thrust.

        estimate (10,): of `Estimator`; dt [s].
        """
        euler = euler_from_quaternion(estimate[ATTITUDE])
        sink = estimate[DOWN]
        self.integral = descend(euler, sink, self.integral, dt, self._gains, self.setpoint)
        return self.setpoint
