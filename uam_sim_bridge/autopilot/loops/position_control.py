"""Position control in OFFBOARD, with PX4's structure (v1.16, PositionControl):

    v_sp = v_ff + P_p (p_sp - p), limited;   a_sp = a_ff + P_v (v_sp - v) + integral - D_v dv/dt
    thrust direction from the horizontal acceleration and gravity, limited tilt
    collective = (hover thrust (1 - a_sp,z / g)) / cos(tilt)

With MPC_ACC_DECOUPLE 1, the default, the vertical acceleration does not change the tilt. The
integral stops vertically while the thrust saturates, and horizontally by tracking (arw_gain). PX4
runs this loop at the rate of its estimate, some 100 Hz, and estimates the hover thrust
(MPC_USE_HTE); here it runs at each sample, with MPC_THR_HOVER. All vectors are NED.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.rotations import quaternion_from_euler
from uam_control.setpoints.targets import PositionTarget
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE, GRAVITY, POSITION, VELOCITY
from uam_sim_bridge.autopilot.loops.attitude_control import attitude_gains, attitude_rates
from uam_sim_bridge.autopilot.params import Parameters


class PositionControl:
    """The cascade with its memory; call `reset` while another mode flies."""

    def __init__(self, parameters: Parameters) -> None:
        self.setpoint = np.zeros(4)
        self._integral = np.zeros(3)  # [m/s^2]
        self._velocity: np.ndarray | None = None  # of the last cycle
        self._slope = np.zeros(3)  # [m/s^2] low-pass filtered derivative of the velocity
        self.configure(parameters)

    def configure(self, parameters: Parameters) -> None:
        """Take the gains from the autopilot's parameters."""
        p = self._parameters = parameters

        def gains(xy: str, z: str) -> np.ndarray:
            return np.array([p[xy], p[xy], p[z]])

        self._position_gain = gains("MPC_XY_P", "MPC_Z_P")
        self._p = gains("MPC_XY_VEL_P_ACC", "MPC_Z_VEL_P_ACC")
        self._i = gains("MPC_XY_VEL_I_ACC", "MPC_Z_VEL_I_ACC")
        self._d = gains("MPC_XY_VEL_D_ACC", "MPC_Z_VEL_D_ACC")
        self._attitude_gains = attitude_gains(p)

    def reset(self) -> None:
        """Clear the memory."""
        if self._velocity is not None:
            self._integral[:], self._slope[:], self._velocity = 0.0, 0.0, None

    def update(self, target: PositionTarget, estimate: np.ndarray, dt: float) -> np.ndarray:
        """Return the setpoint (4,): body rates [rad/s, FRD], thrust.

        estimate (10,): of `Estimator`; dt [s].
        """
        p = self._parameters
        position, velocity = estimate[POSITION], estimate[VELOCITY]
        self._differentiate(velocity, dt)
        back = self._position_gain * (target.position - position)
        desired = back + target.velocity
        limit_across(back, target.velocity, p["MPC_XY_VEL_MAX"], desired)
        desired[2] = min(p["MPC_Z_VEL_MAX_DN"], max(-p["MPC_Z_VEL_MAX_UP"], desired[2]))
        error = desired - velocity
        self._integral[2] = min(GRAVITY, max(-GRAVITY, self._integral[2]))
        acceleration = (
            target.acceleration + self._p * error + self._integral - self._d * self._slope
        )
        axis, thrust = self._thrust(acceleration)
        least, most = p["MPC_THR_MIN"], p["MPC_THR_MAX"]
        if (thrust[2] >= -least and error[2] >= 0.0) or (thrust[2] <= -most and error[2] <= 0.0):
            error[2] = 0.0
        # vertical thrust comes first, but leaves a margin for the horizontal one
        across = math.hypot(thrust[0], thrust[1])
        kept = min(across, p["MPC_THR_XY_MARG"])
        thrust[2] = max(thrust[2], -math.sqrt(most * most - kept * kept))
        allowed = math.sqrt(max(0.0, most * most - thrust[2] * thrust[2]))
        if across > allowed:
            thrust[:2] *= allowed / across
        produced = thrust[:2] * GRAVITY / p["MPC_THR_HOVER"]
        if acceleration[0] ** 2 + acceleration[1] ** 2 > produced[0] ** 2 + produced[1] ** 2:
            error[:2] -= 2.0 / self._p[0] * (acceleration[:2] - produced)
        self._integral += self._i * error * dt
        size = math.sqrt(float(thrust @ thrust))
        if size > 1e-6:
            axis = -thrust / size
        attitude_rates(
            estimate[ATTITUDE],
            attitude_of(axis, target.yaw),
            target.yaw_rate,
            self._attitude_gains,
            self.setpoint,
        )
        self.setpoint[3] = min(most, size)
        return self.setpoint

    def _differentiate(self, velocity: np.ndarray, dt: float) -> None:
        if self._velocity is not None:
            share = dt / (dt + 1.0 / (2.0 * math.pi * self._parameters["MPC_VELD_LP"]))
            self._slope += share * ((velocity - self._velocity) / dt - self._slope)
        self._velocity = velocity.copy()

    def _thrust(self, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the body's z axis (3,) and the thrust (3,), normalised, of acceleration (3,)."""
        p = self._parameters
        down = GRAVITY if p["MPC_ACC_DECOUPLE"] else GRAVITY - acceleration[2]
        axis = np.array([-acceleration[0], -acceleration[1], down])
        axis /= math.sqrt(float(axis @ axis))
        tilt = math.radians(p["MPC_TILTMAX_AIR"])
        across = math.hypot(axis[0], axis[1])
        if math.atan2(across, axis[2]) > tilt:
            axis[:2] *= math.sin(tilt) / across
            axis[2] = math.cos(tilt)
        hover = p["MPC_THR_HOVER"]
        vertical = acceleration[2] * hover / GRAVITY - hover
        return axis, axis * min(vertical / axis[2], -p["MPC_THR_MIN"])


def limit_across(first: np.ndarray, second: np.ndarray, most: float, total: np.ndarray) -> None:
    """Write first + second, horizontally at most `most` [m/s], to total (3,); first has priority.

    Source: PX4, ControlMath::constrainXY.
    """
    a, b = first[:2], second[:2]
    if math.hypot(*(a + b)) <= most:
        return
    size = math.hypot(*a)
    if size >= most:
        total[:2] = a / size * most
        return
    other = math.hypot(*b)
    along = float(a @ b) / other
    scale = -along + math.sqrt(along * along - (size * size - most * most))
    total[:2] = a + b / other * scale


def attitude_of(axis: np.ndarray, yaw: float) -> np.ndarray:
    """Return the attitude (4,) FRD → NED with the body's z axis `axis` (3,), z > 0, and yaw [rad].

    As PX4's ControlMath::bodyzToAttitude: the body's x axis has no part across the yaw.
    """
    forward = math.cos(yaw) * axis[0] + math.sin(yaw) * axis[1]
    right = math.cos(yaw) * axis[1] - math.sin(yaw) * axis[0]
    roll = -math.asin(min(1.0, max(-1.0, right)))
    return quaternion_from_euler(np.array([roll, math.atan2(forward, axis[2]), yaw]))
