"""How long a flight may take, in whichever engine."""

from __future__ import annotations

from uam_control.mission import Scenario

SETTLED = 5.0  # [s] simulated, disarmed in a row, until a flight that nobody ends is over
DISARMED = "the autopilot has disarmed, and the mission did not end"
OVERTIME = 60.0  # [s] simulated, beyond the scenario's landing, until a flight is ended


def time_limit(scenario: Scenario) -> float:
    """Simulation time [s] at which a flight of this scenario ends in any case."""
    return scenario.landing.at + scenario.landing.duration + OVERTIME


class Settled:
    """Notices that a flight is over which the mission does not end: in failsafe, or lost itself."""

    def __init__(self) -> None:
        self._disarmed: float | None = None  # since when [s]; None: armed, or not armed yet
        self._flown = False

    def over(self, time: float, armed: bool) -> bool:
        """Whether the autopilot, once armed, has been disarmed for SETTLED at `time` [s]."""
        if armed:
            self._flown, self._disarmed = True, None
        elif self._flown and self._disarmed is None:
            self._disarmed = time
        return self._disarmed is not None and time - self._disarmed >= SETTLED
