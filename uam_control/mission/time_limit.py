"""Time limits of a flight, for both engines."""

from __future__ import annotations

from uam_control.mission import MissionParameters, Scenario

SETTLED = 5.0  # s of simulation time disarmed, after which a flight without end is over
DISARMED = "the autopilot has disarmed, and the mission did not end"
OVERTIME = 60.0  # s of simulation time for start, holds by limits and touchdown


def time_limit(scenario: Scenario, parameters: MissionParameters | None) -> float:
    """Return the time [s] at which a flight of this scenario is ended, simulated or since arming.

    A hold by command lasts up to command_timeout and then lands; this limit comes later. Without
    parameters: of a flight to which nobody gives commands.
    """
    commanded = 0.0 if parameters is None else parameters.command_timeout
    return scenario.landing.at + scenario.landing.duration + OVERTIME + commanded


class Settled:
    """Detects the end of a flight that the mission does not end: in failsafe, or mission lost."""

    def __init__(self) -> None:
        self._disarmed: float | None = None  # since when [s]; None: armed, or not armed yet
        self._flown = False

    def over(self, time: float, armed: bool) -> bool:
        """Return whether the autopilot was armed and is now disarmed for SETTLED; time [s]."""
        if armed:
            self._flown, self._disarmed = True, None
        elif self._flown and self._disarmed is None:
            self._disarmed = time
        return self._disarmed is not None and time - self._disarmed >= SETTLED
