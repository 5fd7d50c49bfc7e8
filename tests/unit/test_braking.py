"""The braking reference: begins in the vehicle's motion, keeps its bounds, comes to rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from uam_control.control.controllers import AT_REST, AttitudeController, PositionController
from uam_control.coordinates import ATTITUDE, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW, Z
from uam_control.maths.rotations import matrix_from_euler
from uam_control.mission import MissionParameters
from uam_control.mission.motion.braking import SHORTEST, Braking, Stop, present_motion
from uam_control.profiles.profile import load_profile
from uam_control.vehicle import GRAVITY

LIMITS = MissionParameters(joint_angle_hold=(2.0, 2.0), joint_effort_hold=(2.0, 2.0))
A, J = LIMITS.brake_acceleration, LIMITS.brake_jerk
DEEP = -1e3  # [m] ground that is far below


def within(size, dimensions):
    """Vectors whose norm is at most `size`."""
    one = st.floats(-1.0, 1.0)
    return st.tuples(*[one] * dimensions).map(
        lambda v: np.array(v) * size / max(1.0, float(np.linalg.norm(v)))
    )


STARTS = st.tuples(within(100.0, 2), within(6.0, 2), within(7.0, 2), within(30.0, 2)).map(np.array)


def states(speed, tilt, rates):
    """States (3, 8) that fly: bounds of speed [m/s], tilt [rad], body rates [rad/s]."""

    def made(flown):
        position, velocity, lean, yaw, spin, lift = flown
        state = np.zeros((3, 8))
        state[CHI, POSITION], state[CHI, ATTITUDE] = position, (lean[0], lean[1], yaw)
        state[CHI_DOT, POSITION], state[CHI_DOT, ATTITUDE] = velocity, spin
        axis = matrix_from_euler(state[CHI, ATTITUDE])[:, Z]
        state[CHI_DDOT, POSITION] = lift * GRAVITY * axis - np.array([0.0, 0.0, GRAVITY])
        return state

    parts = (within(3.0, 3), within(speed, 3), within(tilt, 2), st.floats(-3.1, 3.1))
    return st.tuples(*parts, within(rates, 3), st.floats(0.85, 1.15)).map(made)


STATES = states(6.0, np.radians(35.0), 3.0)


@given(STARTS)
def test_bounds_are_kept(start):
    stop = Stop(start, A, J)
    jerk = min(float(np.linalg.norm(start[3])), J / 2.0)
    run_out = 0.2 * jerk * stop.length / 2.5
    least = max(A, float(np.linalg.norm(start[2]))) + run_out
    times = np.linspace(0.0, stop.length, 100)
    found = np.array([stop.at(time) for time in times])
    np.testing.assert_allclose(stop.values(times), found[:, 0], atol=1e-9)
    norms = np.linalg.norm(found, axis=2)
    assert np.max(norms[:, 2]) <= least + 1e-9
    assert np.max(norms[:, 3]) <= J + 1e-9


@given(STARTS)
def test_it_begins_in_the_start_and_ends_at_rest(start):
    stop = Stop(start, A, J)
    begin, end = stop.at(0.0), stop.at(stop.length)
    np.testing.assert_allclose(begin[:3], start[:3], atol=1e-9)
    np.testing.assert_allclose(begin[4], 0.0, atol=1e-9)
    np.testing.assert_allclose(end, stop.at(stop.length + 100.0), atol=0.0)
    np.testing.assert_allclose(end[1:], 0.0, atol=0.0)
    before = stop.at(stop.length * (1.0 - 1e-9))
    np.testing.assert_allclose(before, end, atol=1e-4)


@given(STARTS)
def test_rows_are_derivatives_of_each_other_and_continuous_to_the_snap(start):
    stop, step = Stop(start, A, J), 1e-4
    steepest = np.max(np.abs([stop.at(t)[4] for t in np.linspace(0.0, stop.length, 200)]))
    for time in np.linspace(0.01, stop.length + 0.05, 20):
        before, now, after = (stop.at(time + k * step) for k in (-1, 0, 1))
        np.testing.assert_allclose((after - before)[:3] / (2 * step), now[1:4], atol=2e-3)
        assert np.max(np.abs((after - before)[3])) < 0.1, "the jerk has no step"
        assert np.max(np.abs((after - before)[4])) <= 0.02 * steepest + 1e-9, "nor has the snap"


def test_a_straight_brake_by_hand():
    """2 m/s within 2 m/s^2: 2.1875 * 2 / 2 = 2.1875 s; the way is half of 2 m/s times that.

    There is no acceleration to fade: the fade is the shortest, and moves nothing.
    """
    start = np.array([[1.0], [2.0], [0.0], [0.0]])
    stop = Stop(start, 2.0, 16.0)
    assert stop.length == pytest.approx(2.1875)
    half, end = stop.at(2.1875 / 2), stop.at(3.0)
    assert half[:3, 0] == pytest.approx([1.0 + 2.0 * 2.1875 * 221 / 512, 1.0, -2.0])
    assert end[:, 0] == pytest.approx([3.1875, 0.0, 0.0, 0.0, 0.0])


def test_a_fade_by_hand():
    """4 m/s^2 with half of 16 m/s^3: 4 / 8 * 3.6465 = 1.8233 s, then 3.6465 m/s are left."""
    stop = Stop(np.array([[0.0], [0.0], [4.0], [0.0]]), 2.0, 16.0)
    fade = 0.5 * 3.6465
    assert stop.length == pytest.approx(max(2.5 * fade, 2.1875 * 2.0 * fade / 2.0))
    part = 0.5 * fade / stop.length
    brake = 2.0 * fade / stop.length * 140.0 * (part * (1.0 - part)) ** 3
    assert stop.at(fade / 2)[2, 0] == pytest.approx(2.0 - brake)


@given(STATES)
def test_the_first_desired_attitude_thrust_and_rates_are_the_present_ones(state):
    """The force of the reference's acceleration points along the thrust axis, with its length;
    its jerk turns it as the body rates do."""
    motion = present_motion(state, 9.81)
    force = motion[CHI_DDOT, POSITION] + np.array([0.0, 0.0, GRAVITY])
    present = state[CHI_DDOT, POSITION] + np.array([0.0, 0.0, GRAVITY])
    np.testing.assert_allclose(force, present, atol=1e-9)
    rotation = matrix_from_euler(state[CHI, ATTITUDE])
    turned = np.cross(rotation @ state[CHI_DOT, ATTITUDE], rotation[:, Z])
    np.testing.assert_allclose(motion[3, POSITION] / np.linalg.norm(force), turned, atol=1e-9)
    np.testing.assert_array_equal(motion[CHI_DOT, POSITION], state[CHI_DOT, POSITION])


@pytest.fixture(scope="module")
def laws():
    sets = load_profile("s500").sets
    names = "position_controller", "attitude_controller"
    kinds = PositionController, AttitudeController
    return tuple(kind(sets[name]) for kind, name in zip(kinds, names, strict=True))


@given(states(6.0, np.radians(18.0), 2.0))
def test_the_laws_begin_without_a_step_in_attitude_and_thrust(laws, state):
    """Within the law's largest tilt: the first force is mass times lift along the thrust axis, the
    desired attitude and rates are the present ones, and the torque is small."""
    assume(np.max(np.abs(state[CHI_DOT, POSITION])) > 2.0 * AT_REST)
    position, attitude = laws
    reference, level = np.zeros((3, 8)), np.zeros((3, 3))
    position.update(state, reference, False, 0.004)
    attitude.update(state, reference, level, False, 0.004)
    Braking(0.0, state, LIMITS, DEEP).write(0.0, reference)
    tau_p = position.update(state, reference, True, 0.004)
    p = position.parameters
    force = p.inertia[0] * reference[CHI_DDOT, POSITION]
    force[Z] += p.gravity_feedforward_mass * p.gravity
    force += p.gravity_feedforward_mass * np.array(p.drag_feedforward) * reference[1, POSITION]
    np.testing.assert_allclose(tau_p, force, atol=1e-6)
    desired = position.attitude_reference
    np.testing.assert_allclose(desired[CHI], state[CHI, ATTITUDE], atol=0.03)
    np.testing.assert_allclose(desired[CHI_DOT], state[CHI_DOT, ATTITUDE], atol=0.1)
    tau_q = attitude.update(state, reference, desired, True, 0.004)
    assert np.max(np.abs(tau_q)) < 0.5, "a third of the largest torque"


@given(STATES, st.floats(0.004, 0.02))
def test_the_reference_of_the_next_tick_is_where_the_vehicle_will_be(state, age):
    reference = np.zeros((3, 8))
    Braking(10.0, state, LIMITS, DEEP).write(10.0 + age, reference)
    expected = state[:2, POSITION].copy()
    expected[0] += age * state[CHI_DOT, POSITION] + age**2 / 2 * state[CHI_DDOT, POSITION]
    expected[1] += age * state[CHI_DDOT, POSITION]
    np.testing.assert_allclose(reference[CHI, POSITION], expected[0], atol=1e-3)
    np.testing.assert_allclose(reference[CHI_DOT, POSITION], expected[1], atol=0.02)


@given(STATES)
def test_it_stays_at_rest_with_all_derivatives_up_to_the_snap(state):
    motion, braking = np.ones((5, 8)), Braking(10.0, state, LIMITS, DEEP)
    braking.write(braking.end + 5.0, motion)
    np.testing.assert_array_equal(motion[1:, :6], 0.0)
    np.testing.assert_array_equal(motion[0, 3:5], 0.0)
    np.testing.assert_array_equal(motion[:, 6:], 1.0)
    first = np.zeros((5, 8))
    braking.write(10.0, first)
    np.testing.assert_allclose(first[CHI, [0, 1, 2, 5]], state[CHI, [0, 1, 2, 5]], atol=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(-2.0, 2.0))
def test_a_turn_ends_within_its_bounds(yaw, rate):
    state = np.zeros((3, 8))
    state[CHI, YAW], state[CHI_DOT, YAW] = yaw, rate
    braking, motion = Braking(0.0, state, LIMITS, DEEP), np.zeros((5, 8))
    for time in np.linspace(0.0, braking.end, 40):
        braking.write(time, motion)
        assert abs(motion[2, YAW]) <= LIMITS.brake_yaw_acceleration + 1e-9
        assert abs(motion[3, YAW]) <= LIMITS.brake_yaw_jerk + 1e-9
    braking.write(0.0, motion)
    assert motion[:2, YAW] == pytest.approx([yaw, rate])


@given(st.floats(0.1, 3.0), st.floats(-3.0, 0.0), st.floats(-3.0, 3.0))
def test_a_sinking_vehicle_keeps_half_of_its_height(height, rate, acceleration):
    """Unless it takes less than 0.3 s: then it loses at most what it sinks in that time."""
    state = np.zeros((3, 8))
    state[CHI, Z], state[CHI_DOT, Z] = 0.28 + height, rate
    state[CHI_DDOT, Z] = acceleration
    braking, reference = Braking(0.0, state, LIMITS, 0.28), np.zeros((3, 8))
    lowest = np.inf
    for time in np.linspace(0.0, braking.end, 60):
        braking.write(time, reference)
        lowest = min(lowest, reference[CHI, Z])
    least = 0.28 + height / 2.0
    assert lowest >= min(least, 0.28 + height + SHORTEST * (rate - 0.6)) - 0.02


def test_derivatives_that_are_not_finite_count_as_zero():
    state = np.zeros((3, 8))
    state[CHI_DOT:] = np.nan
    np.testing.assert_array_equal(present_motion(state, 9.81)[1], 0.0)
    assert np.isfinite(present_motion(state, 9.81)).all()
