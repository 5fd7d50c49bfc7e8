"""Rotors and servos against hand-worked numbers, with numbers of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uam_sim_bridge.plant.actuators import Rotors, Servos, joint_step, receive, rotor_step

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
    rotor_step(np.array([0.5, 1.0, 0.5]), rotors.arrays, output)
    np.testing.assert_allclose(rotors.speed, [30.0, 50.0, 75.0])
    # .002 w^2, of the second rotor half of it
    np.testing.assert_allclose(rotors.thrust, [1.8, 2.5, 11.25])
    np.testing.assert_array_equal(output, rotors.thrust)
    rotor_step(np.array([0.5, 0.0, 0.5]), rotors.arrays, output)
    np.testing.assert_allclose(rotors.speed, [45.0, 37.5, 71.25])


def test_commands_of_rotors_are_clamped():
    rotors, output = Rotors(ROTORS, STEP), np.zeros(3)
    rotors.speed[:] = 0.0, 40.0, 40.0
    rotor_step(np.array([7.0, -1.0, 0.0]), rotors.arrays, output)
    np.testing.assert_allclose(rotors.speed, [50.0, 30.0, 30.0])


SERVOS = {
    "mode": "current",
    "position_p_gain": 800,
    "pwm_limit": 885,
    "stall_torque": 3.0,
    "no_load_speed": 8.0,
    "torque_per_current": 0.5,
    "current_unit": 0.25,  # .125 N m
    "command_latency_ticks": 0,
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
    servos, output = Servos(SERVOS, np.array([0.3, 0.4])), np.full(2, 77.0)
    np.testing.assert_array_equal(servos.torque, [0.0, 0.0])
    receive(np.array([0.25, effort]), 0, servos.arrays)
    joint_step(servos.arrays, np.array([0.3, 0.4]), np.array([0.0, velocity]), output)
    np.testing.assert_allclose(servos.torque, [0.25, expected], atol=1e-15)
    np.testing.assert_array_equal(output, servos.torque)


COUNT = 2.0 * math.pi / 4096.0


# gain 800 / 128 = 6.25 PWM units per count; 885 units are the supply voltage, which gives 3 N m at
# rest and 8 rad/s without load
@pytest.mark.parametrize(("counts", "velocity", "limit", "expected"), [
    (70.8, 0.0, 885, 3.0 * 443.75 / 885),  # 71 counts: 443.75 units
    (-70.8, 0.0, 885, -3.0 * 443.75 / 885),
    (0.4, 0.0, 885, 0.0),  # less than half a count
    (141.0, 0.0, 885, 3.0 * 881.25 / 885),
    (500.0, 0.0, 885, 3.0),
    (500.0, 4.0, 885, 1.5),  # the motor's own voltage leaves half
    (0.0, 4.0, 885, -1.5),  # and brakes without an error
    (-500.0, 4.0, 885, -3.0),  # -4.5 within the stall torque
    (500.0, 0.0, 295, 1.0),  # a third of the voltage
])  # fmt: skip
def test_servos_in_position_control_act_like_a_spring_with_the_makers_gain(
    counts, velocity, limit, expected
):
    numbers = SERVOS | {"mode": "position", "pwm_limit": limit}
    start = np.array([0.0, 100 * COUNT])
    servos, output = Servos(numbers, start), np.full(2, 77.0)
    receive(np.array([0.0, (100 + counts) * COUNT]), 0, servos.arrays)
    joint_step(servos.arrays, start, np.array([0.0, velocity]), output)
    np.testing.assert_allclose(output, [0.0, expected], atol=1e-12)
    np.testing.assert_array_equal(servos.torque, output)


def test_a_servo_in_position_control_stays_until_the_first_goal():
    servos = Servos(SERVOS | {"mode": "position"}, np.array([0.5, -0.5]))
    receive(np.array([np.nan, -0.25]), 0, servos.arrays)
    np.testing.assert_array_equal(servos.command, [0.5, -0.25])


def test_the_lags_of_rotors_are_scaled_one_by_one():
    rotors, output = Rotors(ROTORS, STEP), np.zeros(3)
    rotors.scale_lags(np.array([2.0, 1.0, 0.5]))
    rotor_step(np.ones(3), rotors.arrays, output)
    # of 100 rad/s: 1 - sqrt(1/2), a half, three quarters
    np.testing.assert_allclose(rotors.speed, [100.0 - math.sqrt(5000.0), 50.0, 75.0])


def test_the_position_loop_counts_whole_turns():
    """Two turns apart are 8192 counts: 300 of 885 units per count would round otherwise."""
    numbers = SERVOS | {"mode": "position", "position_p_gain": 1, "pwm_limit": 885}
    servos, output = Servos(numbers, np.zeros(1)), np.zeros(1)
    receive(np.array([4.0 * math.pi]), 0, servos.arrays)
    joint_step(servos.arrays, np.zeros(1), np.zeros(1), output)
    np.testing.assert_allclose(output, 3.0 * 8192 / 128 / 885)
