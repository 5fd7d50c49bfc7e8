"""Rotors and servos against hand-worked numbers, with numbers of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uam_sim_bridge.plant.actuators import Rotors, Servos

STEP = 0.002
# full thrust .002 * 100^2 = 20 N; at u = .5 it is .56*.25 + .44*.5 = .36 of that, hence 60 rad/s.
# In a step the speed goes half of the way up, a quarter of the way down.
ROTORS = {
    "efficiency": [1, 0.5, 1],
    "thrust_coefficient": 0.002,
    "speed_max": 100.0,
    "curve_factor": 0.56,
    "lag_up": STEP / math.log(2.0),
    "lag_down": STEP / math.log(4.0 / 3.0),
}


def test_rotors_go_up_and_down_with_a_lag_of_their_own():
    rotors, output = Rotors(ROTORS, STEP), np.full(3, 77.0)
    np.testing.assert_array_equal([rotors.speed, rotors.thrust], np.zeros((2, 3)))
    rotors.speed[:] = 0.0, 0.0, 80.0
    rotors.step(np.array([0.5, 1.0, 0.5]), output)
    np.testing.assert_allclose(rotors.speed, [30.0, 50.0, 75.0])
    # .002 w^2, of the second rotor half of it
    np.testing.assert_allclose(rotors.thrust, [1.8, 2.5, 11.25])
    np.testing.assert_array_equal(output, rotors.thrust)
    rotors.step(np.array([0.5, 0.0, 0.5]), output)
    np.testing.assert_allclose(rotors.speed, [45.0, 37.5, 71.25])


def test_commands_of_rotors_are_clamped():
    rotors, output = Rotors(ROTORS, STEP), np.zeros(3)
    rotors.speed[:] = 0.0, 40.0, 40.0
    rotors.step(np.array([7.0, -1.0, 0.0]), output)
    np.testing.assert_allclose(rotors.speed, [50.0, 30.0, 30.0])


SERVOS = {
    "stall_torque": 3.0,
    "no_load_speed": 8.0,
    "torque_per_current": 0.5,
    "current_unit": 0.25,  # .125 N m
}


@pytest.mark.parametrize(("effort", "velocity", "expected"), [
    (0.7, 0.0, 0.75),  # 5.6 units are 6
    (-0.7, 0.0, -0.75),
    (0.68, 0.0, 0.625),  # 5.44 units are 5
    (5.0, 0.0, 3.0),
    (-5.0, 0.0, -3.0),
    (2.0, 4.0, 1.5),  # half of the speed leaves half of the torque
    (-5.0, 4.0, -3.0),  # against the motion there is all of it
    (-2.0, -4.0, -1.5),
    (5.0, -4.0, 3.0),
    (1.0, 10.0, 0.0),  # above the no-load speed none
    (-1.0, 10.0, -1.0),
    (-1.0, -10.0, 0.0),
    (1.0, -10.0, 1.0),
])  # fmt: skip
def test_servos_give_whole_units_within_the_torque_speed_line(effort, velocity, expected):
    servos, output = Servos(SERVOS, 2), np.full(2, 77.0)
    np.testing.assert_array_equal(servos.torque, [0.0, 0.0])
    servos.step(np.array([0.25, effort]), np.array([0.0, velocity]), output)
    np.testing.assert_allclose(servos.torque, [0.25, expected], atol=1e-15)
    np.testing.assert_array_equal(output, servos.torque)
