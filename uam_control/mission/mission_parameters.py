"""Parameters of the mission node."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.settings.parameter_set import number
from uam_control.supervision import SupervisionParameters


@dataclass(frozen=True)
class MissionParameters(SupervisionParameters):
    """Times and limits of take-off and touchdown, and the parameters of the supervisor."""

    takeoff_delay: float = number(0.5, "time from armed to take-off", "s", 0.0, 60.0)
    touchdown_height: float = number(0.05, "height that counts as on the ground", "m", 0.0, 0.5)
    touchdown_speed: float = number(0.10, "vertical speed that counts as at rest", "m/s", 0.0, 1.0)
    touchdown_time: float = number(
        0.3, "time on the ground and at rest before touchdown is detected", "s", 0.0, 5.0
    )
    touchdown_timeout: float = number(8.0, "longest wait for touchdown", "s", 0.0, 60.0)
    settle_time: float = number(
        1.5, "time from touchdown to the end of the mission", "s", 0.0, 60.0
    )
