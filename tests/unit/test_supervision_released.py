"""The supervisor while somebody else has control, and before the start."""

from __future__ import annotations

import math

import pytest
from supervised import S500, flying, observation, watch, with_state

from uam_control.supervision import Authority, Guide, OperatorCommand, Readings, State, Supervisor

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
        ({"on_ground": True, "state": with_state((0, 4), 0.25).state}, State.HOLDING),  # it tilts
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


def test_a_resume_that_was_not_answered_does_not_act_minutes_later():
    supervisor, seen = flying(), observation(authority=PILOT)
    watch(supervisor, seen, 1.0)
    supervisor.step(3.0, seen, OperatorCommand.RESUME)
    watch(supervisor, seen, S500.regain_timeout, 3.0)
    assert watch(supervisor, observation(), 10.0, 9.0).state is State.HOLDING


def test_a_disarming_before_the_take_off_ends_the_flight():
    supervisor, seen = Supervisor(S500), observation(on_ground=True, armed=False, ready=False)
    supervisor.step(0.0, seen)
    supervisor.start()
    assert watch(supervisor, seen, 1.0, 0.1).state is State.GROUNDED
    supervisor.step(1.2, observation(on_ground=True, ready=False))
    decision = supervisor.step(1.3, seen)
    assert decision.state is State.DISARMED and not decision.arm
    assert decision.cause == "the autopilot disarmed before the take-off"


def test_in_failsafe_a_pilot_is_shown_and_not_disarmed():
    supervisor = flying()
    supervisor.lose_states("no states")
    seen = observation(authority=PILOT)
    decision = supervisor.step(1.0, seen)
    assert decision.state is State.FAILSAFE
    assert decision.cause == "the pilot, in POSITION, has control"
    refusal = supervisor.refusal(OperatorCommand.DISARM, seen)
    assert refusal == "the pilot, in POSITION has control"
    assert supervisor.step(1.1, seen, OperatorCommand.DISARM).state is State.FAILSAFE
    assert supervisor.step(1.2, observation(), OperatorCommand.DISARM).state is State.DISARMED


def test_a_person_who_chooses_another_mode_ends_a_resume():
    supervisor, seen = flying(), observation(authority=PILOT)
    watch(supervisor, seen, 1.0)
    supervisor.step(3.0, seen, OperatorCommand.RESUME)
    supervisor.step(3.1, observation(authority=Authority("the pilot, in HOLD")))
    assert watch(supervisor, observation(), 10.0, 3.2).state is State.HOLDING


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
