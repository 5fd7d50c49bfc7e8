"""Limits of force and torque against hand-worked numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from uam_control.control.around_law import RotorLead, lead_force
from uam_control.control.output_limits import (
    ForceCompletion,
    PositionLimits,
    complete_and_limit,
    integrate,
    limit_force,
    limit_torque,
    wash_out,
)
from uam_control.settings.parameter_set import ParameterError

A = math.atan2(0.6, 0.8)  # tan A = .75
NO_TILT_LIMIT = 1.5  # its tangent is 14


@pytest.mark.parametrize(("tau", "thrust_max", "tilt_max", "expected", "cut"), [
    ((3.0, 4.0, 10.0), 100.0, A, (3.0, 4.0, 15.0), False),
    ((3.0, -4.0, -1.0), 100.0, A, (1.8, -2.4, 4.0), True),  # .75*4 = 3 of 5 to the side
    ((-3.0, 4.0, -1.0), 5.0, NO_TILT_LIMIT, (-1.8, 2.4, 4.0), True),  # sqrt(25 - 16) = 3 of 5
    ((0.0, 0.0, 95.0), 100.0, A, (0.0, 0.0, 100.0), False),  # up to the limit, not beyond
    ((3.0, 4.0, 200.0), 100.0, A, (3.0, 4.0, math.sqrt(9975.0)), True),  # 5 N to the side remain
    ((60.0, 80.0, 200.0), 100.0, A, (12.0, 16.0, math.sqrt(9600.0)), True),  # altitude, but 20 N
    ((3.0, 4.0, 93.0), 100.0, A, (3.0, 4.0, 98.0), False),
    ((0.0, 0.0, 200.0), 100.0, A, (0.0, 0.0, 100.0), True),
    ((0.0, 0.0, -50.0), 100.0, A, (0.0, 0.0, 2.0), True),
    ((0.5, 0.0, -3.0), 100.0, A, (0.5, 0.0, 2.0), False),  # 2 N desired, the least
    ((3.0, 4.0, 10.0), 2.0, NO_TILT_LIMIT, (0.0, 0.0, 2.0), True),  # the least is the largest
])  # fmt: skip
def test_force_by_hand(tau, thrust_max, tilt_max, expected, cut):
    """With a weight of 5 N and 2 N upwards at least."""
    limited, none = np.full(3, 77.0), np.zeros(3)
    limits = ForceCompletion(none, none, none, 0.0, 0.0, 5.0, 2.0, thrust_max, tilt_max)
    assert limit_force(np.array(tau), limits, limited) == cut
    np.testing.assert_allclose(limited, expected, atol=1e-12)


@pytest.mark.parametrize(("largest", "expected", "made", "cut"), [
    (50.0, (0.0, 22.5, 30.0), 20.0, False),  # 10 + 0.1/0.05 (20 - 10), half a lag later: 20
    (30.0, (0.0, 18.0, 24.0), 17.0, True),  # 30 of the 37.5 N wanted; 10 + (24 - 10)/2
])  # fmt: skip
def test_lead_of_rotors_by_hand(largest, expected, made, cut):
    tau, lead = np.array([0.0, 15.0, 20.0]), RotorLead(0.1, 0.05, np.array([10.0]))
    assert lead_force(lead, 2.0, largest, 0.1 * math.log(2.0), tau) == cut
    np.testing.assert_allclose(tau, expected)
    np.testing.assert_allclose(lead.made, made)


def test_lead_of_rotors_towards_less_keeps_the_least_thrust():
    tau, lead = np.array([0.0, 0.0, 5.0]), RotorLead(0.1, 0.05, np.array([10.0]))
    assert lead_force(lead, 2.0, 50.0, 0.004, tau)  # 10 - 2*5 = 0 is wanted
    np.testing.assert_allclose(tau, [0.0, 0.0, 2.0])


def test_without_a_lead_and_at_first_the_force_stays():
    for response, made in (0.0, 10.0), (0.05, math.nan):
        tau = np.array([0.0, 15.0, 20.0])
        assert not lead_force(RotorLead(0.1, response, np.array([made])), 2.0, 50.0, 0.004, tau)
        np.testing.assert_array_equal(tau, [0.0, 15.0, 20.0])


@pytest.mark.parametrize(("tau", "expected", "cut"), [
    ((0.5, -2.0, 3.0), (0.5, -2.0, 3.0), False),
    ((5.0, 0.5, 0.5), (1.0, 0.5, 0.5), True),
    ((0.5, -5.0, 0.5), (0.5, -2.0, 0.5), True),
    ((0.5, 0.5, -3.5), (0.5, 0.5, -3.0), True),
])  # fmt: skip
def test_torque_by_hand(tau, expected, cut):
    limited = np.full(3, 77.0)
    assert limit_torque(np.array(tau), np.array([1.0, 2.0, 3.0]), limited) == cut
    np.testing.assert_array_equal(limited, expected)


def test_a_least_thrust_above_the_largest_is_refused():
    same = replace(PositionLimits(), thrust_min=7.0, thrust_max=7.0)
    assert same.validated() == same
    with pytest.raises(ParameterError, match="thrust_min: 7.5 N is above thrust_max, 7 N"):
        replace(same, thrust_min=7.5).validated()


def test_wash_out_by_hand():
    """Half of the difference to the slow part goes into it in ln 2 of time; corner 0: nothing."""
    feedforward, slow = np.array([8.0, 4.0]), np.array([2.0, 0.0])
    wash_out(feedforward, np.array([2.0, 0.0]), math.log(2.0) / 2.0, slow)
    np.testing.assert_allclose(slow, [5.0, 0.0])
    np.testing.assert_allclose(feedforward, [3.0, 4.0])


def test_a_feedforward_that_has_lasted_is_washed_out_at_once():
    feedforward, slow = np.array([8.0, 4.0]), np.full(2, math.nan)
    wash_out(feedforward, np.array([2.0, 0.0]), 0.004, slow)
    np.testing.assert_array_equal(slow, [8.0, 0.0])
    np.testing.assert_array_equal(feedforward, [0.0, 4.0])


def test_integral_by_hand():
    integral = np.array([0.1, 0.2, 0.0])
    integrate(np.array([0.5, -1.0, 4.0]), np.array([2.0, 4.0, 1.0]), 1.0, False, 0.5, integral)
    np.testing.assert_allclose(integral, [0.1 + 0.5, -1.0, 1.0])  # .2 - 2 and 0 + 2 are beyond


def test_a_saturated_integral_only_shrinks():
    integral = np.array([0.5, 0.5, 0.5])
    integrate(np.array([1.0, -1.0, 0.0]), np.ones(3), 0.4, True, 0.25, integral)
    np.testing.assert_allclose(integral, [0.5, 0.25, 0.4])  # the last is above a new limit


@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize(("gravity", "heavier"), [(0.5, 1.5), (0.0, 1.0)])
def test_an_integral_of_a_quarter_holds_up_half_of_a_weight_at_half_a_unit_of_gravity(
    gravity, heavier, share
):
    """inertia 2, integral -0.25, or half of it in the law's bias; drag of 0.5 at 2 m/s."""
    integral = np.array([0.0, 0.0, share * -0.25])
    bias = np.array([0.0, 0.0, -0.25]) - integral
    tau = np.array([1.0, 0.0, 3.0]) - 2.0 * bias  # as the law writes it
    none, inertia = np.zeros(3), np.full(3, 2.0)
    reference, drag = np.zeros((3, 6)), np.array([0.5, 0.0, 0.0])
    reference[1, 0], limited = 2.0, np.zeros(3)
    completion = ForceCompletion(drag, inertia, none, 9.0, gravity, 0.0, 0.0, 9.0, 1.0)
    carried = bias, integral
    assert not complete_and_limit(reference, none, completion, False, 0.1, carried, tau, limited)
    np.testing.assert_allclose(limited, [2.0 * heavier, 0.0, 3.0 * heavier + 0.5])
