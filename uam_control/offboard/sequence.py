"""State machine that arms the vehicle in OFFBOARD, releases it to a pilot, and disarms it.

It sends and receives no messages: `update` takes the autopilot's report and returns the request to
send. The bridge and the direct engine use the same class. All times are simulation time.

A kill is final: by command, by the pilot's switch, or by the autopilot's flight termination. From
then on `stopped` is true: no setpoint with thrust is sent, and disarming is requested, also when
the switch goes off again.

After a gap of the stream in which the autopilot's failsafe has begun, the vehicle is RELEASED, and
nothing is sent until the autopilot's reports are new again: `begin`.

`return_after_lost_link` is the only exception to the rule of RELEASED: see `_may_return`.
"""

import math
from enum import Enum

from uam_control.maths.memory import Number, record
from uam_control.offboard.exchange import Reasons, Reported, Request, commands_of
from uam_control.offboard.firmware import firmware
from uam_control.offboard.modes import MavResult, Mode, Severity, result_word
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.settings.plain_members import plain_members

LINK_GAP = 0.45  # s without a setpoint that arrives: the stream counts as lost; below COM_OF_LOSS_T
LOST_RECENTLY = 5.0  # s after a lost stream in which the autopilot may leave OFFBOARD because of it
SETTLING = 0.3  # s after the switch to OFFBOARD in which an older report may still arrive
ARMING_UNDERWAY = 2.0  # s after a request to arm in which the autopilot may still obey it
NEW_REPORTS = 0.6  # s after a gap until each report is new: PX4 sends its mode twice a second
FORCED = 5.0  # s after a kill: disarmed by force, as PX4 does (COM_KILL_DISARM); it may lie tilted
KILLED = "kill engaged"  # PX4's text; the heartbeat, once a second, misses a short kill
BY_SWITCH = "the pilot's kill switch has stopped the motors"
BY_TERMINATION = "flight termination has stopped the motors"
REGAIN_REQUESTS = 5  # requests for OFFBOARD after one command of an operator


@plain_members
class Phase(Enum):
    """Phase of the sequence; the value is the text for logs.

    RELEASED: the autopilot left OFFBOARD, and not on our request; it is not requested then. FAILED:
    too many attempts, taken over before arming, disarmed or rebooted in flight, killed. The vehicle
    is never armed again in the air by itself. Who takes control then has it: RELEASED.
    """

    WAITING = "waiting for the autopilot"  # no heartbeat yet
    STREAMING = "streaming setpoints"  # the autopilot requires a stream before OFFBOARD
    OFFBOARD = "requesting OFFBOARD"
    ARMING = "arming"  # it is requested
    FLYING = "flying"  # armed, in OFFBOARD; also without heartbeats: the stream must go on
    RELEASED = "released"  # somebody else has control: `regain`, or the pilot, brings it back
    DISARMING = "disarming"  # it is requested
    DISARMED = "disarmed"
    FAILED = "failed"  # see `failure`; only a new desired state starts again


_BEGIN_AND_END = (
    *(Phase.WAITING, Phase.STREAMING, Phase.OFFBOARD, Phase.ARMING),
    *(Phase.DISARMING, Phase.DISARMED),
)
# after a gap of the link the vehicle is still the one that this sequence armed, or gave up
_KEPT_WITHOUT_LINK = (Phase.FLYING, Phase.RELEASED, Phase.FAILED, Phase.DISARMING)


