"""From "fly" to an armed vehicle in OFFBOARD, and back: a state machine on simulation time.

It neither sends nor receives: `update` takes what is known of the autopilot and returns what to
ask it for. The bridge and the direct engine use the same object.

    WAITING    no heartbeat yet
    STREAMING  setpoints go out (the autopilot demands a stream before the switch)
    OFFBOARD   asking for the mode
    ARMING     asking to arm
    FLYING     armed, in OFFBOARD; asks again when the autopilot leaves the mode
               (also without heartbeats: the stream must go on)
    DISARMING  asking to disarm
    DISARMED   done
    FAILED     an attempt too many, disarmed or rebooted in flight; `reasons` says why, and only a
               new wish (`want`) starts again: nothing is armed in the air by itself
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from uam_control.settings.parameter_set import ParameterSet, number
from uam_sim_bridge.mavlink.offboard.advice import with_advice
from uam_sim_bridge.mavlink.protocol.modes import MavResult, Mode, Severity, result_word

HEARTBEAT_TIMEOUT = 3.0  # s without one: not connected
_KEPT_REASONS = 5


class Phase(Enum):
    """Where the sequence stands; the value is for people."""

    WAITING = "waiting for the autopilot"
    STREAMING = "streaming setpoints"
    OFFBOARD = "asking for OFFBOARD"
    ARMING = "arming"
    FLYING = "flying"
    DISARMING = "disarming"
    DISARMED = "disarmed"
    FAILED = "failed"


class Request(Enum):
    """What to ask the autopilot for; the value is for people."""

    OFFBOARD = "OFFBOARD"
    ARM = "arming"
    DISARM = "disarming"


@dataclass(frozen=True)
class OffboardParameters(ParameterSet):
    """Times and patience of the sequence."""

    stream_time: float = number(
        1.0, "time of streaming setpoints before the first request for OFFBOARD", "s", 0.0, 30.0
    )
    retry_interval: float = number(0.5, "time between two requests", "s", 0.05, 10.0)
    attempts: float = number(40.0, "requests without success before giving up", "1", 1.0, 10000.0)
    recovery_attempts: float = number(
        6.0, "requests for OFFBOARD after it was lost in flight", "1", 0.0, 10000.0
    )


class OffboardSequence:
    """The state machine.

    `phase`; `armed_stamp` [s] or None: when armed was first seen in this flight; `reasons`: what
    the autopilot answered to refused requests, with advice, newest last; `let_go`: set by the owner
    when the autopilot is to run its own failsafe; the sequence then requests OFFBOARD no more.
    """

    def __init__(self, parameters: OffboardParameters | None = None) -> None:
        self.parameters = (parameters or OffboardParameters()).validated()
        self.phase = Phase.WAITING
        self.armed_stamp: float | None = None
        self.reasons: tuple[str, ...] = ()
        self.let_go = False
        self._wanted = False
        self._stream_start = math.inf
        self._asked = -math.inf
        self._attempts = 0
        self._in_flight = False  # from FLYING until disarmed as wished, or a new wish

    @property
    def streaming(self) -> bool:
        """Whether setpoints are to be sent: always, once an autopilot is there."""
        return self.phase is not Phase.WAITING

    def want(self, armed: bool) -> None:
        """Take the pilot's wish: True fly, False disarm. A new wish forgets earlier failures."""
        if armed == self._wanted:
            return
        self._wanted = armed
        self.reasons = ()
        self._attempts, self._asked = 0, -math.inf
        if self.phase in (Phase.FAILED, Phase.DISARMED):
            self.phase, self._in_flight = Phase.STREAMING, False

    def update(self, time: float, connected: bool, armed: bool, mode: Mode) -> Request | None:
        """Advance to `time` [s] and return what to ask for now, if anything.

        connected: a heartbeat came recently; armed, mode: the autopilot's latest word.
        """
        if not connected:
            if self.phase not in (Phase.FLYING, Phase.FAILED):
                self.phase = Phase.WAITING
            return None
        if self.phase is Phase.WAITING:
            self.phase = Phase.STREAMING
            self._stream_start = time
        if not self._wanted:
            return self._stay_disarmed(time, armed)
        if self.phase is Phase.FLYING:
            return self._keep_flying(time, armed, mode)
        if self.phase is Phase.FAILED:
            return None
        if time - self._stream_start < self.parameters.stream_time:
            self.phase = Phase.STREAMING
            return None
        if mode is not Mode.OFFBOARD:
            return self._ask(time, Phase.OFFBOARD, Request.OFFBOARD)
        if not armed:
            return self._ask(time, Phase.ARMING, Request.ARM)
        self.phase, self._attempts, self.reasons = Phase.FLYING, 0, ()
        self.armed_stamp, self._in_flight = time, True
        return None

    def rebooted(self, time: float) -> None:
        """Note at `time` [s] that the autopilot has restarted.

        On the ground the sequence starts again with a new stream. In flight it fails.
        """
        if self._in_flight:  # FAILED, where a heartbeat said "disarmed" first
            self._reason("the autopilot rebooted in flight")
            self.phase = Phase.FAILED
        elif self.phase in (Phase.STREAMING, Phase.OFFBOARD, Phase.ARMING):
            self._reason("the autopilot rebooted")
            self.phase, self._stream_start = Phase.STREAMING, time

    def answer(self, request: Request, result: int) -> None:
        """Take a COMMAND_ACK's result for a request; a refusal becomes a reason."""
        if result == MavResult.ACCEPTED:
            return
        self._reason(f"{request.value} refused ({result_word(result)})")

    def text(self, severity: int, text: str) -> None:
        """Take a STATUSTEXT; warnings and worse become reasons."""
        if severity <= Severity.WARNING:
            self._reason(text.strip())  # PX4 ends a text with a tab where an event says the same

    def _reason(self, text: str) -> None:
        text = with_advice(text)
        others = tuple(reason for reason in self.reasons if reason != text)
        self.reasons = (*others, text)[-_KEPT_REASONS:]

    def _stay_disarmed(self, time: float, armed: bool) -> Request | None:
        if armed and self.phase is not Phase.FAILED:
            return self._ask(time, Phase.DISARMING, Request.DISARM)
        if not armed and self.phase in (Phase.DISARMING, Phase.FLYING, Phase.FAILED):
            self.phase, self.reasons, self._in_flight = Phase.DISARMED, (), False
        elif not armed and self.phase is not Phase.DISARMED:
            self.phase = Phase.STREAMING
        return None

    def _keep_flying(self, time: float, armed: bool, mode: Mode) -> Request | None:
        if not armed:
            self._reason("the autopilot disarmed in flight")
            self.phase = Phase.FAILED
            return None
        if mode is Mode.OFFBOARD or self.let_go:
            self._attempts = 0
            return None
        self._reason(f"the autopilot left OFFBOARD for {mode.name}")
        if self._attempts >= self.parameters.recovery_attempts:
            self.phase = Phase.FAILED
            return None
        return self._ask(time, Phase.FLYING, Request.OFFBOARD)

    def _ask(self, time: float, phase: Phase, request: Request) -> Request | None:
        if phase is not self.phase and phase is not Phase.FLYING:
            self.phase, self._attempts, self._asked = phase, 0, -math.inf
        if time - self._asked < self.parameters.retry_interval:
            return None
        if self._attempts >= self.parameters.attempts:
            self._reason(f"no success after {self._attempts} requests for {request.value}")
            self.phase = Phase.FAILED
            return None
        self._asked = time
        self._attempts += 1
        return request
