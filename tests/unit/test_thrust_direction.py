"""The attitude that points the thrust along tau_p, against hand-worked numbers.

Angles are those of the 3-4-5 triangle: A has cosine 0.8 and sine 0.6, B the other way round.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from uam_control.control.thrust_direction import AttitudeReference, attitude_reference_step
from uam_control.maths.rotations import matrix_from_euler

A, B = math.atan2(0.6, 0.8), math.atan2(0.8, 0.6)
ONE = 0.5 / math.pi  # [Hz] corner of the filter whose omega is 1 rad/s
# 5 N; with yaw = A its share to the right is .6*4.36 + .8*.48 = 3, hence sin roll = .6, and its
# share forward .8*4.36 - .6*.48 = 3.2, hence tan pitch = 3.2/2.4 = .8/.6
TAU = np.array([4.36, -0.48, 2.4])


def step(filtered, tau=TAU, yaw=(A, 0.0, 0.0), cutoff=ONE, dt=0.0):
    """Advance the filter rows (roll, pitch), each (angle, rate); return them and q_d with rates."""
    reference, state, value = np.zeros((3, 8)), np.array(filtered), np.full((3, 3), 77.0)
    reference[:, 5] = yaw
    attitude_reference_step(np.array(tau), reference, cutoff, dt, state, np.zeros(2), value)
    return state, value


def test_it_points_the_thrust_along_tau():
    state, value = step([[A, 0.0], [B, 0.0]], dt=0.5)  # already there: nothing moves
    np.testing.assert_allclose(state, [[A, 0.0], [B, 0.0]], atol=1e-15)
    np.testing.assert_allclose(value, [[A, B, A], [0.0] * 3, [0.0] * 3], atol=1e-14)


@pytest.mark.parametrize(("tau", "roll", "pitch"), [
    ((0.0, 0.0, 9.0), 0.0, 0.0),
    ((3.0, 0.0, 4.0), 0.0, A),  # forward: nose down
    ((0.0, 3.0, 4.0), -A, 0.0),  # to the left: left side down
    ((0.0, -4.0, 3.0), B, 0.0),
])  # fmt: skip
def test_signs_with_the_nose_to_the_east(tau, roll, pitch):
    state, _ = step(np.zeros((2, 2)), tau, yaw=(0.0, 0.0, 0.0), dt=60.0)
    np.testing.assert_allclose(state, [[roll, 0.0], [pitch, 0.0]], atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_share_that_is_rounded_above_one_is_a_quarter_turn(sign):
    """Its sine is 1.0000000000000002 for this yaw."""
    yaw = -0.303 if sign > 0.0 else -0.328
    tau = sign * 3.0 * math.sin(yaw), -sign * 3.0 * math.cos(yaw), 1e-9
    state, _ = step(np.zeros((2, 2)), tau, yaw=(yaw, 0.0, 0.0), dt=60.0)
    assert state[0, 0] == pytest.approx(sign * math.pi / 2.0)


def test_the_filter_is_critically_damped_with_its_corner():
    """x'' = -omega^2 (x - target) - 2 omega x', of which expm knows the solution."""
    omega, dt = 4.0, 0.3
    start = np.array([[0.1, 0.3], [-0.2, 0.5]])
    state, _ = step(start, cutoff=2.0 / math.pi, dt=dt)
    move = expm(np.array([[0.0, 1.0], [-omega * omega, -2.0 * omega]]) * dt)
    target = np.array([[A, 0.0], [B, 0.0]])
    np.testing.assert_allclose(state, (move @ (start - target).T).T + target, rtol=1e-12)


def test_body_rates_of_yawing_by_hand():
    # sin roll .6, cos roll .8, sin pitch .8, cos pitch .6; yaw rate 2, its derivative 5
    _, value = step([[A, 0.0], [B, 0.0]], yaw=(A, 2.0, 5.0))
    np.testing.assert_allclose(value[1], [-0.8 * 2.0, 0.36 * 2.0, 0.48 * 2.0])
    np.testing.assert_allclose(value[2], [-0.8 * 5.0, 0.36 * 5.0, 0.48 * 5.0], atol=1e-14)


