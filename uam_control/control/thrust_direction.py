"""The desired attitude, which points the thrust along tau_p, and its filter.

tau_p = R_B^W U, U = [0 0 u_1], eq. (4a), pos, determines roll and pitch for a given yaw. They are
the angles that the reference has by its own acceleration (`mission/motion/flatness.py`) plus a
correction from the feedback. The reference's angles and their derivatives are exact and pass
unchanged. The correction contains the noise of the position loop; a critically damped second-order
filter gives it with two derivatives, without differentiating the noise.
"""

import math

import numpy as np

from uam_control.coordinates import ATTITUDE, CHI, CHI_DDOT, CHI_DOT, PITCH, ROLL, YAW, X, Y, Z
from uam_control.maths.compiled import borrowing
from uam_control.maths.rotations import body_rates, thrust_attitude
from uam_control.maths.vectors import Vector, cross, dot, minus, plus, times

ANGLE, RATE = range(2)  # columns of the filter
LEAD_TIME = 0.5  # [s] in which the lead decays by a factor e
_LEAST_COSINE = 0.1  # of the pitch, in Euler rates


class AttitudeReference:
    """Desired attitude: roll and pitch from tau_p, yaw from the mission.

    `value` (3, 3): rows q_d = roll, pitch, yaw [rad], Omega_d [rad/s], Omega_d_dot [rad/s^2]; the
    last two rows are in the desired body frame (FLU). Columns: about X, Y, Z.
    """

    def __init__(self) -> None:
        self.value = np.zeros((3, 3))
        self.filter = np.zeros((2, 2))  # rows roll, pitch: angle, rate
        self.lead = np.zeros(2)  # of roll, pitch [rad]

    def reset(self, yaw: float) -> None:
        """Set the desired attitude to level at `yaw` [rad], with zero rates."""
        self.filter[:] = self.lead[:] = 0.0
        self.value[:] = 0.0
        self.value[CHI, Z] = yaw

    def begin(self, state: np.ndarray, reference: np.ndarray) -> None:
        """Begin with roll, pitch and their rates of state (3, 6 + n), for a vehicle that moves.

        reference (3, 6 + n): of the same tick; what it lacks of the state is the first correction.
        The next update adds the lead to the filter's input that makes the angular acceleration
        zero, so the torque has no step; it decays within LEAD_TIME.
        """
        (roll, pitch, _), about = state[CHI, ATTITUDE], state[CHI_DOT, ATTITUDE]
        across = math.sin(roll) * about[Y] + math.cos(roll) * about[Z]
        level = max(_LEAST_COSINE, math.cos(pitch))
        self.filter[X] = roll, about[X] + across * math.sin(pitch) / level
        self.filter[Y] = pitch, math.cos(roll) * about[Y] - math.sin(roll) * about[Z]
        self.filter[:, ANGLE] -= reference[CHI, ROLL:YAW]
        self.filter[:, RATE] -= reference[CHI_DOT, ROLL:YAW]
        self.lead[:] = math.nan


