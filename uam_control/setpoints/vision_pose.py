"""A motion-capture pose for the autopilot's estimator."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


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
