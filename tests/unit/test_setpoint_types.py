"""What each setpoint type sends of a desired motion, by hand."""

import math

import numpy as np

from uam_control.setpoints.setpoint_types import attitude_setpoint, rates_setpoint, wrench_setpoint
from uam_control.setpoints.targets import Desired, level

HALF = math.sqrt(0.5)
# turned left by a quarter turn: nose to the north
NORTH = np.array([[0.0, 0.0, math.pi / 2.0], [9.0, 9.0, 9.0], [8.0, 8.0, 8.0]])


def test_rates_are_sent_in_frd_without_an_attitude():
    target = rates_setpoint(Desired(np.array([0.1, 0.2, 0.3]), NORTH, 0.6))
    assert (target.type_mask, target.thrust) == (128, 0.6)
    np.testing.assert_array_equal(target.rates, [0.1, -0.2, -0.3])
    np.testing.assert_array_equal(target.quaternion, [1.0, 0.0, 0.0, 0.0])


def test_an_attitude_is_sent_from_frd_to_ned_without_rates():
    target = attitude_setpoint(Desired(np.array([0.1, 0.2, 0.3]), NORTH, 0.6))
    assert (target.type_mask, target.thrust) == (7, 0.6)
    np.testing.assert_array_equal(target.rates, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(target.quaternion, [1.0, 0.0, 0.0, 0.0], atol=1e-15)
    east = attitude_setpoint(Desired(np.zeros(3), level(0.0), 0.5))
    np.testing.assert_allclose(east.quaternion, [HALF, 0.0, 0.0, HALF])


def test_a_wrench_is_sent_in_frd_within_its_range_and_without_torque_body_rates_are():
    desired = Desired(np.array([0.1, 0.2, 0.3]), NORTH, 0.6, None, np.array([0.1, 0.2, -3.0]))
    target = wrench_setpoint(desired)
    assert target.thrust == 0.6 and not target.refused()
    np.testing.assert_array_equal(target.torque, [0.1, -0.2, 1.0])
    assert np.isnan(target.body_rates).all()
    assert wrench_setpoint(Desired(np.zeros(3), NORTH, 0.6)).type_mask == 128
    assert target._replace(thrust=math.nan).refused() == "thrust is nan, not finite"


def test_level_is_a_yaw_at_rest():
    np.testing.assert_array_equal(level(0.7), [[0.0, 0.0, 0.7], [0.0] * 3, [0.0] * 3])
