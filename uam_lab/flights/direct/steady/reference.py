"""Mission: the reference of the next tick, and the supervisor's checks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import CHI, CHI_DOT, Z
from uam_control.grasp.directive import Step
from uam_control.grasp.executive import BEFORE
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import numbers, record
from uam_control.mission.course import Course
from uam_control.mission.flight_sequence import OLDEST
from uam_control.mission.guidance import Guidance
from uam_control.mission.motion.flatness import write_reference
from uam_control.mission.motion.path_clock import STEADY
from uam_control.mission.motion.trajectory import Moves
from uam_control.mission.payload_watch import PERIOD
from uam_control.stages.mission_stage import MissionStage
from uam_control.stamps import SECOND
from uam_control.supervision import Guide, State
from uam_control.supervision.checks import measure_all
from uam_control.supervision.setpoint_delay import SYMMETRIC
from uam_lab.flights.direct.steady.inputs import InputArrays

MOST = 64  # ticks whose reference is computed ahead
STATES = (State.TAKING_OFF, State.FLYING, State.LANDING)


class ReferenceArrays(NamedTuple):
    """State of the mission. motions (MOST, 5, 6 + n), times (MOST,) [s]: ahead, on the path;
    readings, bounds, values: of the checks; memory: WHOLE, REAL."""

    reference: np.ndarray
    motions: np.ndarray
    times: np.ndarray
    drag: np.ndarray
    readings: np.ndarray
    bounds: np.ndarray
    values: np.ndarray
    memory: np.ndarray


WHOLE = "ahead period joints on_ground advanced"
REAL = (
    "now age takeoff time begun ground low slow half delay_nominal setpoint_delay "
    "takes_off left_behind airborne liftoff_timeout watched watch_from "
    "gravity rate_max acceleration_max"
)


class ReferencePart:
    """The part of a `MissionStage`."""

    def __init__(self, stage: MissionStage) -> None:
        self._stage, self._mission, self.period = stage, stage.mission, stage.period
        shape = stage.mission.output.reference.shape
        self._motions, self._times = np.zeros((MOST, 5, shape[1])), np.zeros(MOST)
        self._stamps = np.zeros(MOST)
        self.memory = record(WHOLE, REAL)

    def steady(self, stamp: int) -> bool:
        """Return whether the ticks after `stamp` [ns], the last one with a state, may be steady."""
        stage, mission = self._stage, self._mission
        output, guidance, supervisor = mission.output, mission._guidance, mission._supervisor
        following = stamp + stage.period
        if output.state not in STATES or stage.ahead != following or guidance is None:
            return False
        stage.take_reports(following)
        watch, decision, checks = mission._watch, supervisor.decision, supervisor.checks
        stands = output.state is State.LANDING and mission._in_flight.on_ground
        return (
            output.flying
            and stage.flying
            and stage._last == stamp
            and not (stage._reports or mission._requests or output.done or mission._over)
            and stage._armed_since is not None
            and not (stage._authority.released_to or stage._authority.failed)
            and decision.guide is Guide.SCENARIO
            and decision is mission._followed
            and mission._end is None
            and mission._standing is None
            and mission._descent is None
            and mission._override._given is None
            and math.isinf(mission._touchdown._half_down)
            and checks.quiet
            and checks.finding is None
            and math.isinf(supervisor._holds._since)
            and _on_path(guidance, stamp / SECOND)
            and watch._shift._segment is None
            and mission._magnet_on(decision) == output.magnet
            and mission._phase(decision) == output.phase
            and not (stands and guidance.scenario_time >= self._half())
        )

    def load(self, stamp: int, most: int) -> int:
        """Copy the state into the arrays; return for how many ticks after `stamp` [ns] they
        suffice, at most `most`."""
        stage, mission = self._stage, self._mission
        output, supervisor, watch = mission.output, mission._supervisor, mission._watch
        p, landing = mission._parameters, mission.scenario.landing
        late = landing.at + landing.duration + p.touchdown_timeout
        until = math.inf if output.state is State.LANDING else landing.at
        until = min(mission._phases._end, mission._magnet._end, late, until)
        self.memory[0] = (
            *(stage.ahead, stage.period, supervisor.checks._joints, mission._in_flight.on_ground),
            *(0, mission._stamp, mission._age, mission._takeoff, output.time, stage.time),
            *(mission._ground, mission._ground + p.touchdown_height, p.touchdown_speed),
            *(self._half(), p.delay_nominal, supervisor.checks.setpoint_delay),
            *(output.state is State.TAKING_OFF, supervisor._left_behind),
            *(p.airborne_height, p.liftoff_timeout),
            *(watch._stepped, self._watch_from()),
            *(p.gravity, p.attitude_rate_max, p.attitude_acceleration_max),
        )
        self._until, self._begun = until, mission._stamp
        return self._look_ahead(stamp + stage.period, min(most, MOST))

    def renew(self, state: np.ndarray, most: int) -> int:
        """Compute further motions; return for how many ticks, at most `most`.

        state (3, 6 + n): of the estimator.
        """
        self._store_seen(state)
        self.memory["advanced"] = 0
        return self._look_ahead(self.memory["ahead"].item(), min(most, MOST))

    def _look_ahead(self, following: int, count: int) -> int:
        """Compute the motions of `count` ticks after `following` [ns]; return for how many of them
        nothing changes on the path."""
        until = self._until  # [s] scenario time
        guidance, period = self._mission._guidance, self._stage.period
        stamps, times = self._stamps[:count], self._times[:count]
        stamps[:] = (following + period * np.arange(1, count + 1)) / SECOND
        clock, path = guidance._clock, guidance.trajectory
        self._moves = clock._ramp is None and type(path) is Moves
        self._moves &= not self._mission._watch._shift._beside
        if self._moves:  # all in one call
            np.subtract(stamps, clock._begin, out=times)
            path.write_rows(times, self._motions[:count])
            return int(np.searchsorted(times, until))
        now, motion, found = self.memory["now"].item(), guidance.motion.copy(), 0
        for stamp in stamps.tolist():
            guidance.advance(stamp)
            if guidance.scenario_time >= until:
                break
            guidance._write_motion(stamp)
            times[found], self._motions[found] = guidance.scenario_time, guidance.motion
            found += 1
        guidance.advance(now)
        guidance.motion[:] = motion
        return found

    def _half(self) -> float:
        """Return the scenario time [s] from which on a touchdown is detected."""
        landing = self._mission.scenario.landing
        return landing.at + 0.5 * landing.duration

    def arrays(self) -> ReferenceArrays:
        """Return the arrays."""
        mission = self._mission
        checks, guidance = mission._supervisor.checks, mission._guidance
        return ReferenceArrays(
            mission.output.reference,
            self._motions,
            self._times,
            guidance._drag,
            self._stage.inputs.readings.values,
            checks._bounds,
            checks._values,
            self.memory,
        )

    @property
    def advanced(self) -> int:
        """Number of ticks since `load` whose reference was computed."""
        return self.memory["advanced"].item()

    def watch(self, state: np.ndarray) -> bool:
        """Step the executive of the grasps; return whether the next ticks are steady, too.

        state (3, 6 + n): of the estimator.
        """
        mission, output = self._mission, self._mission.output
        guidance, watch = mission._guidance, mission._watch
        clock, path = guidance._clock._ramp, guidance.trajectory
        self._store_seen(state)
        mission.watch_payload()
        same = guidance._clock._ramp is clock and guidance.trajectory is path
        moves = watch._shift._segment is not None or mission._over
        decision = mission._supervisor.decision
        if not same or moves or mission._magnet_on(decision) != output.magnet:
            return False
        self.memory["watched"] = watch._stepped
        self.memory["watch_from"] = self._watch_from()
        return True

    def _watch_from(self) -> float:
        """Return the scenario time [s] from which on the executive is due."""
        mission = self._mission
        executive = mission._watch.executive
        flies = mission.output.state is State.FLYING
        if not flies or mission._parameters.grasp_checks == "off":
            return math.inf
        if executive._step is not Step.IDLE:
            return -math.inf
        return executive._windows[0].descent - BEFORE if executive._windows else math.inf

    def _store_seen(self, state: np.ndarray) -> None:
        """Copy back what the executive of the grasps uses; state (3, 6 + n)."""
        mission, guidance = self._mission, self._mission._guidance
        done, now = self.advanced, self.memory["now"].item()
        if done:
            if self._moves:
                guidance.scenario_time, guidance._rates = self._times.item(done - 1), STEADY
            else:
                guidance.advance(now)
            guidance.motion[:] = self._motions[done - 1]
            seen = mission._seen = mission._in_flight
            seen.state, seen.readings = state, self._stage.inputs.readings
            mission._stamp = now

    def store(self, state: np.ndarray) -> None:
        """Copy the state back; state (3, 6 + n): of the estimator."""
        stage, mission, supervisor = self._stage, self._mission, self._mission._supervisor
        guidance = mission._guidance
        self._store_seen(state)
        m = numbers(self.memory)
        if m["now"] > self._begun:
            seen = mission._in_flight
            seen.armed, seen.touchdown, seen.on_ground = True, False, bool(m["on_ground"])
            seen.authority = stage._authority
            mission._age, mission.output.time = m["age"], m["time"]
            if guidance.scenario_time >= m["half"]:
                mission._touchdown._at_rest_since = None
            supervisor._stamp, supervisor._left_behind = m["now"], m["left_behind"]
            supervisor.checks.setpoint_delay = m["setpoint_delay"]
            stage._flown = m["ahead"]
        stage.ahead = m["ahead"]
        stage._readings = stage.inputs.readings

    def begun(self, stamp: int) -> float:
        """Store that the tick `stamp` [ns] has begun, and return its mission time [s]."""
        self._stage._last, self._stage.time = stamp, self.memory["begun"].item()
        return self._stage.time


def _on_path(guidance: Guidance, stamp: float) -> bool:
    """Return whether the reference follows the path at the pace of the stamps, at `stamp` [s]."""
    clock = guidance._clock
    return (
        guidance.course is Course.PATH
        and not guidance.coming_back
        and guidance.goes_on
        and clock.settled <= stamp
    )


@borrowing
def advance(r: ReferenceArrays, inputs: InputArrays, stamp: int, state: np.ndarray) -> bool:
    """Do what `MissionStage.advance` does at `stamp` [ns]; False, and nothing, where it decides."""
    m, i = r.memory[0], inputs.inputs
    readings = i.readings[0]
    link, late = SYMMETRIC * readings.round_trip, readings.loop_delay - m.delay_nominal
    loop = 0.0 if late < 0.0 else late
    calm = measure_all(
        *(state, r.reference, i.position, m.ground, r.readings),
        *(i.effort, i.gains, link, loop, r.bounds, m.joints, r.values),
    )
    time, ahead = r.times[m.advanced], stamp + m.period
    now = ahead / SECOND
    on_ground = state[CHI, Z] < m.low and abs(state[CHI_DOT, Z]) < m.slow
    if not calm or (on_ground and time >= m.half) or (m.takes_off and not rises(r, now, state)):
        return False
    m.setpoint_delay = loop if math.isnan(link) or loop > link else link
    m.ahead = ahead
    m.age = min(max(now - m.now, 0.0), OLDEST)
    m.now, m.time, m.on_ground = now, now - m.takeoff, on_ground
    write_reference(
        *(r.motions[m.advanced], r.drag, m.gravity, m.rate_max, m.acceleration_max, r.reference)
    )
    m.advanced += 1
    return True


@borrowing
def rises(r: ReferenceArrays, now: float, state: np.ndarray) -> bool:
    """Return whether a take-off goes on at `now` [s]: not airborne yet, and not late.

    See `Supervisor`.
    """
    m = r.memory[0]
    if state[CHI, Z] - m.ground > m.airborne:
        return False
    left = min(m.left_behind, now)
    if r.reference[CHI, Z] - m.ground <= m.airborne:
        left = math.inf
    elif now - left >= m.liftoff_timeout:
        return False
    m.left_behind = left
    return True


@borrowing
def watch_due(r: ReferenceArrays) -> bool:
    """Return whether the executive of the grasps is due after `advance`."""
    m = r.memory[0]
    return m.now - m.watched >= PERIOD - 1e-6 and r.times[m.advanced - 1] >= m.watch_from
