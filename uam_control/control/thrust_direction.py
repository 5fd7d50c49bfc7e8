"""The desired attitude, which points the thrust along tau_p, and its filter.

tau_p = R_B^W U, U = [0 0 u_1], eq. (4a), pos, determines roll and pitch for a given yaw. The raw
angles contain the noise of the position loop. A critically damped second-order filter gives q_d,
Omega_d and Omega_d_dot without differentiating the noise.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import jit


class AttitudeReference:
    """Desired attitude: filtered roll and pitch from tau_p, yaw from the mission.

    `value` (3, 3): rows q_d = roll, pitch, yaw [rad], Omega_d [rad/s], Omega_d_dot [rad/s^2]; the
    last two rows are in the desired body frame (FLU).
    """

    def __init__(self, cutoff: float) -> None:
        """cutoff: corner frequency of the filter [Hz]."""
        self.cutoff = cutoff
        self.value = np.zeros((3, 3))
        self._filter = np.zeros((2, 2))  # rows roll, pitch: angle, rate

    def reset(self, yaw: float) -> None:
        """Set the desired attitude to level at `yaw` [rad], with zero rates."""
        self._filter[:] = 0.0
        self.value[:] = 0.0
        self.value[0, 2] = yaw

    def update(self, tau_p: np.ndarray, reference: np.ndarray, dt: float) -> np.ndarray:
        """Advance by dt [s] and return `value` (3, 3).

        tau_p: (3,) [N, ENU], z > 0; reference: (3, 6 + n), gives yaw and its derivatives.
        """
        attitude_reference_step(tau_p, reference, self.cutoff, dt, self._filter, self.value)
        return self.value


@jit
def attitude_reference_step(
    tau_p: np.ndarray,
    reference: np.ndarray,
    cutoff: float,
    dt: float,
    filtered: np.ndarray,
    value: np.ndarray,
) -> None:
    """Advance the filter and write q_d, Omega_d, Omega_d_dot into value (3, 3).

    tau_p, reference, dt: as in `AttitudeReference.update`; cutoff [Hz]; filtered: (2, 2), rows
    roll, pitch: angle [rad], rate [rad/s].
    """
    yaw, yaw_rate, yaw_acceleration = reference[0, 5], reference[1, 5], reference[2, 5]
    cy, sy = math.cos(yaw), math.sin(yaw)
    # eq. (4a), pos, solved for roll and pitch: the third column of eq. (3), rot_matrix, along tau_p
    norm = math.sqrt(tau_p[0] ** 2 + tau_p[1] ** 2 + tau_p[2] ** 2)
    desired_roll = math.asin(max(-1.0, min(1.0, (sy * tau_p[0] - cy * tau_p[1]) / norm)))
    desired_pitch = math.atan2(cy * tau_p[0] + sy * tau_p[1], tau_p[2])

    omega = 2.0 * math.pi * cutoff
    accelerations = np.empty(2)
    for axis in range(2):
        desired = desired_roll if axis == 0 else desired_pitch
        angle, rate = filtered[axis, 0], filtered[axis, 1]
        # exact step of the critically damped filter for a constant input
        decay = math.exp(-omega * dt)
        offset = angle - desired
        slope = rate + omega * offset
        filtered[axis, 0] = desired + decay * (offset + slope * dt)
        filtered[axis, 1] = decay * (rate - omega * slope * dt)
        accelerations[axis] = -omega * omega * (filtered[axis, 0] - desired) - (
            2.0 * omega * filtered[axis, 1]
        )

    roll, pitch = filtered[0, 0], filtered[1, 0]
    roll_rate, pitch_rate = filtered[0, 1], filtered[1, 1]
    value[0, 0], value[0, 1], value[0, 2] = roll, pitch, yaw
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    # body rates of Z-Y-X Euler rates, and their derivative
    value[1, 0] = roll_rate - sp * yaw_rate
    value[1, 1] = cr * pitch_rate + sr * cp * yaw_rate
    value[1, 2] = -sr * pitch_rate + cr * cp * yaw_rate
    value[2, 0] = accelerations[0] - sp * yaw_acceleration - cp * pitch_rate * yaw_rate
    value[2, 1] = (
        cr * accelerations[1]
        + sr * cp * yaw_acceleration
        - sr * roll_rate * pitch_rate
        + (cr * cp * roll_rate - sr * sp * pitch_rate) * yaw_rate
    )
    value[2, 2] = (
        -sr * accelerations[1]
        + cr * cp * yaw_acceleration
        - cr * roll_rate * pitch_rate
        - (sr * cp * roll_rate + cr * sp * pitch_rate) * yaw_rate
    )
