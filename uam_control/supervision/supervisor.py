"""The supervisor: from observation and operator command to state and decision.

It never arms by itself: `Decision.arm` becomes true by `start`, and false once after that. It
disarms on the ground, by a command in failsafe, after the autopilot has disarmed, or after a kill.
Without usable poses it flies blind, on the IMU, for a short time; the last resort is failsafe, in
which the autopilot descends without the companion. It holds again when the poses agree again, if
the autopilot still follows it. When somebody else takes control it releases the vehicle at once. It
lands without a bridge that flies on.
"""

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from uam_control.coordinates import ATTITUDE, CHI, Z
from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.memory import Number, record
from uam_control.maths.rotations import tilt
from uam_control.supervision.checks import (
    CONTRADICTION,
    CONTROLLERS,
    DELAYS,
    POSES_OFF,
    Checks,
    ExceededLimit,
)
from uam_control.supervision.monitor import Level
from uam_control.supervision.observation import Authority, Observation, OperatorCommand
from uam_control.supervision.states import (
    AIRBORNE_STATES,
    ORDINARY,
    TARGETS,
    Decision,
    Event,
    Guide,
    State,
    StateTransition,
)
from uam_control.supervision.supervision_parameters import SupervisionParameters

TOO_HEAVY = "no lift-off: too little thrust for the weight"
LEVEL = 0.15  # [rad] tilt up to which a vehicle stands: beyond it turns over without its motors
BY_COMMAND = (Event.HOLD, Event.ARRIVED)  # what starts a hold by command
NOT_FOLLOWED = "no lift-off: the autopilot is silent, or lands by itself"