class OffboardSequence:
    """The state machine.

    `released_to`: who has control in RELEASED, else ""; `failure`: why the sequence has given up,
    else "". `let_go`: set by the owner when the autopilot must run its own failsafe; OFFBOARD is
    then requested no more. `stopped`: the motors must stay still until the next flight.
    """

    _streamed, _time = Number(), Number()

    def __init__(self, parameters: OffboardParameters | None = None) -> None:
        self.parameters = (parameters or OffboardParameters()).validated()
        self.firmware = firmware(self.parameters.firmware)
        self.commands = commands_of(self.firmware)  # request → command and first parameters
        self.phase = Phase.WAITING
        self._reasons = Reasons(self.firmware)
        self.released_to = self.failure = ""
        self.let_go = self.stopped = False
        self._desired = False  # armed
        self._stream_start = math.inf
        self._asked = -math.inf
        self._attempts = 0
        self._in_flight = False  # from FLYING until disarmed on request, or a new desired state
        self._offboard_since: float | None = None  # [s] the autopilot is in OFFBOARD since then
        # [s]: newest setpoint, last update
        self.memory = record("", "streamed time")
        self._streamed = -math.inf
        self._stream_lost = -math.inf  # [s] newest time at which no setpoint reached the autopilot
        self._arm_asked = -math.inf  # [s] newest request to arm
        self._regain_requests = 0  # left of an operator's command
        self._chosen = (Mode.UNKNOWN, Mode.UNKNOWN)  # mode and intended one, while released
        self._chosen_at = -math.inf  # [s] since when
        self._returns = 0  # requests of return_after_lost_link in this flight
        self._lost_link = False  # the autopilot left OFFBOARD because it had no setpoints
        self._person = False  # a person has chosen the mode of the released vehicle
        self._begun = -math.inf  # [s] the last tick that began
        self._resumed = -math.inf  # [s] newest end of a gap of the stream
        self._late = 0.0  # [s] for which the tick that began last has waited
        self._stop: Request | None = None  # repeated until the vehicle is disarmed
        self._halted = math.inf  # [s] since when

    @property
    def reasons(self) -> tuple[str, ...]:
        """The autopilot's answers to refused requests, with advice, newest last."""
        return self._reasons.told

    @property
    def settled(self) -> bool:
        """Whether nothing is to be decided until the autopilot reports a change, or is silent."""
        flies = self.phase is Phase.FLYING and self._desired and not self.stopped
        return flies and self._offboard_since is not None

    @property
    def streaming(self) -> bool:
        """Whether setpoints must be sent: always after the first heartbeat."""
        return self.phase is not Phase.WAITING

    @property
    def released(self) -> bool:
        """Whether somebody else has control of the vehicle."""
        return self.phase is Phase.RELEASED

    @property
    def in_control(self) -> str:
        """Who has control of the vehicle, for displays."""
        if self.released:
            return self.released_to
        return "the companion" if self.phase is Phase.FLYING else "nobody"

    def set_desired(self, armed: bool) -> None:
        """Set the desired state: True fly, False disarm. A change clears earlier failures."""
        if armed == self._desired:
            return
        self._desired = armed
        self._reasons.forget()
        self._attempts, self._asked = 0, -math.inf
        self._returns, self._regain_requests = 0, 0
        if armed:
            self._stop, self.stopped = None, False
        if self.phase in (Phase.FAILED, Phase.DISARMED):
            self._in_flight = ours = self._in_flight and not armed
            self.phase = Phase.DISARMING if ours else Phase.STREAMING
            self.released_to, self._offboard_since = "", None
            self.failure = self.failure if self.stopped else ""

    def regain(self, commanded: float) -> None:
        """Request OFFBOARD again by an operator's command of `commanded` [s].

        No effect if not released, or if a person has chosen a mode since.
        """
        if self.released and commanded > self._chosen_at:
            self._regain_requests, self._asked = REGAIN_REQUESTS, -math.inf

    def kill(self) -> None:
        """Request that the motors stop at once, in the air too, until the vehicle is disarmed.

        The first request is sent even if the vehicle is reported disarmed: it may be arming.
        """
        self._halt(Request.KILL, "killed by command")

    def _halt(self, stop: Request, why: str) -> None:
        """End the flight for good."""
        self._stop, self._asked, self.stopped = stop, -math.inf, True
        self._halted = self._time
        self.released_to = ""
        self._fail(why)

    def begin(self, time: float, loss_time: float, late: float = 0.0) -> None:
        """Begin the tick `time` [s], before its setpoint is made.

        loss_time [s]: without setpoints until the autopilot's failsafe begins; late [s]: for how
        long the tick has waited while a process stood still, see `Waited`: the autopilot's reports
        are newer than the tick by so much.
        """
        now, self._late = time + late, late
        # a little longer: a failsafe that has just begun, or not quite, is seen by its report
        lost = now - self._streamed > loss_time + SETTLING
        if self.phase is Phase.FLYING and not self.let_go and lost:
            self._stream_lost = self._resumed = now
            self._release(time, Reported(True, True, Mode.UNKNOWN, Mode.OFFBOARD))
        elif self.withheld and now - self._begun > loss_time:
            self._resumed = now
        self._begun = time

    @property
    def withheld(self) -> bool:
        """Whether the tick is late, or a gap of the stream has just ended and reports may be older.

        The autopilot returns to OFFBOARD with the first setpoint: the vehicle may stand by now.
        """
        old = self._begun < self._resumed + NEW_REPORTS
        return self._late > 0.0 or (self.phase is Phase.RELEASED and old)

    @property
    def after_loss(self) -> bool:
        """Whether the autopilot's failsafe has the vehicle because the stream was lost."""
        return self.phase is Phase.RELEASED and self._lost_link

    def streamed(self, time: float) -> None:
        """Note that a setpoint was sent at `time` [s]."""
        self._streamed = time

    def update(self, time: float, seen: Reported) -> Request | None:
        """Advance to `time` [s] and return the request to send now, None for none."""
        self._time = time
        gap = time + self._late - min(self._streamed, seen.delivered)
        if (
            self.phase is Phase.FLYING
            and self._desired
            and self._offboard_since is not None
            and seen.connected
            and seen.armed
            and seen.mode is Mode.OFFBOARD
            and not seen.killed
            and gap <= LINK_GAP
        ):
            return None  # most ticks: nothing has changed
        if self._in_flight and gap > LINK_GAP:
            self._stream_lost = time
        terminated = seen.mode is Mode.TERMINATION
        if (seen.killed or terminated) and not self.stopped and self._has_motors:
            self._halt(Request.DISARM, BY_TERMINATION if terminated else BY_SWITCH)
        theirs = self._stop is Request.DISARM and not (terminated or seen.mode is Mode.OFFBOARD)
        if self._stop is not None and not theirs:
            if seen.armed or self._asked == -math.inf:
                forced = time - self._halted >= FORCED
                return self._ask(time, Phase.FAILED, Request.KILL if forced else self._stop)
            if time - self._asked >= self.parameters.retry_interval:
                self._stop = None
        if not seen.connected:
            if self.phase not in _KEPT_WITHOUT_LINK:
                self.phase = Phase.WAITING
            return None
        if self.phase is Phase.WAITING:
            self.phase = Phase.STREAMING
            self._stream_start = time
        left = self._left_offboard(time, seen)
        away = seen.mode is not Mode.OFFBOARD and self._offboard_since is None
        if not self._desired:
            return self._stay_disarmed(time, seen, away)
        if self.phase is Phase.FLYING:
            return self._keep_flying(time, seen, away)
        if self.phase is Phase.RELEASED:
            return self._stay_released(time, seen)
        failed = self.phase is Phase.FAILED
        if seen.armed and (away if failed else seen.mode is not Mode.OFFBOARD):
            self._release(time, seen)  # somebody else flies
            return None
        if failed:
            return None
        if left:
            self._fail(f"{seen.mode.name} was chosen before arming: start again")
            return None
        if time - self._stream_start < self.parameters.stream_time:
            self.phase = Phase.STREAMING
            return None
        if seen.mode is not Mode.OFFBOARD:
            return self._ask(time, Phase.OFFBOARD, Request.OFFBOARD)
        if not seen.armed:
            request = self._ask(time, Phase.ARMING, Request.ARM)
            self._arm_asked = self._arm_asked if request is None else time
            return request
        self._fly()
        return None

    def rebooted(self, time: float) -> None:
        """Handle a restart of the autopilot at `time` [s].

        On the ground the sequence starts again with a new stream. In flight it fails.
        """
        self._offboard_since = None
        if self._in_flight:  # the phase is FAILED if a heartbeat reported "disarmed" before
            self._fail("the autopilot rebooted in flight")
        elif self.phase in (Phase.STREAMING, Phase.OFFBOARD, Phase.ARMING):
            self._reasons.add("the autopilot rebooted")
            self.phase, self._stream_start = Phase.STREAMING, time

    def answer(self, request: Request, result: int) -> None:
        """Handle the result of COMMAND_ACK for a request; a refusal becomes a reason."""
        if result == MavResult.ACCEPTED:
            return
        self._lasting_reason(f"{request.value} refused ({result_word(result)})")

    def text(self, severity: int, text: str) -> None:
        """Handle a STATUSTEXT; warnings and worse become reasons, "Kill engaged" ends a flight."""
        if text.strip().lower() == KILLED and self._has_motors and not self.stopped:
            self._halt(Request.DISARM, BY_SWITCH)
        if severity <= Severity.WARNING:
            # PX4 ends a text with a tab if an event has the same text
            self._lasting_reason(text.strip())

    def _lasting_reason(self, text: str) -> None:
        """Add a reason, at begin and end of a flight only if it lasts for `reason_delay`."""
        if self.phase not in _BEGIN_AND_END:
            self._reasons.add(text)
            return
        streaming = self.phase not in (Phase.WAITING, Phase.STREAMING)
        self._reasons.add_lasting(text, self._time, streaming, self.parameters.reason_delay)

    def _fail(self, text: str) -> None:
        """End in FAILED with the reasons so far, also those that might have passed, and `text`."""
        self._reasons.add_all()
        self._reasons.add(text)
        self.failure = "; ".join(self.reasons) if self.phase in _BEGIN_AND_END else text
        self.phase = Phase.FAILED

    @property
    def _has_motors(self) -> bool:
        """Whether motors turn, or may turn at once, that this sequence has asked for."""
        return self._in_flight or self.phase is Phase.ARMING

    def _left_offboard(self, time: float, seen: Reported) -> bool:
        """Return whether the autopilot has left OFFBOARD by now, which it had entered before.

        In flight a person's choice counts at once: no report of before the start can arrive there.
        """
        since = self._offboard_since
        if seen.mode is Mode.OFFBOARD:
            if since is None:
                self._offboard_since = time
            return False
        chosen = self._in_flight and seen.mode is seen.intended
        left = since is not None and (chosen or time - since >= SETTLING)
        if left:
            self._offboard_since = None
        return left

    def _stay_disarmed(self, time: float, seen: Reported, away: bool) -> Request | None:
        """Disarm a vehicle that this sequence has armed; one that somebody else armed stays.

        So does one that a person took over after the landing: it may take off again.
        """
        ours = self.phase in (Phase.OFFBOARD, Phase.ARMING, Phase.FLYING, Phase.DISARMING)
        given_back = self.phase is Phase.RELEASED and seen.mode is Mode.OFFBOARD
        armed = seen.armed
        of_flight = self.phase in (Phase.FLYING, Phase.DISARMING)
        if armed and away and of_flight and self._taken_over(seen):
            self._release(time, seen)
        elif armed and (ours or given_back):
            return self._ask(time, Phase.DISARMING, Request.DISARM)
        if not armed and self.phase in (
            Phase.DISARMING,
            Phase.FLYING,
            Phase.RELEASED,
            Phase.FAILED,
        ):
            self.phase, self._in_flight = Phase.DISARMED, False
            self._reasons.forget()
            self.released_to, self._offboard_since = "", None
        elif self.phase is Phase.ARMING and time - self._arm_asked < ARMING_UNDERWAY:
            pass  # a vehicle that is armed now is ours
        elif not armed and self.phase is not Phase.DISARMED:
            self.phase = Phase.STREAMING
        return None

    def _fly(self) -> None:
        self.phase, self._attempts, self.failure = Phase.FLYING, 0, ""
        self._reasons.forget()
        self.released_to, self._in_flight, self._regain_requests = "", True, 0

    def _keep_flying(self, time: float, seen: Reported, away: bool) -> None:
        if not seen.armed:
            self._fail("the autopilot disarmed by itself")
        elif away and self._taken_over(seen):
            self._release(time, seen)

    def _taken_over(self, seen: Reported) -> bool:
        """Whether somebody has taken control, by leaving OFFBOARD.

        After `let_go` the autopilot's failsafe does so, as it must; a person still may.
        """
        return not self.let_go or seen.intended not in (Mode.OFFBOARD, Mode.UNKNOWN)

    def _release(self, time: float, seen: Reported) -> None:
        self.phase, self._regain_requests, self._asked = Phase.RELEASED, 0, time
        self._in_flight, self._offboard_since = True, None
        self._chosen, self._chosen_at = (seen.mode, seen.intended), time
        self._lost_link = time - self._stream_lost < LOST_RECENTLY
        self.failure = self.failure if self.stopped else ""
        self._person = False
        self.released_to = self._holder(seen)
        self._reasons.add(f"left OFFBOARD: {self.released_to}, has control")

    def _holder(self, seen: Reported) -> str:
        """Return who has control, and in which mode, in one line.

        PX4 goes back to OFFBOARD as the chosen mode just before it reports that it has disarmed: a
        person's landing stays one.
        """
        self._person |= seen.intended not in (Mode.OFFBOARD, Mode.UNKNOWN)
        failsafe = seen.intended is Mode.OFFBOARD or seen.failsafe
        where = "" if seen.mode is Mode.UNKNOWN else f", in {seen.mode.name}"
        if failsafe and not self._person:
            cause = " after a lost stream of setpoints" if self._lost_link else ""
            return f"the autopilot's failsafe{cause}{where}"
        return f"the pilot or a ground station{where}"

    def _stay_released(self, time: float, seen: Reported) -> Request | None:
        if not seen.armed:
            self._fail(f"disarmed while released to {self.released_to}")
            return None
        if seen.mode is Mode.OFFBOARD:
            if not self.withheld:
                self._fly()
            return None
        chosen = seen.mode, seen.intended
        if chosen != self._chosen and seen.intended is not Mode.OFFBOARD:
            # a person has chosen another mode since the command
            self._regain_requests, self._chosen_at = 0, time
        self._chosen = chosen
        self.released_to = self._holder(seen)
        self._lost_link &= not self._person
        if self._regain_requests > 0:
            request = self._ask(time, Phase.RELEASED, Request.OFFBOARD)
            self._regain_requests -= request is not None
            return request
        if self._may_return(time, seen):
            request = self._ask(time, Phase.RELEASED, Request.OFFBOARD)
            self._returns += request is not None
            return request
        return None

    def _may_return(self, time: float, seen: Reported) -> bool:
        """Whether return_after_lost_link may request OFFBOARD.

        The autopilot must report its failsafe, and OFFBOARD as the mode that was chosen last; the
        stream of setpoints must have been lost before, and must reach the autopilot again. The
        number of requests is that of the whole flight: a short success does not refill it.
        """
        p = self.parameters
        return (
            p.return_after_lost_link
            and self._lost_link
            and self._stream_lost < time
            and seen.failsafe
            and seen.intended is Mode.OFFBOARD
            and self._returns < p.recovery_attempts
        )

    def _ask(self, time: float, phase: Phase, request: Request) -> Request | None:
        if phase is not self.phase:
            self.phase, self._attempts, self._asked = phase, 0, -math.inf
        if time - self._asked < self.parameters.retry_interval:
            return None
        counted = phase not in (Phase.RELEASED, Phase.FAILED)  # those have budgets of their own
        if counted and self._attempts >= self.parameters.attempts:
            self._fail(f"no success after {self._attempts} requests for {request.value}")
            return None
        self._asked = time
        self._attempts += counted
        return request
