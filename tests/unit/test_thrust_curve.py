"""Thrust curve: inverse, monotone, hover of the 2.2 kg vehicle by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.setpoints.thrust_curve import (
    command_of_thrust,
    curve,
    inverse_curve,
    thrust_of_command,
    thrust_slope,
)

factors = st.floats(0.0, 1.0)
unit = st.floats(0.0, 1.0)
FULL = 4 * 10.34


def test_ends_of_every_curve():
    for factor in (0.0, 0.3, 1.0):
        assert curve(factor, 0.0) == 0.0 and curve(factor, 1.0) == 1.0
        assert inverse_curve(factor, 0.0) == 0.0 and inverse_curve(factor, 1.0) == pytest.approx(1)


def test_hand_worked():
    assert curve(0.3, 0.5) == pytest.approx(0.425)  # 0.3 0.25 + 0.7 0.5
    assert inverse_curve(1.0, 0.25) == pytest.approx(0.5)
    assert inverse_curve(0.5, 0.75) == pytest.approx((math.sqrt(7.0) - 1.0) / 2.0)


def test_matched_pair_is_proportional():
    hover = 2.2 * 9.81
    assert command_of_thrust(hover, FULL, 1.0, 0.3, 0.3) == pytest.approx(hover / FULL)
    assert command_of_thrust(hover, FULL, 0.8, 0.3, 0.3) == pytest.approx(hover / FULL / 0.8)


def test_no_model_in_the_autopilot_sends_the_motor_command():
    # THR_MDL_FAC = 0: s is the motor command itself
    s = command_of_thrust(0.25 * FULL, FULL, 1.0, 1.0, 0.0)
    assert s == pytest.approx(0.5)


@given(factors, unit)
def test_inverse(factor, u):
    assert inverse_curve(factor, curve(factor, u)) == pytest.approx(u, abs=1e-7)


@given(factors, factors, st.floats(0.2, 1.5), unit)
def test_newtons_come_back(motor, model, battery, share):
    newtons = share * FULL * battery
    command = command_of_thrust(newtons, FULL, battery, motor, model)
    assert 0.0 <= command <= 1.0
    assert thrust_of_command(command, FULL, battery, motor, model) == pytest.approx(
        newtons, abs=1e-6
    )


@given(factors, factors, unit, unit)
def test_monotone(motor, model, a, b):
    low, high = sorted((a, b))
    if high - low > 1e-6:
        assert command_of_thrust(low * FULL, FULL, 1.0, motor, model) < command_of_thrust(
            high * FULL, FULL, 1.0, motor, model
        )


@given(st.floats(0.0, 0.9), st.floats(0.0, 0.9), st.floats(0.1, 0.9))
def test_slope_is_the_derivative(motor, model, command):
    step = 1e-6
    difference = (
        thrust_of_command(command + step, FULL, 1.0, motor, model)
        - thrust_of_command(command - step, FULL, 1.0, motor, model)
    ) / (2 * step)
    assert thrust_slope(command, FULL, 1.0, motor, model) == pytest.approx(difference, rel=1e-4)


def test_slope_by_hand():
    # u = .4: s = .25*.16 + .75*.4 = .34; motor .5 + 2*.5*.4 = .9, model .75 + 2*.25*.4 = .95
    assert thrust_slope(0.34, 40.0, 0.5, 0.5, 0.25) == pytest.approx(40.0 * 0.5 * 0.9 / 0.95)
    # a slope of 0 counts as 0.001
    assert thrust_slope(0.0, 40.0, 0.5, 1.0, 0.0) == pytest.approx(0.02)
    assert thrust_slope(0.0, 40.0, 0.5, 0.0, 1.0) == pytest.approx(20_000.0)


def test_outside_is_clamped():
    assert [curve(0.3, u) for u in (-1.0, 2.0)] == [0.0, 1.0]
    assert [inverse_curve(0.3, y) for y in (-1.0, 2.0)] == [0.0, 1.0]
    assert command_of_thrust(-5.0, FULL, 1.0, 0.3, 0.3) == 0.0
    assert command_of_thrust(100.0, FULL, 1.0, 0.3, 0.3) == pytest.approx(1.0)