class Supervisor:
    """The state machine of `states.TRANSITIONS`; its only time is the stamps of the inputs."""

    _stamp = Number()

    def __init__(self, parameters: SupervisionParameters) -> None:
        # left_behind: stamp [s] from which the reference climbs without the vehicle
        self.memory = record("", "stamp left_behind airborne_height liftoff_timeout")
        self.state = State.GROUNDED  # as cause, decision and checks: after the last step
        self.cause = "waiting for the start"
        self.changes: list[StateTransition] = []  # all so far
        self._arm = False
        self._regains = 0  # commands to regain a released vehicle
        self._regained = -math.inf  # stamp [s] of the newest one that still counts
        self.memory["left_behind"] = math.inf
        self._was_armed = False  # the autopilot, at the last step before the take-off
        self._lands = False  # whether the autopilot lands a released vehicle
        self._goes_on = False  # whether the scenario goes on after the vehicle is regained
        self._planned = False  # whether a landing is the scenario's
        self._failed = ""  # quantity whose failure made it blind, until it agrees again
        self._blind_since = math.inf  # stamp [s]
        self._interrupted = State.FLYING  # what it did before it became blind
        self._stamp = -math.inf
        self._holds = Holds()
        self.checks = Checks(parameters)
        self._stays_behind = prepared(stays_behind, self.memory, 0.0, 0.0)
        self._use(parameters)

    def configure(self, parameters: SupervisionParameters) -> None:
        """Use `parameters` (validated) from the next tick on."""
        self.checks.configure(parameters)
        self._use(parameters)

    def _use(self, parameters: SupervisionParameters) -> None:
        self._parameters = parameters
        self.memory["airborne_height"] = parameters.airborne_height
        self.memory["liftoff_timeout"] = parameters.liftoff_timeout
        self.decision = self._decide()

    def step(
        self, stamp: float, seen: Observation, command: OperatorCommand | None = None
    ) -> Decision:
        """Return the decision at `stamp` [s]; at most one transition per call.

        A stamp that is not finite or not increasing is replaced by the last one.
        """
        if stamp > self._stamp and math.isfinite(stamp):
            self._stamp = stamp
        finding = self.checks.update(self._stamp, seen, self.state in AIRBORNE_STATES)
        if finding is None and command is None and self._as_usual(seen):
            return self.decision
        self._held_by(seen.authority)
        for event, cause in self._events(seen, command):
            if (self.state, event) in TARGETS:
                self._go(event, cause)
                break
        self._was_armed = seen.armed
        return self.decision

    def _as_usual(self, seen: Observation) -> bool:
        """Return whether a tick without finding and command needs no event: flying, no landing."""
        flying = self.state is State.FLYING and seen.armed and not seen.authority.failed
        due = seen.landing_due or seen.arrived or seen.end_mission
        return flying and not due and not seen.authority.released_to

    @property
    def calm(self) -> bool:
        """Whether no value is beyond a limit, not even for a short time, and no hold lasts."""
        return self.checks.quiet and self.checks.finding is None and not self._holds.lasts

    def start(self) -> None:
        """Desire an armed autopilot from the next step on; no effect after the first call."""
        if not self._arm and self.state is State.GROUNDED:
            self._arm, self.cause = True, "waiting to take off"
            self.decision = self._decide()

    def lose_states(self, cause: str) -> Decision:
        """Give up in flight at the last stamp, because states have stopped; see `Event.HARD_LIMIT`.

        No effect on the ground or in failsafe.
        """
        if self.state in AIRBORNE_STATES and (self.state, Event.HARD_LIMIT) in TARGETS:
            self._go(Event.HARD_LIMIT, cause)
        return self.decision

    def give_up(self, stamp: float, reason: str) -> Decision:
        """End a flight before take-off at `stamp` [s]; no effect after take-off."""
        if stamp > self._stamp:
            self._stamp = stamp
        if (self.state, Event.GIVEN_UP) in TARGETS:
            self._go(Event.GIVEN_UP, reason)
        return self.decision

    def refusal(self, command: OperatorCommand, seen: Observation) -> str:
        """Return why `command` is refused now, "" if it is accepted."""
        event, holder = self._event(command, seen), seen.authority.released_to
        if self.state is State.FAILSAFE and holder:
            return f"{holder} has control"
        if self.state is State.RELEASED and command is OperatorCommand.RESUME:
            event = Event.REGAINED  # the autopilot is asked first
            if _stands(seen):
                return "on the ground: disarm, then start a new flight"
        on_path = self.state is State.FLYING and not seen.off_path
        if (self.state, event) not in TARGETS or (event is Event.RESUME and on_path):
            if self.state is State.RELEASED:
                return f"{holder} has control"
            if command is OperatorCommand.DISARM and self.state in AIRBORNE_STATES:
                return f"{self.state.value} and not on the ground: land first"
            return f"not while {self.state.value}"
        finding = self.checks.finding
        if command in (OperatorCommand.RESUME, OperatorCommand.GOAL) and finding is not None:
            return finding.cause
        return ""

    def _decide(self) -> Decision:
        """Return the decision for the state, by the policy of docs/supervision.md."""
        p, state = self._parameters, self.state
        guide, keep, stow = Guide.NOTHING, True, False
        lands_on = state is State.BLIND and self._interrupted is State.LANDING
        landing = state is State.LANDING or lands_on
        if state in (State.TAKING_OFF, State.FLYING) or (self._planned and landing):
            guide = Guide.SCENARIO
        elif landing:
            guide, keep = Guide.DESCEND, p.magnet_landing == "keep"
            stow = p.arm_landing == "stow"
        elif state in (State.HOLDING, State.BLIND):
            guide, keep = Guide.STOP, p.magnet_holding == "keep"
            stow = p.arm_holding == "stow"
        elif state is State.FAILSAFE:
            keep, stow = p.magnet_failsafe == "keep", p.arm_failsafe == "stow"
        elif state is State.DISARMED:
            keep = False
        elif state is State.RELEASED:
            keep, stow = p.magnet_released == "keep", p.arm_released == "stow"
            stow |= p.arm_released == "stow_to_land" and self._lands
        return Decision(state, self.cause, guide, self._arm, keep, stow, self._regains)

    def _events(
        self, seen: Observation, command: OperatorCommand | None
    ) -> Iterator[tuple[Event, str]]:
        """Yield the events of this tick and their causes, the most urgent first."""
        finding, p = self.checks.finding, self._parameters
        level, cause = (finding.level, finding.cause) if finding else (Level.FINE, "")
        if seen.authority.stopped:
            yield Event.STOPPED, seen.authority.failed
        if not seen.armed:
            if seen.on_ground:
                yield _planned(Event.TOUCHDOWN)
            still = self.state is State.TAKING_OFF
            when = "before it was airborne" if still else "in flight"
            if self.state in (State.RELEASED, State.FAILSAFE):
                when = f"while {self.state.value}: {self.cause}"
            yield Event.LOST_ARMING, f"the autopilot disarmed {when}"
            if self._arm and self._was_armed:
                yield Event.GIVEN_UP, "the autopilot disarmed before the take-off"
        if seen.authority.released_to:
            yield Event.RELEASED, _in_control(seen.authority.released_to)
            if self._arm:
                yield Event.GIVEN_UP, _in_control(seen.authority.released_to)
        elif self.state is State.RELEASED:
            event = Event.REGAINED_ON_GROUND if _stands(seen) else Event.REGAINED
            yield event, event.value
        failed = f"bridge: {seen.authority.failed}" if seen.authority.failed else ""
        if failed and self._arm:
            yield Event.GIVEN_UP, failed
        late = finding is not None and finding.name in DELAYS
        if late and self._arm and self.state is State.GROUNDED:
            yield Event.GIVEN_UP, cause  # waiting does not make a link faster
        if seen.authority.landed:
            yield Event.DOWN, f"{self.cause}; {Event.DOWN.value}"
        if level is Level.FAILSAFE:
            blind = self._flies_on(finding, seen)  # the estimate says nothing about the ground
            if seen.authority.landed if blind else seen.on_ground:
                yield Event.HARD_LIMIT_ON_GROUND, cause
            yield Event.BLIND_LIMIT if blind else Event.HARD_LIMIT, cause
        if self._stamp - self._blind_since >= p.blind_time:
            yield Event.BLIND_TOO_LONG, f"{self.cause}; blind for {p.blind_time:g} s"
        follows = not (seen.authority.lands or seen.authority.landed or seen.authority.released_to)
        if level is Level.FINE and self._failed and follows:
            yield self._agrees(), f"{self._failed} agrees again"
        if command is not None and not self.refusal(command, seen):
            event = self._event(command, seen)
            if self.state is State.RELEASED:  # the scenario goes on if it is regained in time
                self._regains, self._regained = self._regains + 1, self._stamp
                self.decision = self._decide()
            else:
                yield event, event.value
        if level is Level.LAND:
            yield Event.LAND_LIMIT, cause
        if failed:
            yield Event.LAND_LIMIT, failed
        if seen.touchdown:
            yield _planned(Event.TOUCHDOWN)
        if seen.overdue:
            yield Event.NO_TOUCHDOWN, "no touchdown in time"
        yield from self._holds.events(self._stamp, level, cause, self.cause, p)
        if level is Level.HOLD:
            yield from self._holds.again(finding.name, cause, p)
            yield Event.HOLD_LIMIT, cause
        if level is Level.FINE:
            yield from self._holds.clear(self.cause, seen.off_path, p)
            if self.state is State.HOLDING and self._goes_on:
                yield Event.RESUME, Event.RESUME.value
            if self._arm and seen.ready and self.checks.quiet:
                yield _planned(Event.READY)
        if seen.end_mission:
            yield Event.MISSION_OVER, seen.end_mission
        if seen.landing_due:
            yield _planned(Event.LANDING_DUE)
        if seen.arrived:
            yield _planned(Event.ARRIVED)
        planned = seen.reference[CHI, Z] - seen.ground
        if seen.state[CHI, Z] - seen.ground > p.airborne_height:
            yield _planned(Event.AIRBORNE)
        elif self.state is State.TAKING_OFF and self._stays_behind(
            self.memory, self._stamp, planned
        ):
            cause = NOT_FOLLOWED if seen.authority.lands else TOO_HEAVY
            if seen.on_ground:
                yield Event.NO_LIFTOFF, cause
            yield Event.LAND_LIMIT, cause

    def _go(self, event: Event, cause: str) -> None:
        source, self.state = self.state, TARGETS[self.state, event]
        self.cause = cause
        self._blind_since = self._stamp if self.state is State.BLIND else math.inf
        finding = self.checks.finding
        if self.state is State.BLIND:  # it goes on with its landing, or its hold, afterwards
            self._interrupted, self._failed = source, finding.name
        elif self.state is State.FAILSAFE:
            if self._failed == POSES_OFF:  # in the end the estimator follows them
                self._failed = ""
        else:
            self._planned = event is Event.LANDING_DUE
            quantity = finding.name if event is Event.HOLD_LIMIT and finding else self._failed
            held = self._failed and self._interrupted is State.HOLDING
            self._failed = ""
            if self.state is not State.HOLDING:
                self._holds.end(event)
            elif not held:
                self._holds.begin(self._stamp, event, quantity)
        in_time = self._stamp - self._regained <= self._parameters.regain_timeout
        self._goes_on, self._regained = event is Event.REGAINED and in_time, -math.inf
        self._arm = self._arm and self.state is not State.DISARMED
        self.decision = self._decide()
        self.changes.append(StateTransition(self._stamp, source, self.state, event, cause))

    def _held_by(self, authority: Authority) -> None:
        """Store who has control now, released or in failsafe; a change ends a resume."""
        self._lands = authority.lands
        if self.state in (State.RELEASED, State.FAILSAFE) and authority.released_to:
            cause = _in_control(authority.released_to)
            if cause != self.cause:
                self.cause, self._regained = cause, -math.inf
                self.decision = self._decide()

    def _flies_on(self, finding: ExceededLimit, seen: Observation) -> bool:
        """Whether the vehicle flies blind first.

        With a contradiction only above a stand, where the level descent of a failsafe topples it:
        if the IMU is right and the poses are wrong, every second more leads away.
        """
        began = self.state is State.BLIND and self._failed == finding.name
        above = finding.name == CONTRADICTION and seen.above_stand
        return finding.blind or began or above

    def _agrees(self) -> Event:
        """Return the event of poses that agree again: a take-off given up, or a landing, lands."""
        landing = self._interrupted in (State.TAKING_OFF, State.LANDING) and not self._planned
        return Event.AGREES_TO_LAND if landing else Event.AGREES

    def _event(self, command: OperatorCommand, seen: Observation) -> Event:
        """Return the event of a command; DISARM on the ground has its own event."""
        event = command.value
        disarm = command is OperatorCommand.DISARM and seen.on_ground
        return event if (self.state, event) in TARGETS or not disarm else Event.DISARM_ON_GROUND


