"""The supervisor without usable poses: blind, then failsafe, and back when they agree again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from supervised import S500, flying, observation, watch

from uam_control.supervision import (
    Authority,
    Event,
    Guide,
    OperatorCommand,
    Readings,
    State,
    Supervisor,
)

STEP = 0.01  # [s] of `watch`
BEGIN = 1.0  # [s] stamp at which `watch` begins


def lost(**changes) -> object:
    return observation(readings=Readings(mocap_age=1.1), **changes)


def good(**changes) -> object:
    return observation(readings=Readings(mocap_age=0.01), **changes)


def blind(supervisor: Supervisor | None = None, seen=None) -> Supervisor:
    """Return a supervisor that has just become blind, at BEGIN + 0.2 s."""
    supervisor = supervisor or flying()
    assert watch(supervisor, seen or lost(), 0.2).state is State.BLIND
    return supervisor


def test_without_poses_it_stops_on_the_imu_and_then_hands_over():
    supervisor = blind()
    assert supervisor.decision.guide is Guide.STOP and supervisor.decision.arm
    almost = S500.blind_time - 0.12
    assert watch(supervisor, lost(), almost, BEGIN + 0.2).state is State.BLIND
    decision = watch(supervisor, lost(), 0.2, BEGIN + 0.2 + almost)
    assert decision.state is State.FAILSAFE and decision.guide is Guide.NOTHING
    assert decision.cause == "mocap pose is 1.10 s old, 1 s allowed; blind for 1.5 s"


@pytest.mark.parametrize("late", [0.0, S500.blind_time - 0.5])
def test_poses_that_agree_for_clear_after_are_held_on_and_the_path_goes_on(late):
    # back in time, or so late that the failsafe has begun while the autopilot still follows
    supervisor = blind()
    watch(supervisor, lost(), late, BEGIN + 0.2)
    watch(supervisor, good(), S500.clear_after + 0.05, BEGIN + 0.2 + late)
    path = [(change.source, change.target) for change in supervisor.changes[-2:]]
    assert supervisor.state is State.FLYING and path[-1] == (State.HOLDING, State.FLYING)
    assert path[0][0] is (State.FAILSAFE if late else State.BLIND)
    assert supervisor.changes[-2].cause == "mocap agrees again"


def test_poses_that_stay_away_are_no_agreement_when_the_estimator_follows_them():
    off = observation(readings=Readings(mocap_age=0.01, mocap_position=np.array([0.3, 0.0, 1.0])))
    supervisor = flying()
    watch(supervisor, off, 1.1)
    assert supervisor.state is State.BLIND
    watch(supervisor, off, S500.blind_time, BEGIN + 1.1)
    assert watch(supervisor, good(), 5.0, 4.0).state is State.FAILSAFE


@pytest.mark.parametrize(
    "authority",
    [
        Authority(lands=True),  # the autopilot descends by itself
        Authority("the pilot or a ground station, in POSCTL"),
    ],
)
def test_what_others_have_taken_over_is_not_taken_back(authority):
    supervisor = blind()
    watch(supervisor, lost(), S500.blind_time, BEGIN + 0.2)
    assert watch(supervisor, good(authority=authority), 5.0, 3.0).state is State.FAILSAFE


def test_a_landing_goes_on_blind_and_afterwards():
    supervisor = flying()
    seen = observation(readings=Readings(battery=0.1))
    assert watch(supervisor, seen, 0.5).state is State.LANDING
    seen = observation(readings=Readings(battery=0.1, mocap_age=1.1))
    assert watch(supervisor, seen, 0.2, 2.0).state is State.BLIND
    assert supervisor.decision.guide is Guide.DESCEND
    assert watch(supervisor, good(), 1.1, 2.2).state is State.LANDING
    assert supervisor.changes[-1].event is Event.AGREES_TO_LAND


def test_a_hold_by_command_is_one_again():
    supervisor = flying()
    supervisor.step(0.5, good(), OperatorCommand.HOLD)
    blind(supervisor)
    assert watch(supervisor, good(), 10.0, BEGIN + 0.2).state is State.HOLDING


def test_another_quantity_beyond_its_limit_hands_over_at_once():
    supervisor = blind()
    seen = lost()
    seen.state[0, 3] = S500.tilt_failsafe + 0.1
    assert watch(supervisor, seen, 0.2, BEGIN + 0.2).state is State.FAILSAFE
    assert supervisor.cause.startswith("tilt")


@pytest.mark.parametrize("seconds", [0.2, S500.blind_time + 0.4])
def test_on_the_ground_the_autopilot_says_so_and_the_motors_go_off(seconds):
    supervisor = blind()
    watch(supervisor, lost(), seconds, BEGIN + 0.2)
    low = lost(on_ground=True)  # by the estimate that has no poses: no evidence
    state = supervisor.state
    end = BEGIN + 0.2 + seconds
    assert watch(supervisor, low, 0.0, end + STEP).state is state
    decision = watch(supervisor, lost(authority=Authority(landed=True)), 0.0, end + 2 * STEP)
    assert decision.state is State.DISARMED and not decision.arm
    assert decision.cause.endswith("landed, says the autopilot")


def test_a_command_to_land_hands_over():
    supervisor = blind()
    supervisor.step(BEGIN + 0.3, lost(), OperatorCommand.LAND)
    assert supervisor.state is State.FAILSAFE


def test_without_blind_time_the_failsafe_follows_at_once():
    supervisor = flying()
    supervisor.configure(dataclasses.replace(S500, blind_time=0.0))
    watch(supervisor, lost(), 0.2)
    assert supervisor.state is State.FAILSAFE
