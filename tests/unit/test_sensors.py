"""Sensors against hand-worked numbers, with numbers of their own and noise that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uam_sim_bridge.plant.sensors import (
    PAYLOAD_POSE,
    VEHICLE_POSE,
    Imu,
    Mocap,
    Noise,
    disturbed,
    encoder_units,
    generators,
    quantised,
    receive_poses,
    send_pose,
    take_pose,
)


class Counting:
    """Stands in for a random generator: 1, 2, 3 and so on."""

    def __init__(self):
        self.count = 0

    def standard_normal(self, shape):
        size = int(np.prod(shape))
        values = self.count + np.arange(1.0, size + 1.0)
        self.count += size
        return values.reshape(shape)


def test_noise_is_the_sequence_of_its_generator_whatever_the_block():
    noise = Noise(np.random.default_rng(3), np.array([2.0, 0.5]))
    rows = np.array([noise() for _ in range(5000)])
    expected = np.random.default_rng(3).standard_normal((5000, 2)) * [2.0, 0.5]
    np.testing.assert_array_equal(rows, expected)


def test_generators_of_a_seed_are_numpys_and_independent():
    drawn = [one.standard_normal() for one in generators(7, 3)]
    spawned = np.random.SeedSequence(7).spawn(3)
    assert drawn == [np.random.default_rng(one).standard_normal() for one in spawned]
    assert len(set(drawn)) == 3


def test_imu_adds_bias_and_noise_of_each_axis():
    numbers = {
        "gyro_bias": 0.25,
        "accelerometer_bias": 0.5,
        "gyro_noise": 1.0,
        "accelerometer_noise": 2.0,
    }
    imu = Imu(numbers, 2.0, Counting())
    # the bias takes 1..6 of the generator, doubled
    np.testing.assert_array_equal(imu.bias, [0.5, 1.0, 1.5, 4.0, 5.0, 6.0])
    gyro, force = np.zeros((2, 3))
    rates, true_force = np.array([10.0, 20.0, 30.0]), np.array([1.0, 2.0, 3.0])
    disturbed(rates, true_force, imu.noise(), imu.bias, gyro, force)
    # the noise 7..12: gyro 14, 16, 18; accelerometer 40, 44, 48
    np.testing.assert_array_equal(gyro, [24.5, 37.0, 49.5])
    np.testing.assert_array_equal(force, [45.0, 51.0, 57.0])
    # the next row of noise, 13..18: 26, 28, 30 and 64, 68, 72
    disturbed(np.zeros(3), np.zeros(3), imu.noise(), imu.bias, gyro, force)
    np.testing.assert_array_equal(gyro, [26.5, 29.0, 31.5])
    np.testing.assert_array_equal(force, [68.0, 73.0, 78.0])


LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
MOCAP = {"rate": 4.0, "position_noise": 0.5, "attitude_noise": 1e-3}


def rig(scale=1.0, **numbers):
    mocap = Mocap(MOCAP | numbers, scale, (Counting(), Counting()), payload_top=2.0)
    mocap.draw(0.25)
    return mocap


def pose_of(mocap, time, position, quaternion, payload):
    still = np.zeros(3), np.zeros(3)
    return take_pose(mocap.arrays, time, 0.25, position, quaternion, *still, payload)


def taken(mocap, body):
    pose = mocap.arrays.taken[body]
    return pose[0], pose[1:4], pose[4:]


def due(mocap, time):
    return pose_of(mocap, time, np.zeros(3), LEVEL, np.array([1.0, 2.0, 3.0, *LEVEL]))


def test_mocap_adds_noise_to_position_and_a_turn_in_the_body_to_attitude():
    mocap = rig(2.0)
    half_turn = np.array([0.0, 0.0, 0.0, 1.0])
    assert pose_of(mocap, 0.0, np.array([10.0, 20.0, 30.0]), half_turn, np.zeros(7))
    stamp, position, quaternion = taken(mocap, VEHICLE_POSE)
    assert stamp == 0.0
    np.testing.assert_array_equal(position, [11.0, 22.0, 33.0])
    # turn by (8, 10, 12) mrad after the half turn about z: k (1 + i a + j b + k c)
    angle = 1e-3 * math.sqrt(64.0 + 100.0 + 144.0)
    s = math.sin(angle / 2.0) / angle * 1e-3
    expected = [-12.0 * s, -10.0 * s, 8.0 * s, math.cos(angle / 2.0)]
    np.testing.assert_allclose(quaternion, expected, rtol=1e-12)
    assert due(mocap, 1.0)
    _, position, _ = taken(mocap, VEHICLE_POSE)
    np.testing.assert_array_equal(position, [7.0, 8.0, 9.0])  # of the next row


def test_mocap_exposes_at_its_rate_and_not_late_by_rounding():
    mocap = rig()
    times = [0.0, 0.0, 0.2, 0.25 - 1e-9, 0.3, 0.5 - 1e-8, 0.5 - 5e-10, 0.6, 0.75, 1.0]
    expected = [True, False, False, True, False, False, True, False, True, True]
    assert [due(mocap, time) for time in times] == expected


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_encoders_count(sign):
    units = encoder_units({"counts_per_turn": 8, "velocity_unit": 0.25})
    angles, velocities = sign * np.array([1.0, 2.0, 0.3]), sign * np.array([0.6, 0.1, 1.15])
    angle, velocity = np.zeros((2, 3))
    quantised(angles, velocities, units, angle, velocity)
    # an eighth of a turn is .785: 1.27, 2.55 and .38 of them are 1, 3 and 0
    np.testing.assert_allclose(angle, sign * math.pi / 4.0 * np.array([1.0, 3.0, 0.0]))
    np.testing.assert_allclose(velocity, sign * np.array([0.5, 0.0, 1.25]))


def test_a_pose_may_be_later_than_usual_and_several_arrive_in_their_order():
    mocap, got = rig(), []
    for tick, late in enumerate((3, 0, None, None, None, None)):
        assert due(mocap, float(tick))
        if late is not None:
            send_pose(mocap.arrays, VEHICLE_POSE, tick + 2 + late)
        receive_poses(mocap.arrays, tick)
        got.append(mocap.arrived(VEHICLE_POSE))
    assert [[pose[0] for pose in poses] for poses in got] == [[]] * 5 + [[0.0, 1.0]]
    assert mocap.arrived(PAYLOAD_POSE) == []
    receive_poses(mocap.arrays, 6)
    assert mocap.arrived(VEHICLE_POSE) == []


def test_the_pose_of_the_payload_is_that_of_its_grip_point():
    mocap = rig(payload=True)
    assert due(mocap, 0.0)
    send_pose(mocap.arrays, PAYLOAD_POSE, 0)
    receive_poses(mocap.arrays, 0)
    ((_, position, _),) = mocap.arrived(PAYLOAD_POSE)
    np.testing.assert_array_equal(position, [1.5, 3.0, 6.5])  # noise 1, 2, 3, halved


def test_mocap_of_a_plant_that_begins_later_keeps_its_rate_from_there():
    mocap = rig()
    # 10.1 is more than a period behind the first pose; 0.25 exactly one is not
    assert [due(mocap, t) for t in (10.1, 10.2, 10.35, 10.5, 10.6)] == [
        True, False, True, False, True,
    ]  # fmt: skip
    mocap = rig()
    assert [due(mocap, t) for t in (0.25, 0.25, 0.5)] == [True, True, True]
