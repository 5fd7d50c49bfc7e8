"""The arm takes out at the hand what the base leaves."""

import math

import numpy as np
import pytest

from uam_control.arm.hand import hands
from uam_control.control.hand_steering import HandParameters, hardest, squared
from uam_control.stages.law_stages import HandStage
from uam_control.vehicle import chain_of, load_description

VEHICLE = load_description()
CHAIN = chain_of(VEHICLE)
PERIOD = 0.004
STEERED = {"hand_bandwidth": 10.0, "hand_damping": 1e-4}


def stage(**parameters):
    return HandStage(HandParameters(**parameters), PERIOD, 2, VEHICLE)


def reference():
    """Hover at (1, 2, 3) with the arm at (0, 90) deg."""
    found = np.zeros((3, 8))
    found[0] = 1.0, 2.0, 3.0, 0.0, 0.0, 0.3, 0.0, math.pi / 2
    return found


def off(x=0.0, y=0.0, z=0.0):
    """The state of a vehicle that is off its reference along the axes of its body [m]."""
    found = reference()
    c, s = math.cos(0.3), math.sin(0.3)
    found[0, :3] += c * x - s * y, s * x + c * y, z
    return found


def flown(steered, state, ticks, flying=True, saturated=False):
    for _ in range(ticks):
        found = steered.update(state, reference(), flying, saturated)
    return found


def place(base, arm):
    """Where the hand is: the base of one (3, 8), the arm of another."""
    return hands(CHAIN, np.array([[*base[0, :6], *arm[0, 6:]]]))[0, :3]


def test_without_bandwidth_the_reference_is_that_of_the_mission():
    np.testing.assert_array_equal(flown(stage(), off(x=0.02), 9), reference())


def test_the_hand_comes_to_its_place_though_the_base_does_not():
    state = off(x=0.02, z=-0.015)
    found = flown(stage(**STEERED), state, 500)
    np.testing.assert_allclose(place(state, found), place(reference(), reference()), atol=1e-4)
    np.testing.assert_array_equal(found[:, :6], reference()[:, :6])
    np.testing.assert_allclose(found[1, 6:], 0.0, atol=1e-3)  # it has arrived


def test_what_a_planar_arm_cannot_reach_stays():
    state = off(y=0.01)
    found = flown(stage(**STEERED), state, 500)
    away = place(state, found) - place(reference(), reference())
    np.testing.assert_allclose(np.linalg.norm(away), 0.01, atol=1e-5)
    np.testing.assert_allclose(found[0, 6:], reference()[0, 6:], atol=1e-6)


def test_the_way_there_has_the_bandwidth():
    steered, state = stage(**STEERED), off(x=0.001)
    flown(steered, reference(), 200)  # the correction has come, of nothing
    # link 1 hangs down by 0.1 m, joint 2 moves the hand up and down only: -0.01 rad do it
    first = flown(steered, state, 1)[0, 6] / -0.01
    assert first == pytest.approx(10.0 * PERIOD, rel=0.01)
    assert flown(steered, state, 24)[0, 6] / -0.01 == pytest.approx(1 - math.exp(-1.0), rel=0.03)


def test_rate_and_range_are_limits():
    found = flown(stage(**STEERED, hand_joint_rate=0.1), off(x=0.05), 200)
    assert np.abs(found[1, 6:]).max() == pytest.approx(0.1)
    assert np.abs(found[0, 6:] - reference()[0, 6:]).max() <= 0.1 * 200 * PERIOD + 1e-9
    steered, ahead = stage(**STEERED), reference()
    ahead[0, 7] = math.radians(120.0)  # the end of its range
    state = ahead.copy()
    state[0, 2] -= 0.03
    for _ in range(300):
        found = steered.update(state, ahead, True, False)
    assert found[0, 7] <= math.radians(120.0)


def test_saturated_torques_stop_it_and_a_lost_vehicle_too():
    steered, state = stage(**STEERED), off(x=0.02)
    there = flown(steered, state, 300)[0].copy()
    np.testing.assert_array_equal(flown(steered, off(x=0.04), 50, saturated=True)[0], there)
    np.testing.assert_allclose(flown(steered, off(x=0.3), 2000), reference(), atol=1e-9)
    lost = state.copy()
    lost[0, 0] = math.nan
    assert np.isfinite(flown(steered, lost, 10)).all()


def test_on_the_ground_it_fades_out():
    steered, state = stage(**STEERED), off(x=0.02)
    before = flown(steered, state, 300)[0, 6]
    after = flown(steered, state, 1, flying=False)[0, 6]
    assert abs(after) > 0.9 * abs(before)
    np.testing.assert_array_equal(flown(steered, state, 2000, flying=False), reference())


def test_near_a_singular_posture_it_fades_out_and_says_so():
    """A straight arm hangs: the hand cannot go up or down."""
    steered, state = stage(**STEERED), off(x=0.02)
    before = abs(flown(steered, state, 300)[0, 6])
    assert before > 0.1 and steered.fades == ""
    straight = reference()
    straight[0, 7] = 0.0
    beside = straight.copy()
    beside[0, 0] += 0.02
    for ticks, least in ((1, 0.9 * before), (2000, 0.0)):
        for _ in range(ticks):
            found = steered.update(beside, straight, True, False)
        assert abs(found[0, 6]) >= least
        assert steered.fades == "near a singular posture: hand_singular"
    np.testing.assert_array_equal(found, straight)
    assert abs(flown(steered, state, 300)[0, 6]) > 0.9 * before and steered.fades == ""


def test_it_says_why_it_fades_out_where_it_is_on():
    steered = stage(**STEERED)
    flown(steered, off(x=0.3), 1)
    assert steered.fades == "the hand is too far off: hand_error_max"
    flown(steered, off(), 1, flying=False)
    assert steered.fades == "on the ground, released, or in failsafe"
    without = stage()
    flown(without, off(x=0.3), 1)
    assert without.fades == ""


@pytest.mark.parametrize(("columns", "directions", "least"), [
    ([(0.3, 0.0, 0.4)], 1, 0.5),
    ([(0.3, 0.0, 0.0), (0.0, 0.0, 0.4)], 2, 0.24),  # sqrt(0.09 0.16 / 0.25)
    ([(0.3, 0.0, 0.0), (0.6, 0.0, 0.0)], 2, 0.0),
    ([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)], 3, math.sqrt(1.0 / 3.0)),
])  # fmt: skip
def test_the_hardest_direction_by_hand(columns, directions, least):
    jacobian = np.zeros((6, len(columns)))
    jacobian[:3] = np.array(columns).T
    assert hardest(squared(jacobian), directions) == pytest.approx(least, abs=1e-12)
