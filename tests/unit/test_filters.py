"""The estimator's filters on vectors, against closed forms and hand-worked numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from uam_control.estimation.filters import derivative_step, joint_step, low_pass_step


def test_derivative_of_a_ramp_is_its_slope():
    state, out = np.zeros((2, 1)), np.zeros(1)
    for k in range(400):
        derivative_step(np.array([0.7 * k * 0.004]), 10.0, 0.004, state, out)
    assert out[0] == pytest.approx(0.7, rel=1e-2)  # the input counts as held over a tick


def test_the_derivative_filter_is_critically_damped_with_its_corner():
    """x'' = -omega^2 (x - value) - 2 omega x', of which expm knows the solution."""
    omega, dt = 3.0, 0.2
    value = np.array([1.0, -2.0])
    state, out = np.array([[0.5, 0.25], [2.0, -1.0]]), np.zeros(2)
    offset = state - [value, [0.0, 0.0]]
    move = expm(np.array([[0.0, 1.0], [-omega * omega, -2.0 * omega]]) * dt)
    derivative_step(value, omega / (2.0 * math.pi), dt, state, out)
    np.testing.assert_allclose(state, move @ offset + [value, [0.0, 0.0]], rtol=1e-12)
    np.testing.assert_array_equal(out, state[1])


def test_low_pass_step_response_by_hand():
    # time constant 1 s; after ln 2 s half of the way is left
    state = np.array([2.0, -1.0])
    low_pass_step(np.array([4.0, 1.0]), 0.5 / math.pi, math.log(2.0), state)
    np.testing.assert_allclose(state, [3.0, 0.0], atol=1e-15)
    low_pass_step(np.array([0.0, 1.0]), 0.5 / math.pi, 2.0 * math.log(2.0), state)
    np.testing.assert_allclose(state, [0.75, 0.75])


def test_joint_observer_by_hand():
    # (3 + 5/2) * .1 < .8: one step
    # angle 1 + .1*2 = 1.2, seen .2 further; + 2*3*.1*.2 = 1.32
    # rate 2 + .1 (3^2*.2 + 5 (2.6 - 2)) = 2.48
    # second joint: 0, seen -1; 2*3*.1*(-1) = -.6; rate .1 (-9 + 5*1) = -.4
    state = np.array([[1.0, 0.0], [2.0, 0.0]])
    joint_step(np.array([1.4, -1.0]), np.array([2.6, 1.0]), 3.0, 5.0, 0.1, state)
    np.testing.assert_allclose(state, [[1.32, -0.6], [2.48, -0.4]])


@pytest.mark.parametrize("bandwidth", [1.0, 60.0, 125.0])
@pytest.mark.parametrize("weight", [0.0, 80.0, 200.0])
def test_the_joint_observer_is_stable_at_any_rate(bandwidth, weight):
    """An undivided step diverges below some 80 Hz with the usual gains."""
    for dt in (0.004, 0.008, 0.0125, 0.02, 0.05):
        state = np.array([[1.0], [0.0]])
        for _ in range(round(40.0 / dt)):
            joint_step(np.zeros(1), np.zeros(1), bandwidth, weight, dt, state)
        assert np.abs(state).max() < 1e-6


def test_the_joint_observer_follows_a_ramp_at_a_low_rate():
    state, dt = np.array([[0.0], [2.0]]), 0.05
    for k in range(1, 100):
        joint_step(np.array([2.0 * k * dt]), np.array([2.0]), 60.0, 80.0, dt, state)
        np.testing.assert_allclose(state, [[2.0 * k * dt], [2.0]], rtol=1e-12)