@borrowing
def attitude_reference_step(
    tau_p: np.ndarray,
    reference: np.ndarray,
    cutoff: float,
    dt: float,
    filtered: np.ndarray,
    lead: np.ndarray,
    value: np.ndarray,
) -> None:
    """Advance the filter and write q_d, Omega_d, Omega_d_dot into value (3, 3).

    tau_p (3,) [N, ENU], z > 0; reference (3, 6 + n): gives roll, pitch, yaw and their derivatives;
    cutoff [Hz]: corner of the filter; dt [s]; filtered (2, 2): rows roll, pitch: angle [rad], rate
    [rad/s] of the correction; lead (2,): of roll and pitch [rad], added to the input; NaN: see
    `AttitudeReference.begin`.
    """
    yaw, yaw_rate = reference[CHI, YAW], reference[CHI_DOT, YAW]
    yaw_acceleration = reference[CHI_DDOT, YAW]
    desired_roll, desired_pitch = thrust_attitude(tau_p, yaw)
    correction_roll = desired_roll - reference[CHI, ROLL]
    correction_pitch = desired_pitch - reference[CHI, PITCH]

    omega = 2.0 * math.pi * cutoff
    for axis in (X, Y):
        desired = correction_roll if axis == X else correction_pitch
        angle, rate = filtered[axis, ANGLE], filtered[axis, RATE]
        if math.isnan(lead[axis]):
            lead[axis] = angle + 2.0 * rate / omega - desired
        desired += lead[axis]
        lead[axis] *= math.exp(-dt / LEAD_TIME)
        # exact step of the critically damped filter for a constant input
        decay = math.exp(-omega * dt)
        offset = angle - desired
        slope = rate + omega * offset
        filtered[axis, ANGLE] = desired + decay * (offset + slope * dt)
        filtered[axis, RATE] = decay * (rate - omega * slope * dt)
        value[CHI_DDOT, axis] = -omega * omega * (filtered[axis, ANGLE] - desired) - (
            2.0 * omega * filtered[axis, RATE]
        )

    roll_acceleration = value[CHI_DDOT, X] + reference[CHI_DDOT, ROLL]
    pitch_acceleration = value[CHI_DDOT, Y] + reference[CHI_DDOT, PITCH]
    roll, pitch = (
        reference[CHI, ROLL] + filtered[X, ANGLE],
        reference[CHI, PITCH] + filtered[Y, ANGLE],
    )
    roll_rate = reference[CHI_DOT, ROLL] + filtered[X, RATE]
    pitch_rate = reference[CHI_DOT, PITCH] + filtered[Y, RATE]
    value[CHI, X], value[CHI, Y], value[CHI, Z] = roll, pitch, yaw
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    value[CHI_DOT, X], value[CHI_DOT, Y], value[CHI_DOT, Z] = body_rates(
        roll, pitch, roll_rate, pitch_rate, yaw_rate
    )
    # their derivative
    value[CHI_DDOT, X] = roll_acceleration - sp * yaw_acceleration - cp * pitch_rate * yaw_rate
    value[CHI_DDOT, Y] = (
        cr * pitch_acceleration
        + sr * cp * yaw_acceleration
        - sr * roll_rate * pitch_rate
        + (cr * cp * roll_rate - sr * sp * pitch_rate) * yaw_rate
    )
    value[CHI_DDOT, Z] = (
        -sr * pitch_acceleration
        + cr * cp * yaw_acceleration
        - cr * roll_rate * pitch_rate
        - (sr * cp * roll_rate + cr * sp * pitch_rate) * yaw_rate
    )


@borrowing
def write_thrust_attitude(
    force: Vector, change: Vector, bend: Vector, heading: np.ndarray, value: np.ndarray
) -> None:
    """Write q_d, Omega_d, Omega_d_dot of a thrust along force to value (3, 3), exactly.

    force, change, bend [N, ENU]: the force and its first two derivatives; heading (3,): direction
    [rad] of the body's x axis, as far as the thrust leaves it, and derivatives. Source: Lee 2010.
    """
    c, s = math.cos(heading[0]), math.sin(heading[0])
    rate, growth = heading[1], heading[2]
    ahead = (c, s, 0.0)
    ahead_1 = (-rate * s, rate * c, 0.0)
    ahead_2 = (-growth * s - rate * rate * c, growth * c - rate * rate * s, 0.0)
    z, z_1, z_2 = _unit(force, change, bend)
    side_1 = plus(cross(z_1, ahead), cross(z, ahead_1))
    side_2 = plus(plus(cross(z_2, ahead), cross(z, ahead_2)), times(2.0, cross(z_1, ahead_1)))
    y, y_1, y_2 = _unit(cross(z, ahead), side_1, side_2)
    x, x_1 = cross(y, z), plus(cross(y_1, z), cross(y, z_1))
    x_2 = plus(plus(cross(y_2, z), cross(y, z_2)), times(2.0, cross(y_1, z_1)))
    value[CHI, X] = math.atan2(y[2], z[2])
    value[CHI, Y] = math.asin(min(1.0, max(-1.0, -x[2])))
    value[CHI, Z] = math.atan2(x[1], x[0])
    value[CHI_DOT, X], value[CHI_DDOT, X] = dot(y_1, z), dot(y_2, z) + dot(y_1, z_1)
    value[CHI_DOT, Y], value[CHI_DDOT, Y] = dot(z_1, x), dot(z_2, x) + dot(z_1, x_1)
    value[CHI_DOT, Z], value[CHI_DDOT, Z] = dot(x_1, y), dot(x_2, y) + dot(x_1, y_1)


@borrowing
def _unit(v: Vector, v_1: Vector, v_2: Vector) -> tuple[Vector, Vector, Vector]:
    """Return v / |v| and its first two derivatives, of those of v."""
    size = math.sqrt(dot(v, v))
    size_1 = dot(v, v_1) / size
    size_2 = (dot(v_1, v_1) + dot(v, v_2) - size_1 * size_1) / size
    one = times(1.0 / size, v)
    one_1 = times(1.0 / size, minus(v_1, times(size_1, one)))
    rest = plus(times(size_2, one), times(2.0 * size_1, one_1))
    return one, one_1, times(1.0 / size, minus(v_2, rest))
