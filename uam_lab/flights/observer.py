"""Progress of a flight for those who watch it: status, messages."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class FlightStatus:
    """State of a flight at one moment.

    time: mission time [s], negative before take-off. Errors: norms of the tracking error [m],
    [rad], [rad]; attitude: from the attitude that the position law desires. tilt: angle between
    the body's and the world's vertical axis [rad]. state, cause: of the supervisor, see
    `uam_control.supervision.State`. released_to: who has control instead of the companion, ""
    if nobody has. done: whether the mission has ended.
    """

    phase: str
    time: float
    position_error: float
    attitude_error: float
    arm_error: float
    tilt: float
    real_time_factor: float
    autopilot: str = ""
    state: str = ""
    cause: str = ""
    released_to: str = ""
    done: bool = False


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
