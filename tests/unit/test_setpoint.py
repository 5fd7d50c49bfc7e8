"""tau → body rates and thrust: hand-worked values, and the inversion of the autopilot's P path."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.maths.rotations import matrix_from_euler
from uam_control.setpoints.rate_thrust_map import (
    INPUTS,
    RateThrustMap,
    RateThrustParameters,
    SetpointRefused,
)
from uam_control.setpoints.thrust_curve import thrust_of_command
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description

ZERO = np.zeros(3)
VEHICLE = load_description()
HOVER = np.array([0.0, 0.0, 2.2 * 9.81])
angle = st.floats(-0.6, 0.6)


def test_hover():
    rates, thrust = RateThrustMap().map(HOVER, ZERO, ZERO, ZERO)
    assert rates == pytest.approx(ZERO)
    assert thrust == pytest.approx(2.2 * 9.81 / (4 * 10.34))


def test_rates_by_hand():
    # 0.5 N m / (5.0011 N m * 0.15) on top of 0.1 rad/s
    rates, _ = RateThrustMap().map(HOVER, np.array([0.5, 0.0, 0.0]), ZERO, np.array([0.1, 0, 0]))
    assert rates[0] == pytest.approx(0.1 + 0.5 / (4 * math.sqrt(0.5) * 10.34 * 0.171 * 0.15))
    assert rates[1:] == pytest.approx([0.0, 0.0])


@given(angle, angle, st.floats(-3.0, 3.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_thrust_is_the_share_along_the_thrust_axis(roll, pitch, yaw, fx, fy):
    attitude = np.array([roll, pitch, yaw])
    tau_p = np.array([fx, fy, 20.0])
    _, thrust = RateThrustMap().map(tau_p, ZERO, attitude, ZERO)
    along = min(40.0, max(1.0, tau_p @ matrix_from_euler(attitude)[:, 2]))
    assert thrust * 4 * 10.34 == pytest.approx(along)


@given(*[st.floats(-0.3, 0.3)] * 3, *[st.floats(-0.5, 0.5)] * 3)
def test_proportional_path_of_the_autopilot_gives_the_torque_back(r, p, y, wx, wy, wz):
    """S K P (omega_sp - omega) = tau_q with gains and geometry of the autopilot."""
    parameters = RateThrustParameters.of(VEHICLE, {"rate_k": (1.2, 0.8, 1.0)})
    tau_q, omega = np.array([r, p, y / 10]), np.array([wx, wy, wz])
    rates, _ = RateThrustMap(parameters).map(HOVER, tau_q, ZERO, omega)
    gain = (
        np.array(parameters.rate_p) * np.array(parameters.rate_k) * parameters.torque_scale(VEHICLE)
    )
    assert gain * (rates - omega) == pytest.approx(tau_q, abs=1e-12)


def test_a_throttle_per_newton_replaces_the_thrust_curve():
    values = {"throttle_per_newton": 0.06, "thrust_max": 12.0}
    m = RateThrustMap(RateThrustParameters.of(VEHICLE, values | {"thr_mdl_fac": 0.0}))
    tau_p, tilted = np.array([3.0, -2.0, 6.0]), np.array([0.5, -0.4, 1.0])
    for attitude in (ZERO, tilted):  # the norm is 7 N for every attitude
        assert m.map(tau_p, ZERO, attitude, ZERO)[1] == pytest.approx(0.42)
    m.thrust_factor = 0.5  # of the thrust curve, which does not act
    assert m.map(tau_p, ZERO, ZERO, ZERO)[1] == pytest.approx(0.42)
    assert m.map(3.0 * tau_p, ZERO, ZERO, ZERO)[1] == pytest.approx(0.72)  # 12 N at most


def test_a_throttle_per_newton_is_the_motor_command_whatever_the_autopilots_model():
    m = RateThrustMap(RateThrustParameters.of(VEHICLE, {"throttle_per_newton": 0.06}))
    # THR_MDL_FAC 0.3: 0.3 * 0.6^2 + 0.7 * 0.6
    thrust = m.map(np.array([0.0, 0.0, 10.0]), ZERO, ZERO, ZERO)[1]
    assert thrust == pytest.approx(0.528)


def test_limits():
    m = RateThrustMap(RateThrustParameters.of(VEHICLE, {"command_max": 0.9}))
    rates, thrust = m.map(np.array([0.0, 0.0, 1e6]), np.array([1e6, -1e6, 1e6]), ZERO, ZERO)
    assert rates == pytest.approx([6.0, -6.0, 3.0])
    assert thrust == pytest.approx(0.9)
    _, thrust = m.map(np.array([0.0, 0.0, -50.0]), ZERO, ZERO, ZERO)
    assert thrust == pytest.approx(1.0 / (4 * 10.34))


def test_slope_of_an_unmatched_thrust_model_scales_the_rates():
    """With f = 1 and no model in the autopilot a rotor's thrust is u^2: slope 2u."""
    parameters = RateThrustParameters.of(VEHICLE, {"motor_curve_factor": 1.0, "thr_mdl_fac": 0.0})
    m = RateThrustMap(parameters)
    quarter = np.array([0.0, 0.0, 10.34])  # u = 0.5, slope 1
    at_slope_1 = m.map(quarter, np.array([0.1, 0.0, 0.0]), ZERO, ZERO)[0].copy()
    sixteenth = np.array([0.0, 0.0, 10.34 / 4])  # u = 0.25, slope 0.5
    at_slope_half = m.map(sixteenth, np.array([0.1, 0.0, 0.0]), ZERO, ZERO)[0].copy()
    assert at_slope_half[0] == pytest.approx(2.0 * at_slope_1[0])


