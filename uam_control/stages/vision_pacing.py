"""Selection and rate of the mocap poses sent to the autopilot's estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uam_control.ages import FORWARDED
from uam_control.coordinates import CHI, CHI_DOT
from uam_control.estimation.pose_clock import PoseClock
from uam_control.estimation.repeats import Repeats
from uam_control.maths.compiled import jit
from uam_control.setpoints.vision_pose import VisionPose
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stages.autopilot_port import AutopilotPort

# [m] by which a pose may be off the estimate: more than an estimate drifts without poses before the
# failsafe; PX4's EKF2 rejects a pose at 5 standard deviations, about as much
BEYOND = 0.5


@dataclass(frozen=True)
class VisionParameters(ParameterSet):
    """Rate and accuracy of the poses sent."""

    vision_interval: float = number(0.02, "least time between two vision poses sent", "s", 0.0, 1.0)
    vision_position_deviation: float = number(
        0.005, "standard deviation sent with a vision pose", "m", 1e-4, 1.0
    )
    vision_attitude_deviation: float = number(
        0.02, "standard deviation sent with a vision pose", "rad", 1e-4, 1.0
    )


class VisionPacing:
    """Stores the newest pose and sends it when the interval has passed.

    PX4 recommends 30 to 50 Hz: a higher rate does not improve its EKF and loads a serial line.
    """

    def __init__(self, parameters: VisionParameters) -> None:
        self._parameters = parameters
        self._pose: tuple[float, np.ndarray, np.ndarray] | None = None
        self._sent = -1.0  # [s] exposure of the last pose sent
        self._clock, self._repeats = PoseClock(), Repeats()

    def take(
        self, exposed: float, position: np.ndarray, quaternion: np.ndarray, armed: bool
    ) -> bool:
        """Store a pose of `exposed` [s]; return whether it is used.

        position (3,) [m, ENU]; quaternion (4,) [w x y z], FLU → ENU. In flight (`armed`) a pose
        equal to the one before is discarded: the tracker is frozen.
        """
        if self._repeats(position, quaternion) and armed:
            return False
        self._pose = exposed, position, quaternion
        return True

    def send(self, autopilot: AutopilotPort, now: float, state: np.ndarray | None) -> None:
        """Send the newest pose if it is due at `now` [s], not too old, and of a right clock.

        state (3, 6 + n): estimate of an armed vehicle, None if there is none. A pose that it
        contradicts is discarded: the autopilot would follow it.
        """
        if self._pose is None or not self._clock(self._pose[0], now, FORWARDED):
            return
        p = self._parameters
        exposed, position, quaternion = self._pose
        if exposed - self._sent >= p.vision_interval - 1e-9:
            self._pose = None
            if state is not None and beyond(position, state, now - exposed) > BEYOND:
                return
            self._sent = exposed
            deviations = p.vision_position_deviation, p.vision_attitude_deviation
            autopilot.send_vision(VisionPose(exposed, position, quaternion, *deviations))


@jit
def beyond(position: np.ndarray, state: np.ndarray, age: float) -> float:
    """Return the distance [m] of a pose's position (3,) from the estimate (3, 6 + n), less the way
    that the vehicle goes in the pose's age [s]."""
    distance = speed = 0.0
    for i in range(3):
        distance += (position[i] - state[CHI, i]) ** 2
        speed += state[CHI_DOT, i] ** 2
    return math.sqrt(distance) - abs(age) * math.sqrt(speed)
