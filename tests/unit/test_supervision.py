"""The supervisor: its transitions, its limits, and properties for arbitrary inputs."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from uam_control.settings.parameter_set import ParameterError
from uam_control.supervision import (
    Authority,
    Event,
    Guide,
    Inputs,
    Observation,
    OperatorCommand,
    Readings,
    State,
    SupervisionParameters,
    Supervisor,
)
from uam_control.supervision.checks import CHECKS, Checks, measure, read
from uam_control.supervision.monitor import Level, Monitor
from uam_control.supervision.states import TARGETS, TRANSITIONS
from uam_control.vehicle import load_description

DOCS = Path(__file__).resolve().parents[2] / "docs" / "supervision.md"

S500 = SupervisionParameters.among(load_description().node_parameters()["mission"], 2)


def mermaid() -> str:
    """Return the transitions as a mermaid state diagram, one arrow per pair of states."""
    arrows: dict[tuple[State, State], list[str]] = {}
    for source, event, target in TRANSITIONS:
        arrows.setdefault((source, target), []).append(event.value)
    lines = ["stateDiagram-v2"]
    lines += [f'    state "{state.value}" as {state.name}' for state in State]
    lines.append(f"    [*] --> {State.GROUNDED.name}")
    lines += [
        f"    {source.name} --> {target.name}: {' / '.join(events)}"
        for (source, target), events in arrows.items()
    ]
    lines.append(f"    {State.DISARMED.name} --> [*]")
    return "\n".join(lines)


def test_the_diagram_in_the_docs_is_the_table():
    assert f"```mermaid\n{mermaid()}\n```" in DOCS.read_text(), mermaid()


def test_the_docs_name_every_state_in_the_policy():
    text = DOCS.read_text()
    for state in State:
        assert f"\n| {state.value} |" in text


def test_the_table_is_unambiguous_and_every_state_can_be_reached_and_left():
    assert len(TARGETS) == len(TRANSITIONS)
    reached = {State.GROUNDED} | {target for _, _, target in TRANSITIONS}
    assert reached == set(State)
    assert {source for source, _, _ in TRANSITIONS} == set(State) - {State.DISARMED}
    assert {event for _, event, _ in TRANSITIONS} == set(Event)


def test_failsafe_ends_only_by_command_and_motors_go_off_on_the_ground():
    ways_out = [event for source, event, _ in TRANSITIONS if source is State.FAILSAFE]
    assert ways_out == [Event.DISARM]
    aloft = {State.FLYING, State.HOLDING}
    off = {e for s, e, target in TRANSITIONS if s in aloft and target is State.DISARMED}
    assert off == {Event.LOST_ARMING}  # the autopilot has disarmed by itself


def test_every_check_has_a_value():
    values, seen, two, three = np.full(len(CHECKS), np.nan), observation(), np.ones(2), np.ones(3)
    measure(seen.state, seen.reference, three, 0.0, 0.0, np.zeros((2, 3)), two, values)
    assert np.isnan(values).sum() == 11
    read(Readings(), two, three, values)
    assert not np.isnan(values).any()
    checks = Checks(S500)
    assert checks.update(0.0, seen, True) is None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"tilt_hold": 1.2}, "tilt_hold: 1.2 is not below tilt_failsafe, 1.05"),
        ({"position_error_land": 4.0}, "position_error_land: 4 is not below position_error_fail"),
        ({"geofence_low": (0.0, 6.0, 0.0)}, "geofence_low: 6 in y is not below geofence_high, 5"),
        ({"arm_holding": "wave"}, "arm_holding: 'wave' is not one of stay, stow"),
        ({"battery_land": math.nan}, "battery_land: nan is outside 0 to 1"),
    ],
)
def test_limits_that_do_not_escalate_are_refused(changes, text):
    with pytest.raises(ParameterError, match=text):
        dataclasses.replace(S500, **changes).validated(2)


LIMITS, AFTER = (1.0, 2.0, math.inf), (0.25, 0.05, 0.0)


def run(monitor, values, begin=0.0, step=0.1):
    """Return the levels for values at intervals of `step` [s]."""
    return [
        monitor.update(begin + step * k, value, LIMITS, AFTER, 0.5, 0.2)
        for k, value in enumerate(values)
    ]


def test_a_monitor_waits_rises_and_falls_with_hysteresis_in_value_and_time():
    monitor = Monitor()
    assert run(monitor, [1.1, 1.1, 1.1]) == [Level.FINE] * 3
    assert run(monitor, [1.1, 2.1, 2.1, 2.1], 0.3) == [1, 1, 2, 2]
    # below the limit, but not by the hysteresis: no change
    assert run(monitor, [1.7] * 10, 0.8) == [2] * 10
    # clear of the second limit, for long enough: the first one still holds
    assert run(monitor, [1.5] * 8, 2.0)[-1] is Level.HOLD
    levels = run(monitor, [0.7] * 8, 3.0)
    assert levels[0] is Level.HOLD and levels[-1] is Level.FINE and monitor.quiet


@given(st.lists(st.floats(0.81, 1.5), min_size=5, max_size=60))
def test_noise_about_a_limit_does_not_toggle(values):
    """The level HOLD remains until a value is clear of the limit by the hysteresis."""
    monitor = Monitor()
    run(monitor, [1.2] * 10)
    assert set(run(monitor, values, 1.0)) == {Level.HOLD}


def test_a_short_excess_and_an_unknown_value_have_no_effect():
    monitor = Monitor()
    assert set(run(monitor, [5.0, 0.1] * 20)) == {Level.FINE}
    assert not any(run(Monitor(), [-math.inf] * 20))
    assert run(Monitor(), [math.nan] * 3)[-1] is Level.LAND


def observation(**changes):
    """Return an observation without tracking error, 1 m above the start."""
    state, reference = np.zeros((3, 8)), np.zeros((3, 8))
    state[0, 2] = reference[0, 2] = 1.0
    seen = Observation(state, reference, 0.0, armed=True, ready=True)
    for name, value in changes.items():
        setattr(seen, name, value)
    return seen


def flying(**parameters):
    """A supervisor after take-off, and the time of its steps."""
    made = Supervisor(dataclasses.replace(S500, **parameters).validated(2))
    made.start()
    for stamp in (0.0, 0.01):
        made.step(stamp, observation())
    assert made.state is State.FLYING
    return made


def watch(supervisor, seen, seconds, begin=1.0):
    """Step for a while; return the last decision."""
    for k in range(round(seconds / 0.01) + 1):
        decision = supervisor.step(begin + 0.01 * k, seen)
    return decision


def with_state(entry, value):
    seen = observation()
    seen.state[entry] = value
    return seen


@pytest.mark.parametrize(
    ("seen", "state", "cause"),
    [
        (with_state((0, 0), 1.2), State.HOLDING, "position error 1.20 m exceeds 1 m"),
        (with_state((0, 0), 2.0), State.LANDING, "position error 2.00 m exceeds 1.5 m"),
        (with_state((0, 0), 3.5), State.FAILSAFE, "position error 3.50 m exceeds 3 m"),
        (with_state((0, 4), -0.9), State.HOLDING, "tilt 0.90 rad exceeds 0.8 rad"),
        (with_state((0, 3), 1.2), State.FAILSAFE, "tilt 1.20 rad exceeds 1.05 rad"),
        (with_state((1, 5), 9.0), State.HOLDING, "body rate 9.0 rad/s exceeds 8 rad/s"),
        (with_state((1, 3), -20.0), State.FAILSAFE, "body rate 20.0 rad/s exceeds 15 rad/s"),
        (with_state((0, 6), -2.0), State.HOLDING, "joint angle at 1.05 of its limit"),
        (with_state((0, 7), math.nan), State.FAILSAFE, "estimate is not finite"),
        (with_state((2, 1), math.inf), State.FAILSAFE, "estimate is not finite"),
        (observation(ground=-4.5), State.HOLDING, "altitude 5.50 m exceeds 5 m"),
        (observation(readings=Readings(battery=0.1)), State.LANDING, "battery 0.10 full, below"),
        (observation(readings=Readings(mocap_age=0.3)), State.HOLDING, "mocap pose is 0.30 s old"),
        (observation(readings=Readings(mocap_age=1.1)), State.FAILSAFE, "mocap pose is 1.10 s"),
        (observation(readings=Readings(joint_age=0.3)), State.HOLDING, "joint angles are 0.30 s"),
        (observation(readings=Readings(controller_age=0.3)), State.HOLDING, "a controller's gains"),
        (
            observation(readings=Readings(autopilot_age=0.8)),
            State.LANDING,
            "no message of the autopilot for 0.80 s, 0.75 s allowed",
        ),
        (
            observation(readings=Readings(round_trip=0.038)),
            State.LANDING,
            "autopilot's link takes 0.038 s there and back, 0.03 s allowed",
        ),
        (
            observation(readings=Readings(round_trip=0.068)),
            State.FAILSAFE,
            "autopilot's link takes 0.068 s there and back, 0.05 s allowed",
        ),
        (
            observation(readings=Readings(temperature=71)),
            State.HOLDING,
            "servo temperature 71 deg C",
        ),
        (
            observation(readings=Readings(temperature=76)),
            State.LANDING,
            "servo temperature 76 deg C",
        ),
        (observation(readings=Readings(missed_ticks=130)), State.HOLDING, "130 control ticks"),
        (observation(readings=Readings(missed_ticks=260)), State.FAILSAFE, "260 control ticks"),
        (
            observation(readings=Readings(mocap_still=0.3)),
            State.HOLDING,
            "mocap pose has been the same for 0.30 s",
        ),
        (
            observation(readings=Readings(mocap_still=1.1)),
            State.FAILSAFE,
            "mocap pose has been the same for 1.10 s",
        ),
        (
            observation(readings=Readings(mocap_age=0.01, mocap_position=np.array([0.3, -0.4, 1]))),
            State.HOLDING,
            "motion capture is 0.50 m off the estimate, 0.15 m allowed",
        ),
        (
            observation(readings=Readings(joint_effort=np.array([0.0, -2.9]))),
            State.HOLDING,
            "joint torque at 1.04 of its limit",
        ),
        (
            observation(readings=Readings(gains=np.array([math.nan, 150.0, 3.0]))),
            State.HOLDING,
            "adapted gain at 1.50 of its limit",
        ),
        (observation(armed=False), State.DISARMED, "the autopilot disarmed in flight"),
    ],
)
def test_an_exceeded_limit_has_its_reaction_and_cause(seen, state, cause):
    supervisor = flying()
    decision = watch(supervisor, seen, 0.6)
    assert decision.state is state and decision.cause.startswith(cause)


def test_poses_away_from_the_estimate_start_failsafe_after_the_same_time_as_no_poses():
    seen = observation(readings=Readings(mocap_age=0.01, mocap_position=np.array([0.3, -0.4, 1])))
    supervisor = flying()
    assert watch(supervisor, seen, 0.95).state is State.HOLDING
    assert watch(supervisor, seen, 0.1, 1.96).state is State.FAILSAFE


def test_leaving_the_geofence_starts_a_landing():
    seen = observation()
    seen.state[0, 0] = seen.reference[0, 0] = 5.2
    decision = watch(flying(), seen, 0.4)
    assert decision.state is State.LANDING and decision.guide is Guide.DESCEND
    assert decision.cause == "geofence left by 0.20 m, 0.1 m allowed"


@pytest.mark.parametrize(
    ("policy", "state", "cause"),
    [
        ("resume", State.FLYING, "clear again"),
        ("land", State.LANDING, "position error 1.20 m exceeds 1 m; clear again"),
        ("wait", State.HOLDING, "position error 1.20 m exceeds 1 m"),
    ],
)
def test_a_hold_whose_limit_is_clear_ends_by_the_policy(policy, state, cause):
    far, near = with_state((0, 0), 1.2), observation()
    supervisor = flying(when_clear=policy)
    assert watch(supervisor, far, 0.6).state is State.HOLDING
    assert supervisor.refusal(OperatorCommand.RESUME, far).startswith("position error")
    assert watch(supervisor, near, 0.9, 2.0).state is State.HOLDING
    decision = watch(supervisor, near, 3.0, 3.0)
    assert (decision.state, decision.cause) == (state, cause)


def test_a_hold_that_waits_is_ended_by_a_command_or_becomes_a_landing():
    far, near = with_state((0, 0), 1.2), observation()
    for command, state, cause in (
        (OperatorCommand.RESUME, State.FLYING, "resume by command"),
        (None, State.LANDING, "position error 1.20 m exceeds 1 m; no command for 30 s"),
    ):
        supervisor = flying(when_clear="wait")
        watch(supervisor, far, 0.6)
        assert watch(supervisor, near, 28.0, 2.0).state is State.HOLDING
        supervisor.step(30.1, near, command)
        decision = watch(supervisor, near, 2.0, 30.2)
        assert (decision.state, decision.cause) == (state, cause)


def test_a_limit_that_comes_back_again_and_again_lands():
    far, near = with_state((0, 0), 1.2), observation()
    supervisor, stamp = flying(resumes_allowed=2.0), 1.0
    for _ in range(3):
        assert watch(supervisor, far, 0.6, stamp).state is State.HOLDING
        decision = watch(supervisor, near, 2.0, stamp + 0.7)
        stamp += 4.0
    assert decision.state is State.LANDING
    assert decision.cause == "position error 1.20 m exceeds 1 m; clear again, after 2 resumes"


def test_after_a_goal_a_cleared_limit_waits():
    """Resume would leave the goal for the scenario."""
    supervisor = flying()
    watch(supervisor, with_state((0, 0), 1.2), 0.6)
    assert watch(supervisor, observation(off_path=True), 3.0, 2.0).state is State.HOLDING


def test_a_hold_by_command_ends_by_command_or_after_its_own_time():
    supervisor = flying()
    supervisor.step(1.0, observation(), OperatorCommand.HOLD)
    assert watch(supervisor, observation(), 60.0, 2.0).state is State.HOLDING
    decision = watch(supervisor, observation(), 1.0, 301.0)
    assert decision.state is State.LANDING
    assert decision.cause == "hold by command; no command for 300 s"


def test_a_hold_by_command_replaces_that_of_a_limit():
    supervisor = flying()
    watch(supervisor, with_state((0, 0), 1.2), 0.6)
    supervisor.step(1.7, observation(), OperatorCommand.HOLD)
    assert watch(supervisor, observation(), 20.0, 2.0).state is State.HOLDING


def test_a_hard_limit_on_the_ground_disarms():
    supervisor = Supervisor(S500)
    supervisor.start()
    seen = observation(on_ground=True)
    seen.state[0, 2] = 0.0
    supervisor.step(0.0, seen)
    assert supervisor.state is State.TAKING_OFF
    seen.state[0, 3] = 1.3
    decision = watch(supervisor, seen, 0.2)
    assert decision.state is State.DISARMED and not decision.arm


@pytest.mark.parametrize(
    ("policy", "state", "cause"),
    [
        ("go_on", State.FLYING, "the controller is back"),
        ("land", State.LANDING, "the controller is back"),
        ("stay", State.HOLDING, "a controller's gains are 0.30 s old, 0.25 s allowed"),
    ],
)
def test_the_reaction_to_a_restarted_controller_follows_the_policy(policy, state, cause):
    supervisor = flying(after_restart=policy)
    assert watch(supervisor, observation(readings=Readings(controller_age=0.3)), 1.0).state is (
        State.HOLDING
    )
    decision = watch(supervisor, observation(readings=Readings(controller_age=0.02)), 2.0, 3.0)
    assert (decision.state, decision.cause) == (state, cause)


@pytest.mark.parametrize("keep", ["keep", "release"])
def test_arm_and_magnet_follow_the_policy(keep):
    supervisor = flying(arm_holding="stow", arm_landing="stay", magnet_holding=keep)
    decision = supervisor.step(1.0, observation(), OperatorCommand.HOLD)
    assert decision.stow and decision.keep_magnet is (keep == "keep")
    decision = supervisor.step(1.1, observation(), OperatorCommand.LAND)
    assert not decision.stow and decision.keep_magnet


def test_inputs_compute_ages_by_stamps_and_count_missed_ticks_of_a_second():
    inputs = Inputs(0.004)
    assert math.isnan(inputs.at(1.0).mocap_age) and math.isnan(inputs.at(1.0).autopilot_age)
    inputs.mocap(0.5, np.ones(3), np.ones(4))
    inputs.mocap(0.99, np.ones(3), np.ones(4))
    inputs.autopilot(0.5, 0.02)
    inputs.joints(1.0, np.array([0.1, 0.2]))
    inputs.gains(0.0, "arm", ["K0", "zeta", "rho"], np.array([-3.0, 0.1, 99.0]))
    inputs.gains(0.0, "position", ["D0", "s_norm"], np.array([5.0, 9.0]))
    for joint, degrees in (("alpha_1", 50.0), ("alpha_2", 61.0), ("alpha_1", math.nan)):
        inputs.temperature(joint, degrees)
    readings = inputs.at(1.02)  # four ticks were missed
    assert readings.mocap_age == pytest.approx(0.03)
    assert readings.mocap_still == pytest.approx(0.52)
    assert readings.missed_ticks == 4.0
    assert readings.temperature == 61.0 and readings.autopilot_age == pytest.approx(0.52)
    assert readings.round_trip == 0.02
    assert readings.controller_age == pytest.approx(1.02)
    assert readings.gains[2] == 3.0 and np.isnan(readings.gains[:2]).all()
    assert inputs.at(1.024).missed_ticks == 4.0
    for tick in range(300):
        readings = inputs.at(1.028 + 0.004 * tick)
    assert readings.missed_ticks == 0.0


PILOT = Authority("the pilot, in POSITION")
AIRBORNE = (State.FLYING, State.HOLDING, State.LANDING)


@pytest.mark.parametrize(
    "command", [None, OperatorCommand.HOLD, OperatorCommand.LAND], ids=["flying", "hold", "land"]
)
def test_any_state_in_the_air_is_released_in_the_same_tick(command):
    supervisor = flying()
    supervisor.step(1.0, observation(), command)
    assert supervisor.state in AIRBORNE
    decision = supervisor.step(1.004, observation(authority=PILOT))
    assert decision.state is State.RELEASED and decision.guide is Guide.NOTHING and decision.arm
    assert decision.cause == "the pilot, in POSITION, has control"
    assert decision.keep_magnet and decision.regains == 0
    assert not decision.stow  # a pilot flies on: the arm stays
    landing = Authority("the pilot, in LAND", lands=True)
    assert supervisor.step(1.008, observation(authority=landing)).stow


def test_the_take_off_is_released_too():
    supervisor = Supervisor(S500)
    supervisor.start()
    low = observation()
    low.state[0, 2] = 0.1
    assert supervisor.step(0.0, low).state is State.TAKING_OFF
    low.authority = PILOT
    assert supervisor.step(0.01, low).state is State.RELEASED


def test_arm_and_magnet_of_a_released_vehicle_follow_the_policy():
    supervisor = flying(arm_released="stay", magnet_released="release")
    decision = supervisor.step(1.0, observation(authority=PILOT))
    assert not decision.stow and not decision.keep_magnet


def test_the_cause_says_who_has_control_now():
    supervisor = flying()
    supervisor.step(1.0, observation(authority=Authority("the autopilot's failsafe, in LAND")))
    decision = supervisor.step(1.1, observation(authority=PILOT))
    assert decision.cause == "the pilot, in POSITION, has control"
    assert len([c for c in supervisor.changes if c.target is State.RELEASED]) == 1


@pytest.mark.parametrize(
    "seen",
    [
        with_state((0, 0), 9.0),
        with_state((0, 3), 2.0),
        with_state((0, 2), math.nan),
        observation(readings=Readings(mocap_age=9.0)),
        observation(readings=Readings(battery=0.01)),
        observation(touchdown=True, overdue=True, landing_due=True),
    ],
    ids=["far", "tilted", "not finite", "no mocap", "battery", "landing"],
)
def test_no_limit_takes_a_released_vehicle_from_the_pilot(seen):
    supervisor = flying()
    seen.authority = PILOT
    decision = watch(supervisor, seen, 10.0)
    assert decision.state is State.RELEASED and decision.arm and decision.regains == 0
    seen.authority = Authority()


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        ({}, State.HOLDING),
        ({"on_ground": True}, State.DISARMED),
        ({"authority": Authority(landed=True)}, State.DISARMED),
        ({"armed": False}, State.DISARMED),
    ],
)
def test_the_end_of_a_release(changes, state):
    supervisor = flying()
    watch(supervisor, observation(authority=PILOT), 1.0)
    decision = watch(supervisor, observation(**changes), 1.0, 3.0)
    assert decision.state is state and decision.arm is (state is State.HOLDING)


def test_resume_of_a_released_vehicle_counts_and_then_the_scenario_goes_on():
    supervisor, seen = flying(), observation(authority=PILOT)
    watch(supervisor, seen, 1.0)
    decision = supervisor.step(3.0, seen, OperatorCommand.RESUME)
    assert decision.state is State.RELEASED and decision.regains == 1
    assert watch(supervisor, seen, 1.0, 3.1).regains == 1
    assert supervisor.step(5.0, observation()).state is State.HOLDING
    assert supervisor.step(5.1, observation()).state is State.FLYING


def test_a_second_release_forgets_the_resume():
    supervisor, seen = flying(), observation(authority=PILOT)
    watch(supervisor, seen, 1.0)
    supervisor.step(3.0, seen, OperatorCommand.RESUME)
    supervisor.step(3.1, observation())
    assert supervisor.step(3.2, seen).state is State.RELEASED
    assert watch(supervisor, observation(), 20.0, 4.0).state is State.HOLDING


@pytest.mark.parametrize(
    ("command", "changes", "refusal"),
    [
        (OperatorCommand.RESUME, {"on_ground": True}, "on the ground: disarm, then start"),
        (OperatorCommand.RESUME, {"authority": PILOT._replace(landed=True)}, "on the ground"),
        (OperatorCommand.HOLD, {}, "the pilot, in POSITION has control"),
        (OperatorCommand.LAND, {}, "the pilot, in POSITION has control"),
        (OperatorCommand.DISARM, {}, "the pilot, in POSITION has control"),
        (OperatorCommand.DISARM, {"on_ground": True}, "the pilot, in POSITION has control"),
    ],
)
def test_commands_to_a_released_vehicle_that_are_refused(command, changes, refusal):
    supervisor = flying()
    seen = observation(**({"authority": PILOT} | changes))
    watch(supervisor, seen, 1.0)
    assert supervisor.refusal(command, seen).startswith(refusal)
    assert supervisor.step(3.0, seen, command).regains == 0


def test_resume_beyond_a_limit_is_refused():
    supervisor, tilted = flying(), with_state((0, 3), 0.9)
    tilted.authority = PILOT
    watch(supervisor, tilted, 1.0)
    assert supervisor.refusal(OperatorCommand.RESUME, tilted) == "tilt 0.90 rad exceeds 0.8 rad"
    assert supervisor.step(3.0, tilted, OperatorCommand.RESUME).regains == 0


def test_a_vehicle_that_somebody_else_arms_ends_the_start():
    supervisor = Supervisor(S500)
    assert watch(supervisor, observation(authority=PILOT), 1.0).state is State.GROUNDED
    supervisor.start()
    decision = supervisor.step(3.0, observation(authority=PILOT))
    assert decision.state is State.DISARMED and not decision.arm
    assert decision.cause == "the pilot, in POSITION, has control"


def test_nothing_is_armed_before_the_start():
    supervisor = Supervisor(S500)
    assert not watch(supervisor, observation(armed=False), 5.0).arm
    assert supervisor.state is State.GROUNDED
    supervisor.start()
    assert supervisor.decision.arm
    supervisor.give_up(10.0, "no answer")
    supervisor.start()
    assert not supervisor.decision.arm and supervisor.state is State.DISARMED


NUMBERS = st.floats(-1e3, 1e3) | st.sampled_from([math.nan, math.inf, -math.inf, 0.0])
READINGS = st.builds(
    Readings, *[NUMBERS] * 6,
    st.builds(np.array, st.tuples(NUMBERS, NUMBERS)),
    st.builds(np.array, st.tuples(NUMBERS, NUMBERS, NUMBERS)),
    autopilot_age=NUMBERS,
    mocap_still=NUMBERS,
    round_trip=NUMBERS,
    mocap_position=st.builds(np.array, st.tuples(NUMBERS, NUMBERS, NUMBERS)),
)  # fmt: skip


class AnySequence(RuleBasedStateMachine):
    """The supervisor's properties hold for any sequence of inputs."""

    # while somebody else has control
    WITHOUT_CONTROL = (State.GROUNDED, State.RELEASED, State.FAILSAFE, State.DISARMED)

    def __init__(self):
        super().__init__()
        self.supervisor = Supervisor(S500)
        self.seen = observation(ready=False)
        self.stamp = 0.0
        self.decision = self.supervisor.decision
        self.before = State.GROUNDED

    def step(self, stamp, command=None):
        self.before = self.supervisor.state
        armed, changes = self.decision.arm, len(self.supervisor.changes)
        self.decision = self.supervisor.step(stamp, self.seen, command)
        assert armed or not self.decision.arm  # never arms by itself
        if self.seen.authority.released_to:
            assert self.decision.state in self.WITHOUT_CONTROL
        if self.before is State.FAILSAFE and self.decision.state is not State.FAILSAFE:
            assert command is OperatorCommand.DISARM
        new = self.supervisor.changes[changes:]
        assert len(new) <= 1
        for change in new:
            assert TARGETS[change.source, change.event] is change.target
            assert change.source is not State.DISARMED and change.cause
            assert not math.isnan(change.stamp)
            if change.target is State.DISARMED:
                seen = self.seen
                on_ground = seen.on_ground or seen.touchdown or seen.authority.landed
                # a start that somebody else has overtaken ends; his vehicle is left alone
                overtaken = change.event is Event.GIVEN_UP and seen.authority.released_to
                by_command = command is OperatorCommand.DISARM
                assert on_ground or not seen.armed or by_command or overtaken

    @rule(seconds=st.sampled_from([0.004, 0.05, 0.6, 2.0]), ticks=st.integers(1, 20))
    def time_passes(self, seconds, ticks):
        for _ in range(ticks):
            self.stamp += seconds
            self.step(self.stamp)

    @rule(stamp=NUMBERS)
    def a_strange_stamp(self, stamp):
        self.step(stamp)
        if math.isfinite(stamp):
            self.stamp = max(self.stamp, stamp)

    @rule()
    def the_start(self):
        self.supervisor.start()
        self.decision = self.supervisor.decision

    @rule(who=st.sampled_from(["", "", "the pilot, in HOLD"]), landed=st.booleans())
    def control(self, who, landed):
        self.seen.authority = Authority(who, landed)

    @rule(command=st.sampled_from(OperatorCommand))
    def a_command(self, command):
        self.stamp += 0.004
        refusal = self.supervisor.refusal(command, self.seen)
        self.step(self.stamp, command)
        assert isinstance(refusal, str) and "\n" not in refusal

    @rule(row=st.integers(0, 2), column=st.integers(0, 7), value=NUMBERS)
    def an_estimate(self, row, column, value):
        self.seen.state[row, column] = value

    @rule()
    def all_well(self):
        self.seen = observation(readings=Readings())

    @rule(readings=READINGS)
    def other_readings(self, readings):
        self.seen.readings = readings

    @rule(
        name=st.sampled_from(
            ["armed", "ready", "landing_due", "on_ground", "touchdown", "overdue"]
        ),
        on=st.booleans(),
    )
    def the_mission_says(self, name, on):
        setattr(self.seen, name, on)

    @invariant()
    def what_the_state_means(self):
        decision = self.decision
        idle = (State.GROUNDED, State.RELEASED, State.FAILSAFE, State.DISARMED)
        assert (decision.guide is Guide.NOTHING) is (decision.state in idle)
        assert decision.arm or decision.state in (State.GROUNDED, State.DISARMED, State.FAILSAFE)
        assert decision.state is not State.DISARMED or not (decision.arm or decision.keep_magnet)


TestAnySequence = AnySequence.TestCase
TestAnySequence.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
