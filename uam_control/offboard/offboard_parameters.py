"""Parameters of the offboard sequence, which are those of the bridge."""

from dataclasses import dataclass

from uam_control.offboard.firmware import PX4, firmware
from uam_control.settings.parameter_set import ParameterSet, integer, number, switch, text


@dataclass(frozen=True)
class OffboardParameters(ParameterSet):
    """What the autopilot speaks, times and numbers of attempts of the sequence."""

    firmware: str = text(
        PX4, "firmware of the autopilot, fixed once the node runs", "a name of FIRMWARES"
    )
    stream_time: float = number(
        1.0, "time of streaming setpoints before the first request for OFFBOARD", "s", 0.0, 30.0
    )
    retry_interval: float = number(0.5, "time between two requests", "s", 0.05, 10.0)
    attempts: int = integer(40, "requests without success before giving up", 1, 10000)
    return_after_lost_link: bool = switch(
        False,
        "request OFFBOARD again after the autopilot's failsafe for a lost stream of setpoints; "
        "never against a mode that a person chose",
    )
    reason_delay: float = number(
        5.0,
        "time for which a reason must last that the autopilot also gives in a normal start or "
        "landing (passing.yaml of the firmware)",
        "s",
        0.0,
        60.0,
    )
    recovery_attempts: int = integer(
        6, "requests of return_after_lost_link in a whole flight", 0, 10000
    )

    def check_together(self) -> None:
        """Raise ParameterError for an unknown firmware."""
        firmware(self.firmware)
