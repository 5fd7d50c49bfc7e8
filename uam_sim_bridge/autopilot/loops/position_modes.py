"""Modes that hold a position: HOLD, POSITION (sticks) and RETURN, with PX4's cascade (v1.16).

position → velocity (P), velocity → acceleration (PI), acceleration → thrust direction and thrust →
attitude loop. It is the flight of a pilot or of a failsafe, not of the companion: simple and slow.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.rotations import euler_from_quaternion, quaternion_from_euler
from uam_control.offboard.modes import Mode
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE, GRAVITY, POSITION, VELOCITY
from uam_sim_bridge.autopilot.loops.attitude_control import attitude_gains, attitude_rates
from uam_sim_bridge.autopilot.params import Parameters

MODES = (Mode.HOLD, Mode.POSITION, Mode.RETURN)
_STICK_ZERO = 0.1  # stick deflection that counts as none (PX4: MPC_HOLD_DZ)
_AT_HOME = 0.3  # m, horizontal distance from which RETURN descends
_BRAKING = 0.5  # s, the held position lies this far ahead of a moving vehicle
_INTEGRAL = 2.0 * GRAVITY  # m/s^2, limit of the velocity integral
_LEAST_LIFT = 0.3 * GRAVITY  # m/s^2, smallest upward part of the thrust


class PositionModes:
    """The cascade with its memory; call `reset` while another mode flies.

    `sinking`, `climbing`: whether the last setpoint descends to the ground, or climbs by the stick.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.setpoint = np.zeros(4)
        self.home = np.zeros(3)  # position of arming [m, NED]
        self.sticks = np.zeros(4)  # forward, right, up, yaw clockwise, -1..1
        self.sinking = self.climbing = False
        self._held: np.ndarray | None = None  # position [m, NED]
        self._mode: Mode | None = None
        self._yaw = 0.0
        self._integral = np.zeros(3)  # m/s^2
        self.configure(parameters)

    def configure(self, parameters: Parameters) -> None:
        """Take the gains from the autopilot's parameters."""
        p = self._parameters = parameters
        xy, z = p["MPC_XY_P"], p["MPC_Z_P"]
        self._position_gain = np.array([xy, xy, z])
        xy, z = p["MPC_XY_VEL_P_ACC"], p["MPC_Z_VEL_P_ACC"]
        self._velocity_gain = np.array([xy, xy, z])
        xy, z = p["MPC_XY_VEL_I_ACC"], p["MPC_Z_VEL_I_ACC"]
        self._integral_gain = np.array([xy, xy, z])
        self._attitude_gains = attitude_gains(p)

    def reset(self) -> None:
        """Clear the memory."""
        self._mode, self.sinking = None, False

    def update(self, mode: Mode, estimate: np.ndarray, dt: float) -> np.ndarray:
        """Return the setpoint (4,): body rates [rad/s, FRD], thrust.

        estimate (10,): of `Estimator`; dt [s].
        """
        position, velocity = estimate[POSITION], estimate[VELOCITY]
        if mode is not self._mode:
            self._mode, self._held = mode, position + _BRAKING * velocity
            self._yaw = float(euler_from_quaternion(estimate[ATTITUDE])[2])
            self._integral[:] = 0.0
        desired = self._desired_velocity(mode, position, dt)
        error = desired - velocity
        self._integral += self._integral_gain * error * dt
        np.clip(self._integral, -_INTEGRAL, _INTEGRAL, out=self._integral)
        acceleration = self._velocity_gain * error + self._integral
        return self._attitude(estimate, acceleration)

    def _desired_velocity(self, mode: Mode, position: np.ndarray, dt: float) -> np.ndarray:
        """Return the desired velocity (3,) [m/s, NED]; moves the held position."""
        p, self.sinking, self.climbing = self._parameters, False, False
        speed, vertical = p["MPC_VEL_MANUAL"], np.zeros(3)
        if mode is Mode.RETURN:
            away = self.home[:2] - position[:2]
            self._held[:2] = self.home[:2]
            if math.hypot(*away) < _AT_HOME:
                self.sinking = True
        moving = np.zeros(3)
        if mode is Mode.POSITION:
            sticks = np.where(np.abs(self.sticks) > _STICK_ZERO, self.sticks, 0.0)
            cosine, sine = math.cos(self._yaw), math.sin(self._yaw)
            forward, right = speed * sticks[:2]
            moving[:2] = cosine * forward - sine * right, sine * forward + cosine * right
            moving[2] = -p["MPC_LAND_SPEED"] * sticks[2]
            self.sinking, self.climbing = bool(sticks[2] < 0.0), bool(sticks[2] > 0.0)
            self._yaw += math.radians(p["MPC_MAN_Y_MAX"]) * sticks[3] * dt
        if self.sinking and mode is Mode.RETURN:
            vertical[2] = p["MPC_LAND_SPEED"]
        fixed = moving == 0.0
        self._held = np.where(fixed, self._held, position)
        if self.sinking:
            self._held[2] = position[2]
        back = self._position_gain * (self._held - position)
        across = math.hypot(back[0], back[1])
        if across > speed:
            back[:2] *= speed / across
        back[2] = min(p["MPC_LAND_SPEED"], max(-p["MPC_LAND_SPEED"], back[2]))
        return np.where(fixed, back, moving) + vertical

    def _attitude(self, estimate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return the setpoint (4,) for an acceleration (3,) [m/s^2, NED]."""
        p = self._parameters
        lift = max(_LEAST_LIFT, GRAVITY - acceleration[2])
        limit = lift * math.tan(math.radians(p["MPC_TILTMAX_AIR"]))
        across = math.hypot(acceleration[0], acceleration[1])
        scale = min(1.0, limit / across) if across > 0.0 else 1.0
        north, east = scale * acceleration[0], scale * acceleration[1]
        cosine, sine = math.cos(self._yaw), math.sin(self._yaw)
        forward, right = cosine * north + sine * east, cosine * east - sine * north
        pitch = math.atan2(-forward, lift)
        roll = math.atan2(right * math.cos(pitch), lift)
        size = math.sqrt(forward**2 + right**2 + lift**2)
        desired = quaternion_from_euler(np.array([roll, pitch, self._yaw]))
        attitude_rates(estimate[ATTITUDE], desired, 0.0, self._attitude_gains, self.setpoint)
        thrust = p["MPC_THR_HOVER"] * size / GRAVITY
        self.setpoint[3] = min(p["MPC_THR_MAX"], max(p["MPC_THR_MIN"], thrust))
        return self.setpoint
