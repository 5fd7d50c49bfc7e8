"""Progress of a flight for those who watch it: status, messages."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class FlightStatus:
    """State of a flight at one moment."""

    phase: str
    time: float  # [s] mission time, negative before take-off
    position_error: float  # [m] norm of the tracking error
    attitude_error: float  # [rad] norm, from the attitude that the position law desires
    arm_error: float  # [rad] norm of the tracking error
    tilt: float  # [rad] angle between the body's and the world's vertical axis
    real_time_factor: float
    autopilot: str = ""
    state: str = ""  # of the supervisor, see `uam_control.supervision.State`
    cause: str = ""  # reason for the state
    released_to: str = ""  # who has control instead of the companion, "" if nobody has
    done: bool = False  # whether the mission has ended


STARTING = "its node starts"  # text of a device whose node has not reported yet


@dataclass(frozen=True)
class DeviceState:
    """One device of a vehicle. text: what it is, or what is missing; advice: how to check it."""

    name: str
    present: bool
    text: str
    advice: str


class Observer:
    """Receives the progress of a flight; this class ignores it. Called in the flight's thread."""

    def message(self, text: str) -> None:
        """Receive one line about the flight."""

    def started(self, domain: int | None) -> None:
        """Receive that the flight has started; domain: of ROS, None with the direct engine."""

    def bring_up(self, devices: Sequence[DeviceState]) -> None:
        """Receive the state of a vehicle's devices."""

    def update(self, status: FlightStatus) -> None:
        """Receive a new status."""

    def finish(self) -> None:
        """Receive that no further status will come."""
