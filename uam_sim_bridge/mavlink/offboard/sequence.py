"""State machine that arms the vehicle in OFFBOARD and disarms it, on simulation time.

It sends and receives no messages: `update` takes the autopilot's state and returns the request to
send. The bridge and the direct engine use the same class.

    WAITING    no heartbeat yet
    STREAMING  setpoints are sent (the autopilot requires a stream before OFFBOARD)
    OFFBOARD   the mode is requested
    ARMING     arming is requested
    FLYING     armed, in OFFBOARD; the mode is requested again when the autopilot leaves it
               (the phase stays without heartbeats: the stream must go on)
    DISARMING  disarming is requested
    DISARMED   done
    FAILED     too many attempts, disarmed or rebooted in flight; `reasons` says why. Only a new
               desired state (`set_desired`) starts again: the vehicle is never armed again in the
               air by itself
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from uam_control.settings.parameter_set import ParameterSet, number
from uam_sim_bridge.mavlink.offboard.advice import with_advice
from uam_sim_bridge.mavlink.protocol.modes import MavResult, Mode, Severity, result_word

HEARTBEAT_TIMEOUT = 3.0  # s without a heartbeat: not connected
_KEPT_REASONS = 5


class Phase(Enum):
    """Phase of the sequence; the value is the text for logs."""

    WAITING = "waiting for the autopilot"
    STREAMING = "streaming setpoints"
    OFFBOARD = "requesting OFFBOARD"
    ARMING = "arming"
    FLYING = "flying"
    DISARMING = "disarming"
    DISARMED = "disarmed"
    FAILED = "failed"


class Request(Enum):
    """A request to the autopilot; the value is the text for logs."""

    OFFBOARD = "OFFBOARD"
    ARM = "arming"
    DISARM = "disarming"


@dataclass(frozen=True)
class OffboardParameters(ParameterSet):
    """Times and numbers of attempts of the sequence."""

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

    `phase`; `armed_stamp` [s]: first time at which this flight was armed, None before; `reasons`:
    the autopilot's answers to refused requests, with advice, newest last; `let_go`: set by the
    owner when the autopilot must run its own failsafe; OFFBOARD is then requested no more.
    """

    def __init__(self, parameters: OffboardParameters | None = None) -> None:
        self.parameters = (parameters or OffboardParameters()).validated()
        self.phase = Phase.WAITING
        self.armed_stamp: float | None = None
        self.reasons: tuple[str, ...] = ()
        self.let_go = False
        self._desired = False  # armed
        self._stream_start = math.inf
        self._asked = -math.inf
        self._attempts = 0
        self._in_flight = False  # from FLYING until disarmed on request, or a new desired state

    @property
    def streaming(self) -> bool:
        """Whether setpoints must be sent: always after the first heartbeat."""
        return self.phase is not Phase.WAITING

    def set_desired(self, armed: bool) -> None:
        """Set the desired state: True fly, False disarm. A change clears earlier failures."""
        if armed == self._desired:
            return
        self._desired = armed
        self.reasons = ()
        self._attempts, self._asked = 0, -math.inf
        if self.phase in (Phase.FAILED, Phase.DISARMED):
            self.phase, self._in_flight = Phase.STREAMING, False

    def update(self, time: float, connected: bool, armed: bool, mode: Mode) -> Request | None:
        """Advance to `time` [s] and return the request to send now, None for none.

        connected: the last heartbeat is recent; armed, mode: as last reported by the autopilot.
        """
        if not connected:
            if self.phase not in (Phase.FLYING, Phase.FAILED):
                self.phase = Phase.WAITING
            return None
        if self.phase is Phase.WAITING:
            self.phase = Phase.STREAMING
            self._stream_start = time
        if not self._desired:
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
        """Handle a restart of the autopilot at `time` [s].

        On the ground the sequence starts again with a new stream. In flight it fails.
        """
        if self._in_flight:  # the phase is FAILED if a heartbeat reported "disarmed" before
            self._reason("the autopilot rebooted in flight")
            self.phase = Phase.FAILED
        elif self.phase in (Phase.STREAMING, Phase.OFFBOARD, Phase.ARMING):
            self._reason("the autopilot rebooted")
            self.phase, self._stream_start = Phase.STREAMING, time

    def answer(self, request: Request, result: int) -> None:
        """Handle the result of COMMAND_ACK for a request; a refusal becomes a reason."""
        if result == MavResult.ACCEPTED:
            return
        self._reason(f"{request.value} refused ({result_word(result)})")

    def text(self, severity: int, text: str) -> None:
        """Handle a STATUSTEXT; warnings and worse become reasons."""
        if severity <= Severity.WARNING:
            self._reason(text.strip())  # PX4 ends a text with a tab if an event has the same text

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
