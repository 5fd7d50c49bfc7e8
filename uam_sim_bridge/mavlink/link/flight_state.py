"""Mode and arming of the autopilot, from its reports and from the requests that it has accepted.

PX4 accepts a request before it publishes its new state. A report that it makes between the two
arrives after the answer and has the old state: without care, "armed, and not in OFFBOARD" would
mean that a pilot has control.
"""

import math

from uam_control.offboard.exchange import Reported, Request
from uam_control.offboard.modes import Mode

SETTLING = 0.1  # s after an accepted request in which a report may be older than the answer
ARMED = {Request.ARM: True, Request.DISARM: False, Request.KILL: False}


class FlightState:
    """`intended`: the mode that was chosen last by a person or a companion; `killed`: the kill
    switch is engaged; the others are newest reports.

    The part of an `AutopilotPort` that both ports have; all times are those of the ticks [s].
    A subclass has `heard` [s]: newest message, and `loss_time`.
    """

    steps = None
    heard: float
    loss_time: float

    def __init__(self) -> None:
        self.mode = self.intended = Mode.UNKNOWN
        self.armed = self.landed = self.failsafe = self.killed = False
        self.armed_since: float | None = None  # [s] tick of the first report that it is armed
        self._mode_settles = self._arming_settles = -math.inf
        self._doubted: Mode | None = None  # reported while the mode settles

    def silent(self, time: float) -> bool:
        """See `AutopilotPort`."""
        return self.loss_time < time - self.heard < math.inf

    def reported(self, connected: bool, delivered: float) -> Reported:
        """Return the state for the sequence; delivered [s]: see `Reported`."""
        modes = self.mode, self.intended
        return Reported(connected, self.armed, *modes, self.failsafe, delivered, self.killed)

    def settle(self, time: float) -> None:
        """Believe the mode that was reported while it settled, if no newer report denies it."""
        if self._doubted is not None and time >= self._mode_settles:
            self.mode, self._doubted = self._doubted, None

    def take_heartbeat(self, time: float, mode: Mode, armed: bool) -> None:
        """Take a HEARTBEAT; one that denies an answer just before counts with the next one."""
        self._take_mode(time, mode)
        if time >= self._arming_settles:
            self._take_arming(time, armed)

    def take_current_mode(self, time: float, mode: Mode, intended: Mode, landed: bool) -> None:
        """Take a CURRENT_MODE, which is sent on a change, so before the next heartbeat."""
        self.intended = intended
        # PX4 goes back to OFFBOARD when it disarms; only the heartbeat says that it has
        if mode is not Mode.OFFBOARD or not landed or mode is self.mode:
            self._take_mode(time, mode)

    def take_accepted(self, time: float, request: Request) -> None:
        """Take the state of an accepted request: the next heartbeat may be a second later."""
        if request is Request.OFFBOARD:
            self.mode, self._doubted = Mode.OFFBOARD, None
            self._mode_settles = time + SETTLING
        else:
            self._take_arming(time, ARMED[request])
            self._arming_settles = time + SETTLING

    def _take_mode(self, time: float, mode: Mode) -> None:
        if mode is not self.mode and time < self._mode_settles:
            self._doubted = mode
        else:
            self.mode, self._doubted = mode, None

    def _take_arming(self, time: float, armed: bool) -> None:
        if armed and not self.armed:
            self.armed_since = time
        elif not armed:
            self.armed_since = None
        self.armed = armed
