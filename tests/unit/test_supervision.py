"""The supervisor: its transitions and its limits."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from supervised import S500, flying, mermaid, observation, watch, with_state

from uam_control.mission.course import COURSES, NEXT, Course, Cue
from uam_control.settings.parameter_set import ParameterError
from uam_control.supervision import (
    Authority,
    Event,
    Guide,
    Inputs,
    OperatorCommand,
    Readings,
    State,
    Supervisor,
)
from uam_control.supervision.checks import (
    CHECKS,
    LATE,
    LATE_FOR_REFERENCE,
    LATE_LOOP,
    STILL,
    Checks,
    measure,
    read,
)
from uam_control.supervision.monitor import Level, Monitor
from uam_control.supervision.states import TARGETS, TRANSITIONS

DOCS = Path(__file__).resolve().parents[2] / "docs" / "supervision.md"


def test_the_diagram_in_the_docs_is_the_table():
    scenario = (State.TAKING_OFF, State.FLYING, State.HOLDING, State.LANDING)
    drawn = mermaid(TRANSITIONS, State.GROUNDED, State.DISARMED, scenario)
    assert f"```mermaid\n{drawn}\n```" in DOCS.read_text(), drawn


def test_the_table_of_the_courses_is_unambiguous_and_every_course_can_be_reached_and_left():
    assert len(NEXT) == len(COURSES)
    assert {source for source, _, _ in COURSES} == set(Course)
    assert {target for _, _, target in COURSES} == set(Course)
    assert {cue for _, cue, _ in COURSES} == set(Cue)


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


def test_motors_go_off_on_the_ground_alone():
    aloft = {State.FLYING, State.HOLDING}
    off = {e for s, e, target in TRANSITIONS if s in aloft and target is State.DISARMED}
    assert off == {Event.LOST_ARMING, Event.STOPPED}  # the autopilot has stopped them


def test_every_check_has_a_value():
    values, seen, nothing = np.full(len(CHECKS), np.nan), observation(), Readings().arrays
    limited = Checks(S500).arrays._replace(values=values)
    measure(limited, seen.state, seen.reference, 0.0, nothing)
    assert np.isnan(values).sum() == 16
    read(limited, nothing)
    assert np.flatnonzero(np.isnan(values)).tolist() == [
        LATE,
        LATE_LOOP,
        LATE_FOR_REFERENCE,
        STILL,
    ]  # by `Checks.update`
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
        (observation(readings=Readings(mocap_age=1.1)), State.BLIND, "mocap pose is 1.10 s"),
        (observation(readings=Readings(joint_age=0.3)), State.HOLDING, "joint angles are 0.30 s"),
        (observation(readings=Readings(controller_age=0.3)), State.HOLDING, "a controller's gains"),
        (
            observation(readings=Readings(autopilot_age=0.8)),
            State.LANDING,
            "no message of the autopilot for 0.80 s, 0.75 s allowed",
        ),
        (
            observation(readings=Readings(round_trip=0.082)),
            State.LANDING,
            "setpoint delay 0.041 s exceeds 0.04 s of the loops' margin",
        ),
        (
            observation(readings=Readings(round_trip=0.228)),
            State.FAILSAFE,
            "setpoint delay 0.114 s exceeds 0.05 s of the loops' margin",
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
            State.BLIND,
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


@pytest.mark.parametrize(
    ("height", "on_ground", "state"), [(0.0, True, State.DISARMED), (0.2, False, State.LANDING)]
)
def test_a_vehicle_that_does_not_lift_off_gives_up(height, on_ground, state):
    supervisor = Supervisor(S500)
    supervisor.start()
    seen = observation(on_ground=on_ground)
    seen.state[0, 2], seen.reference[0, 2] = height, S500.airborne_height
    assert watch(supervisor, seen, 10.0).state is State.TAKING_OFF
    seen.reference[0, 2] = S500.airborne_height + 0.01
    assert watch(supervisor, seen, S500.liftoff_timeout - 0.1, 11.0).state is State.TAKING_OFF
    decision = watch(supervisor, seen, 0.2, 11.0 + S500.liftoff_timeout - 0.1)
    assert decision.state is state
    assert decision.cause == "no lift-off: too little thrust for the weight"


def test_no_lift_off_without_the_autopilot_is_not_the_weight():
    supervisor = Supervisor(S500)
    supervisor.start()
    seen = observation(on_ground=True, authority=Authority(lands=True))
    seen.state[0, 2], seen.reference[0, 2] = 0.0, S500.airborne_height + 0.01
    decision = watch(supervisor, seen, S500.liftoff_timeout + 0.2, 10.0)
    assert decision.state is State.DISARMED
    assert decision.cause == "no lift-off: the autopilot is silent, or lands by itself"


def test_poses_away_from_the_estimate_fly_blind_after_the_same_time_as_no_poses():
    seen = observation(readings=Readings(mocap_age=0.01, mocap_position=np.array([0.3, -0.4, 1])))
    supervisor = flying()
    assert watch(supervisor, seen, 0.95).state is State.HOLDING
    assert watch(supervisor, seen, 0.1, 1.96).state is State.BLIND


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
    for _ in range(2):
        assert watch(supervisor, far, 0.6, stamp).state is State.HOLDING
        assert watch(supervisor, near, 2.0, stamp + 0.7).state is State.FLYING
        stamp += 4.0
    decision = watch(supervisor, far, 0.6, stamp)
    assert decision.state is State.LANDING
    assert decision.cause == "position error 1.20 m exceeds 1 m, again after 2 resumes"
    assert supervisor.changes[-1].event is Event.EXCEEDED_AGAIN


def test_each_quantity_has_its_own_resumes():
    old, near = observation(readings=Readings(mocap_age=0.5)), observation()
    far = with_state((0, 0), 1.2)
    supervisor, stamp = flying(resumes_allowed=1.0), 1.0
    for seen, state in ((far, State.FLYING), (old, State.FLYING), (old, State.LANDING)):
        watch(supervisor, seen, 0.6, stamp)
        assert watch(supervisor, near, 2.0, stamp + 0.7).state is state
        stamp += 4.0


def test_without_a_resume_allowed_it_lands_once_the_limit_is_clear():
    supervisor = flying(resumes_allowed=0.0)
    assert watch(supervisor, with_state((0, 0), 1.2), 0.6, 1.0).state is State.HOLDING
    assert watch(supervisor, observation(), 2.0, 1.7).state is State.LANDING


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


def test_a_constant_bias_is_no_contradiction_but_a_fast_change_is():
    inputs, bias = Inputs(0.004), np.array([0.6, 0.0, 0.8])  # norm 1 m/s^2
    assert math.isnan(inputs.at(0.0).contradiction)
    for tick in range(500):
        inputs.accelerometer_bias(0.02 * tick, bias)
    assert inputs.at(10.0).contradiction == pytest.approx(0.0, abs=1e-12)
    inputs.accelerometer_bias(10.0, bias + [0.0, 1.5, 2.0])  # by 2.5 m/s^2
    assert inputs.at(10.0).contradiction == pytest.approx(2.5)
    assert math.isnan(inputs.at(10.125).contradiction)  # too old
    # the mean has followed by 0.02 s / 5 s of 2.5 m/s^2
    inputs.accelerometer_bias(10.02, bias + [0.0, 1.5, 2.0])
    assert inputs.at(10.02).contradiction == pytest.approx(2.5 * (1.0 - 0.004), rel=1e-3)


@given(st.floats(0.2, 2.0))
def test_the_start_of_the_estimate_counts_little_after_two_seconds(size):
    """The estimated bias grows to its value within a second; a take-off comes later."""
    inputs, bias = Inputs(0.004), size * np.array([1.0, 0.0, 0.0])
    for tick in range(150):
        stamp = 0.02 * tick
        inputs.accelerometer_bias(stamp, min(stamp / 0.5, 1.0) * bias)
    assert inputs.at(3.0).contradiction < 0.1 * size


def test_inputs_compute_ages_by_stamps_and_count_missed_ticks_of_a_second():
    inputs = Inputs(0.004)
    assert math.isnan(inputs.at(1.0).mocap_age) and math.isnan(inputs.at(1.0).autopilot_age)
    inputs.mocap(0.5, np.ones(3), np.ones(4))
    inputs.mocap(0.99, np.ones(3), np.ones(4))
    inputs.autopilot(0.5, 0.02, 0.03)
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
    assert (readings.round_trip, readings.loop_delay) == (0.02, 0.03)
    assert readings.controller_age == pytest.approx(1.02)
    assert readings.gains[2] == 3.0 and np.isnan(readings.gains[:2]).all()
    assert inputs.at(1.024).missed_ticks == 4.0
    for tick in range(300):
        readings = inputs.at(1.028 + 0.004 * tick)
    assert readings.missed_ticks == 0.0


@pytest.mark.parametrize("state", list(State))
def test_states_that_stop_end_every_flight_in_failsafe_and_nothing_else(state):
    supervisor = Supervisor(S500)
    supervisor.state = state
    flown = (State.TAKING_OFF, State.FLYING, State.HOLDING, State.LANDING, State.BLIND)
    decision = supervisor.lose_states("no state for 1 s")
    assert supervisor.state is (State.FAILSAFE if state in flown else state)
    assert [change.cause for change in supervisor.changes] == ["no state for 1 s"] * (
        state in flown
    )
    if state in flown:
        assert decision.guide is Guide.NOTHING
