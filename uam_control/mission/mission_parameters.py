"""What the mission node can be told."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.settings.parameter_set import number
from uam_control.supervision import SupervisionParameters


@dataclass(frozen=True)
class MissionParameters(SupervisionParameters):
    """When the flight begins and ends, and what the supervisor watches."""

    takeoff_delay: float = number(0.5, "from armed to take-off", "s", 0.0, 60.0)
    touchdown_height: float = number(0.05, "height that counts as on the ground", "m", 0.0, 0.5)
    touchdown_speed: float = number(0.10, "vertical speed that counts as at rest", "m/s", 0.0, 1.0)
    touchdown_time: float = number(0.3, "how long both must hold", "s", 0.0, 5.0)
    touchdown_timeout: float = number(8.0, "longest wait for touchdown", "s", 0.0, 60.0)
    settle_time: float = number(1.5, "from touchdown to the end", "s", 0.0, 60.0)