def test_body_rates_of_tilting_and_yawing_and_their_derivatives_by_hand():
    # as above, with roll rate 1 and pitch rate 2: omega = 1 makes their derivatives -2 and -4
    _, value = step([[A, 1.0], [B, 2.0]], yaw=(A, 2.0, 5.0))
    # (1 - 1.6, .8*2 + .72, -.6*2 + .96)
    np.testing.assert_allclose(value[1], [-0.6, 2.32, -0.24])
    # x: -2 - .8*5 - .6*2*2
    # y: .8*(-4) + .36*5 - .6*1*2 + (.48*1 - .48*2)*2
    # z: .6*4 + .48*5 - .8*1*2 - (.36*1 + .64*2)*2
    np.testing.assert_allclose(value[2], [-8.4, -3.56, -0.08])


def test_the_derivatives_take_the_way_that_is_left_into_account():
    # omega = 2: rolls from rest with 4 (A - .5), pitches with -4*(.25) - 2*2*.5
    _, value = step([[0.5, 0.0], [B + 0.25, 0.5]], yaw=(A, 0.0, 0.0), cutoff=2.0 * ONE)
    pitch_acceleration = -1.0 - 2.0
    cr, sr = math.cos(0.5), math.sin(0.5)
    expected = [4.0 * (A - 0.5), cr * pitch_acceleration, -sr * pitch_acceleration]
    np.testing.assert_allclose(value[2], expected)
    np.testing.assert_allclose(value[1], [0.0, cr * 0.5, -sr * 0.5])


def updated(attitude, tau, reference, dt, cutoff=1.0):
    """Advance an `AttitudeReference` by dt [s]; return its value."""
    own = attitude.filter, attitude.lead, attitude.value
    attitude_reference_step(np.array(tau), reference, cutoff, dt, *own)
    return attitude.value


@given(st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(5, 30)), st.floats(-3, 3))
def test_settled_attitude_reference_points_the_thrust_along_tau(tau, yaw):
    reference = np.zeros((3, 8))
    reference[0, 5] = yaw
    filtered = AttitudeReference()
    for _ in range(400):
        value = updated(filtered, tau, reference, 0.02, cutoff=5.0)
    axis = matrix_from_euler(value[0])[:, 2]
    np.testing.assert_allclose(axis, np.array(tau) / np.linalg.norm(tau), atol=1e-6)
    np.testing.assert_allclose(value[1:], 0.0, atol=1e-4)


def test_attitude_reference_rates_are_derivatives():
    """Omega_d and its derivative against finite differences of R_d, while yawing and tilting."""
    filtered, step = AttitudeReference(), 1e-4
    reference = np.zeros((3, 8))
    rotations, rates, accelerations = [], [], []
    for k in range(3000):
        t = k * step
        reference[:, 5] = 0.5 * np.sin(t), 0.5 * np.cos(t), -0.5 * np.sin(t)
        tau = [3 * np.sin(2 * t), 2 * np.cos(3 * t), 20.0]
        value = updated(filtered, tau, reference, step, cutoff=2.0)
        rotations.append(matrix_from_euler(value[0]))
        rates.append(value[1].copy())
        accelerations.append(value[2].copy())
    k = 2500
    skew = rotations[k].T @ (rotations[k + 1] - rotations[k - 1]) / (2 * step)
    np.testing.assert_allclose([skew[2, 1], skew[0, 2], skew[1, 0]], rates[k], atol=2e-3)
    np.testing.assert_allclose(
        (rates[k + 1] - rates[k - 1]) / (2 * step), accelerations[k], atol=2e-2
    )


