"""Which poses of the motion capture go to the autopilot's estimator, and how often."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.estimation.repeats import Repeats
from uam_control.settings.parameter_set import ParameterSet, number
from uam_sim_bridge.stages.autopilot_port import AutopilotPort


@dataclass(frozen=True)
class VisionParameters(ParameterSet):
    """Rate and accuracy of the poses sent."""

    vision_interval: float = number(0.02, "least time between two vision poses sent", "s", 0.0, 1.0)
    vision_position_deviation: float = number(
        0.005, "standard deviation told with a vision pose", "m", 1e-4, 1.0
    )
    vision_attitude_deviation: float = number(
        0.02, "standard deviation told with a vision pose", "rad", 1e-4, 1.0
    )


class VisionPacing:
    """Keeps the newest pose and sends it when the interval has passed.

    An EKF gains nothing from more than 50 poses a second (30 to 50 Hz is what PX4 recommends), and
    a slow serial line has no room for them.
    """

    def __init__(self, parameters: VisionParameters) -> None:
        self._parameters = parameters
        self._pose: tuple[float, np.ndarray, np.ndarray] | None = None
        self._sent = -1.0  # [s] exposure of the last pose sent
        self._repeats = Repeats()

    def take(
        self, exposed: float, position: np.ndarray, quaternion: np.ndarray, armed: bool
    ) -> bool:
        """Take a pose exposed at `exposed` [s]; whether it is used.

        In flight (`armed`) a pose that repeats the one before is not: the tracker is frozen.
        """
        if self._repeats(position, quaternion) and armed:
            return False
        self._pose = exposed, position, quaternion
        return True

    def send(self, autopilot: AutopilotPort) -> None:
        """Send the newest pose if it is due."""
        if self._pose is None:
            return
        p = self._parameters
        exposed, position, quaternion = self._pose
        if exposed - self._sent >= p.vision_interval - 1e-9:
            self._pose, self._sent = None, exposed
            autopilot.send_vision(
                exposed,
                position,
                quaternion,
                p.vision_position_deviation,
                p.vision_attitude_deviation,
            )