@borrowing
def stays_behind(supervisor: np.ndarray, stamp: float, planned: float) -> bool:
    """Return whether the reference, `planned` [m] above the ground, has been airborne for
    liftoff_timeout at `stamp` [s], without the vehicle.

    supervisor (1,): memory of a `Supervisor` that takes off.
    """
    m = supervisor[0]
    if planned <= m.airborne_height:
        m.left_behind = math.inf
        return False
    m.left_behind = min(m.left_behind, stamp)
    return stamp - m.left_behind >= m.liftoff_timeout


def _stands(seen: Observation) -> bool:
    """Return whether a released vehicle stands on the ground."""
    low = seen.on_ground and tilt(seen.state[CHI, ATTITUDE]) < LEVEL
    return low or seen.authority.landed


def _in_control(released_to: str) -> str:
    return f"{released_to}, has control"


def _planned(event: Event) -> tuple[Event, str]:
    return event, ORDINARY[event]


class Holds:
    """The present hold of a supervisor, and how many ended by themselves.

    A hold beyond its limit becomes a landing after hold_timeout. After the limit is clear,
    when_clear decides (after_restart for a lost controller). A quantity whose limit has been clear
    so `resumes_allowed` times lands when it is exceeded again. Every other hold waits for a
    command, and lands after wait_timeout, or after command_timeout if a command or a reached goal
    started it.
    """

    def __init__(self) -> None:
        self._since = math.inf  # stamp [s] at which the hold began; inf: no hold
        self._beyond_since: float | None = None  # stamp [s] from which a limit is exceeded
        self._quantity = ""  # name of the quantity whose limit started the hold
        self._event = Event.HOLD
        self._resumes: Counter[str] = Counter()  # quantity → holds that ended in CLEAR

    @property
    def lasts(self) -> bool:
        """Whether there is a hold now."""
        return self._since < math.inf

    def begin(self, stamp: float, event: Event, quantity: str) -> None:
        """Begin a hold at `stamp` [s]; quantity: name of the quantity beyond its limit, or ""."""
        self._since, self._event, self._quantity = stamp, event, quantity
        self._beyond_since = None

    def end(self, event: Event) -> None:
        """End the hold."""
        self._since, self._beyond_since = math.inf, None
        self._resumes[self._quantity] += event is Event.CLEAR

    def again(
        self, quantity: str, cause: str, p: SupervisionParameters
    ) -> Iterator[tuple[Event, str]]:
        """Yield a landing if `quantity`, whose hold limit is exceeded, has had all its resumes."""
        resumes = self._resumes[quantity]
        if 0 < resumes >= p.resumes_allowed:
            yield Event.EXCEEDED_AGAIN, f"{cause}, again after {resumes} resumes"

    def events(
        self, stamp: float, level: Level, beyond: str, cause: str, p: SupervisionParameters
    ) -> Iterator[tuple[Event, str]]:
        """Yield the events that end the hold at `stamp` [s], and their causes.

        level, beyond: of the worst exceeded limit now, and its cause; cause: of the hold.
        """
        if not self.lasts:
            return
        if level is Level.FINE:
            self._beyond_since = None
        elif self._beyond_since is None:
            self._beyond_since = stamp
        elif stamp - self._beyond_since >= p.hold_timeout:
            yield Event.HELD_TOO_LONG, f"{beyond} for {p.hold_timeout:g} s"
        longest = p.command_timeout if self._event in BY_COMMAND else p.wait_timeout
        if stamp - self._since >= longest:
            yield Event.WAITED_TOO_LONG, f"{cause}; no command for {longest:g} s"

    def clear(
        self, cause: str, off_path: bool, p: SupervisionParameters
    ) -> Iterator[tuple[Event, str]]:
        """Yield the event that ends the hold because its limit is clear; cause: of the hold.

        off_path: a goal or trajectory was flown; then the hold waits for a command.
        """
        if not self._quantity or not self.lasts:
            return
        if self._quantity == CONTROLLERS:
            back = "the controller is back"
            if p.after_restart == "land":
                yield Event.RESTARTED_TO_LAND, back
            elif p.after_restart == "go_on":
                yield Event.RESTARTED, back
        elif p.when_clear == "land":
            yield Event.CLEAR_TO_LAND, f"{cause}; clear again"
        elif p.when_clear == "resume" and not off_path:
            if p.resumes_allowed > self._resumes[self._quantity]:
                yield Event.CLEAR, "clear again"
            else:  # none is allowed
                yield Event.CLEAR_TO_LAND, f"{cause}; clear again"