def test_battery_and_thrust_factor_scale_what_full_thrust_is():
    m = RateThrustMap(RateThrustParameters.of(VEHICLE, {"battery_factor": 0.8}))
    plain = m.map(HOVER, np.array([0.3, 0.0, 0.0]), ZERO, ZERO)[0].copy()
    m.thrust_factor = 0.75
    rates, thrust = m.map(HOVER, np.array([0.3, 0.0, 0.0]), ZERO, ZERO)
    assert m.thrust_factor == 0.75
    assert thrust == pytest.approx(2.2 * 9.81 / (4 * 10.34 * 0.6))
    assert rates == pytest.approx(plain / 0.75)
    assert thrust_of_command(0.5, *m.curve) == pytest.approx(
        0.5 * 4 * 10.34 * 0.8
    )  # without the factor
    assert m.scaled(0.25, 1.5) == pytest.approx(0.375)  # the motors' curve is a straight line


@pytest.mark.parametrize("factor", [0.0, -0.5, math.nan, math.inf, -math.inf])
def test_a_thrust_factor_that_is_not_a_positive_number_is_refused(factor):
    m = RateThrustMap()
    m.thrust_factor = 0.75
    with pytest.raises(ValueError, match="is not a positive number"):
        m.thrust_factor = factor
    assert m.thrust_factor == 0.75
    assert m.map(HOVER, ZERO, ZERO, ZERO)[1] == pytest.approx(2.2 * 9.81 / (4 * 10.34 * 0.75))


def test_no_thrust_is_a_setpoint_too():
    m = RateThrustMap(RateThrustParameters.of(VEHICLE, {"thrust_min": 0.0}))
    _, thrust = m.map(np.array([0.0, 0.0, -1.0]), ZERO, ZERO, ZERO)
    assert thrust == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("which", range(12))
def test_what_is_not_finite_is_refused_by_name(which, bad):
    values = [HOVER.copy(), ZERO.copy(), ZERO.copy(), ZERO.copy()]
    values[which // 3][which % 3] = bad
    m = RateThrustMap()
    m.rates[:] = 7.0
    with pytest.raises(SetpointRefused, match=INPUTS[which]):
        m.map(*values)
    assert np.all(m.rates == 7.0)


def test_wrong_parameters_leave_the_old_ones():
    m = RateThrustMap()
    with pytest.raises(ParameterError, match="rate_limit"):
        m.configure(replace(m.parameters, rate_limit=(0.0, 1.0, 1.0)))
    assert m.parameters.rate_limit == (6.0, 6.0, 3.0)
    assert m.map(HOVER, np.array([9.9, 0, 0]), ZERO, ZERO)[0][0] == pytest.approx(6.0)
