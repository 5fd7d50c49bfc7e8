"""The failsafe descent: level attitude, constant sink speed (PX4's mode Descend).

Without a valid vertical velocity the thrust is a bit below that of hover, as in PX4. PX4 keeps that
thrust on the ground, too, and its land detector then needs the velocity that is missing. Here the
thrust falls when every vehicle of a laboratory has come down, so that the landing is detected.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE, DOWN, GRAVITY
from uam_sim_bridge.autopilot.params import Parameters

_MIN_COSINE = 0.5  # smallest cosine of the tilt for which the thrust is corrected
_BELOW_HOVER = 0.3  # m/s^2 down, without a valid vertical velocity (PX4)
_DOWN_BY_NOW = 5.0  # s of such a descent, after which the thrust falls
_FALLING = 1.0  # m/s^3, the fall of the thrust


@borrowing
def descend(euler: np.ndarray, downward: float, gains: np.ndarray, setpoint: np.ndarray) -> None:
    """Write body rates [rad/s, FRD] and thrust into setpoint (4,).

    euler (3,): roll, pitch, yaw [rad], FRD in NED; downward: desired acceleration [m/s^2]; gains
    (5,): roll P, pitch P, hover thrust, smallest and largest thrust.
    """
    setpoint[0] = -gains[0] * euler[0]
    setpoint[1] = -gains[1] * euler[1]
    setpoint[2] = 0.0
    cosine = max(_MIN_COSINE, math.cos(euler[0]) * math.cos(euler[1]))
    thrust = gains[2] * (GRAVITY - downward) / GRAVITY / cosine
    setpoint[3] = min(gains[4], max(gains[3], thrust))


class Descent:
    """The descent; call `reset` while another mode flies."""

    def __init__(self, parameters: Parameters) -> None:
        self.setpoint = np.zeros(4)
        self.reset()
        self.configure(parameters)

    def configure(self, parameters: Parameters) -> None:
        """Take the gains from the autopilot's parameters."""
        self._speed, self._gain, self._integral_gain = parameters.vector(
            "MPC_LAND_SPEED", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC"
        )
        self._gains = np.array(
            parameters.vector(
                "MC_ROLL_P", "MC_PITCH_P", "MPC_THR_HOVER", "MPC_THR_MIN", "MPC_THR_MAX"
            )
        )

    def reset(self) -> None:
        """Clear the memory."""
        self._integral = 0.0  # acceleration [m/s^2] down
        self._blind = 0.0  # s without a valid vertical velocity

    def update(
        self, estimate: np.ndarray, dt: float, sink_known: bool, contact: bool
    ) -> np.ndarray:
        """Return the setpoint (4,): body rates [rad/s, FRD], thrust.

        estimate (10,): of `Estimator`; dt [s]; sink_known: its vertical velocity is valid; contact:
        the ground is touched, and the vehicle only waits for the end of the flight, as in PX4.
        """
        if contact:
            self.reset()
            downward = GRAVITY
        elif sink_known:
            error = self._speed - estimate[DOWN]
            integral = self._integral + self._integral_gain * error * dt
            self._integral = min(GRAVITY, max(-GRAVITY, integral))
            downward = self._gain * error + self._integral
        else:
            self._blind += dt
            falling = _FALLING * max(0.0, self._blind - _DOWN_BY_NOW)
            downward = self._integral + _BELOW_HOVER + falling
        descend(euler_from_quaternion(estimate[ATTITUDE]), downward, self._gains, self.setpoint)
        return self.setpoint