def test_reset_is_level_at_a_yaw_and_at_rest():
    filtered = AttitudeReference()
    np.testing.assert_array_equal(filtered.value, np.zeros((3, 3)))
    reference = np.zeros((3, 8))
    reference[:, 5] = 0.1, 0.2, 0.3
    first = updated(filtered, TAU, reference, 0.1, ONE).copy()
    assert np.all(first != 0.0)
    updated(filtered, TAU, reference, 0.1, ONE)
    filtered.reset(0.7)
    np.testing.assert_array_equal(filtered.value, [[0.0, 0.0, 0.7], [0.0] * 3, [0.0] * 3])
    np.testing.assert_array_equal(updated(filtered, TAU, reference, 0.1, ONE), first)


@given(
    st.tuples(*[st.floats(-0.6, 0.6)] * 2, st.floats(-3.1, 3.1)),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.tuples(*[st.floats(-9.0, 9.0)] * 2, st.floats(5.0, 30.0)),
)
def test_a_vehicle_in_motion_begins_with_its_attitude_rates_and_no_torque(euler, rates, tau):
    """Whatever tau_p desires; the difference decays, until the thrust points along tau_p."""
    state, reference, filtered = np.zeros((3, 8)), np.zeros((3, 8)), AttitudeReference()
    state[0, 3:6], state[1, 3:6] = euler, rates
    filtered.reset(euler[2])
    filtered.begin(state, np.zeros((3, 8)))
    roll, pitch, _ = euler
    yaw_rate = (math.sin(roll) * rates[1] + math.cos(roll) * rates[2]) / math.cos(pitch)
    reference[0, 5], reference[1, 5] = euler[2], yaw_rate
    value = updated(filtered, tau, reference, 1e-6, 2.0)
    np.testing.assert_allclose(value[0], euler, atol=1e-5)
    np.testing.assert_allclose(value[1], rates, atol=1e-4)
    coupling = np.linalg.norm(rates) ** 2  # of the Euler rates: zero without rotation
    assert np.max(np.abs(value[2])) < 3.0 * coupling + 1e-3
    reference[1, 5] = 0.0
    for _ in range(1000):
        value = updated(filtered, tau, reference, 0.01, 2.0)
    axis = matrix_from_euler(value[0])[:, 2]
    np.testing.assert_allclose(axis, np.array(tau) / np.linalg.norm(tau), atol=1e-6)


def test_the_attitude_of_the_reference_passes_without_the_filter():
    """tau_p along the reference's own force: no correction, only the reference."""
    attitude, reference = AttitudeReference(), np.zeros((3, 8))
    reference[:, 4] = 0.3, 0.5, -2.0
    tau_p = np.array([math.sin(0.3), 0.0, math.cos(0.3)]) * 20.0
    attitude.reset(0.0)
    for _ in range(3):
        value = updated(attitude, tau_p, reference, 0.004)
    np.testing.assert_allclose(value[:, 1], [0.3, 0.5, -2.0], atol=1e-12)
    np.testing.assert_allclose(value[:, [0, 2]], 0.0, atol=1e-12)


def test_near_a_quarter_turn_of_pitch_the_euler_rates_stay_bounded():
    """cos pitch = .05 counts as .1: the roll rate of a yaw rate of 2 is 2 sin pitch / .1."""
    attitude, state = AttitudeReference(), np.zeros((3, 8))
    pitch = math.acos(0.05)
    state[0, 4], state[1, 5] = pitch, 2.0
    attitude.begin(state, np.zeros((3, 8)))
    value = updated(attitude, [0.0, 0.0, 9.0], np.zeros((3, 8)), 0.0)
    assert value[1, 0] == pytest.approx(20.0 * math.sin(pitch))


def test_the_correction_is_what_the_reference_lacks_of_the_direction():
    reference, filtered, value = np.zeros((3, 8)), np.zeros((2, 2)), np.zeros((3, 3))
    reference[0, 3:6] = A, B, A  # the attitude of TAU
    attitude_reference_step(TAU, reference, ONE, 0.5, filtered, np.zeros(2), value)
    np.testing.assert_allclose(filtered, 0.0, atol=1e-14)
    np.testing.assert_allclose(value[0], [A, B, A])
