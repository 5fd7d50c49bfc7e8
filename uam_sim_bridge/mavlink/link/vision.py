"""External vision for the autopilot's estimator: VISION_POSITION_ESTIMATE or ODOMETRY."""

from __future__ import annotations

import numpy as np

from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.mavlink.protocol.frames import (
    swap_body,
    swap_euler,
    swap_quaternion,
    swap_world,
)
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

# places of the diagonal in the upper triangle of the 6x6 covariance, row by row
_DIAGONAL = (0, 6, 11, 15, 18, 20)


def covariance(position_deviation: float, attitude_deviation: float) -> list[float]:
    """Return the 21 numbers of the upper triangle; standard deviations in [m] and [rad]."""
    triangle = [0.0] * 21
    for k, place in enumerate(_DIAGONAL):
        triangle[place] = (position_deviation if k < 3 else attitude_deviation) ** 2
    return triangle


def vision_message(
    stamp: float,
    position: np.ndarray,
    quaternion: np.ndarray,
    position_deviation: float,
    attitude_deviation: float,
) -> Message:
    """Return the message of a pose at `stamp` [s]: position (3,) [m, ENU], FLU → ENU [w x y z]."""
    return mavlink2.MAVLink_vision_position_estimate_message(
        round(stamp * 1e6),
        *swap_world(position).tolist(),
        *swap_euler(euler_from_quaternion(quaternion)).tolist(),
        covariance(position_deviation, attitude_deviation),
        0,
    )


def odometry_message(
    stamp: float,
    position: np.ndarray,
    quaternion: np.ndarray,
    velocity: np.ndarray,
    rates: np.ndarray,
    position_deviation: float,
    attitude_deviation: float,
    velocity_deviation: float,
) -> Message:
    """Return an ODOMETRY (EKF2_EV_CTRL = 15): the pose as above with velocity.

    velocity (3,) [m/s] and rates (3,) [rad/s] in the body, FLU.
    """
    return mavlink2.MAVLink_odometry_message(
        round(stamp * 1e6),
        mavlink2.MAV_FRAME_LOCAL_NED,
        mavlink2.MAV_FRAME_BODY_FRD,
        *swap_world(position).tolist(),
        swap_quaternion(quaternion).tolist(),
        *swap_body(velocity).tolist(),
        *swap_body(rates).tolist(),
        covariance(position_deviation, attitude_deviation),
        covariance(velocity_deviation, attitude_deviation),
    )
