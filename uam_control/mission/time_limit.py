"""Time limits of a flight, for both engines."""

import math

from uam_control.mission import MissionParameters, Scenario

STILL_ARMED = 15.0  # s of simulation time for the autopilot's landing after the mission's end
SETTLED = 5.0  # s of simulation time disarmed, after which a flight without end is over
DISARMED = "the autopilot has disarmed, and the mission did not end"
OVERTIME = 60.0  # s of simulation time for start, holds by limits and touchdown


def time_limit(scenario: Scenario, parameters: MissionParameters | None) -> float:
    """Return the time [s] at which a flight of this scenario is ended, simulated or since arming.

    A hold by command lasts up to command_timeout and then lands; this limit comes later. Without
    parameters: of a flight to which nobody gives commands.
    """
    commanded = 0.0 if parameters is None else parameters.command_timeout
    return scenario.landing.end + OVERTIME + commanded


class Settled:
    """Detects the end of a flight by the autopilot: disarmed, with or without a mission's end."""

    def __init__(self) -> None:
        self._disarmed: float | None = None  # since when [s]; None: armed, or not armed yet
        self._flown = False
        self._done: float | None = None  # since when [s] the mission is

    def after_mission(self, time: float, armed: bool) -> bool:
        """Return whether a flight whose mission is done is over: disarmed, or not in time.

        The mission may end earlier than the flight: it knows nothing of a vehicle without a link.
        """
        self._done = time if self._done is None else self._done
        return not armed or time - self._done >= STILL_ARMED

    def over(self, time: float, armed: bool) -> bool:
        """Return whether the autopilot was armed and is now disarmed for SETTLED; time [s]."""
        if armed:
            self._flown, self._disarmed = True, None
        elif self._flown and self._disarmed is None:
            self._disarmed = time
        return self._disarmed is not None and time - self._disarmed >= SETTLED


class FlightEnd(Settled):
    """Tells why a flight of a node is over, `linger` [s] after its mission."""

    def __init__(self, linger: float) -> None:
        super().__init__()
        self._linger, self._end = linger, math.inf

    def reason(
        self, time: float, armed: bool, done: bool, limit: tuple[float, str] = (math.inf, "")
    ) -> str:
        """Return why it is over at `time` [s], "" while it is not; done: the mission is.

        limit: latest end [s], and what to call it.
        """
        if done and self.after_mission(time, armed) and math.isinf(self._end):
            self._end = time + self._linger
        disarmed = self.over(time, armed)
        latest, text = limit
        if self._end < math.inf:
            return "mission" if time >= min(self._end, latest) else ""
        if disarmed:
            return DISARMED
        return text if time >= latest else ""
