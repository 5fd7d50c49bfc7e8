"""Mocap poses for the autopilot's estimator: VISION_POSITION_ESTIMATE messages."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.mavlink.protocol.frames import swap_euler, swap_world
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

# indices of the diagonal in the upper triangle of the 6x6 covariance, stored row by row
_DIAGONAL = (0, 6, 11, 15, 18, 20)


def covariance(position_deviation: float, attitude_deviation: float) -> list[float]:
    """Return the upper triangle (21,) of the covariance; standard deviations [m] and [rad]."""
    triangle = [0.0] * 21
    for k, place in enumerate(_DIAGONAL):
        triangle[place] = (position_deviation if k < 3 else attitude_deviation) ** 2
    return triangle


class VisionPose(NamedTuple):
    """A mocap pose for the autopilot.

    stamp [s]; position (3,) [m, ENU]; quaternion (4,) [w x y z], FLU → ENU; standard deviations [m]
    and [rad].
    """

    stamp: float
    position: np.ndarray
    quaternion: np.ndarray
    position_deviation: float
    attitude_deviation: float

    def message(self) -> Message:
        """Return it as VISION_POSITION_ESTIMATE."""
        return mavlink2.MAVLink_vision_position_estimate_message(
            round(self.stamp * 1e6),
            *swap_world(self.position).tolist(),
            *swap_euler(euler_from_quaternion(self.quaternion)).tolist(),
            covariance(self.position_deviation, self.attitude_deviation),
            0,
        )
