"""Motors, servos, sensors, magnet and payload follow their data sheets."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.actuators import Rotors, Servos, joint_step, receive, rotor_step
from uam_sim_bridge.plant.magnet import magnet_constants, pull_fraction
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.sensors import (
    Mocap,
    encoder_units,
    generators,
    quantised,
    take_pose,
)

VEHICLE = Vehicle.load()
NUMBERS = VEHICLE.numbers
STEP = 0.002


def rotors(commands, seconds, start=0.0):
    group = Rotors(NUMBERS["rotors"], STEP)
    group.speed[:] = start
    out = np.zeros(4)
    for _ in range(round(seconds / STEP)):
        rotor_step(np.asarray(commands, dtype=float), group.arrays, out)
    return group


def test_rotor_thrust_curve_and_limit():
    settled = rotors([1.0, 0.5, 0.0, 7.0], 1.0)
    full = VEHICLE.description.rotor.thrust_max
    assert full == pytest.approx(10.34, abs=0.01)
    np.testing.assert_allclose(
        settled.thrust, [full, full * (0.3 * 0.25 + 0.7 * 0.5), 0.0, full], rtol=1e-9, atol=1e-9
    )


def test_rotor_lag_is_faster_up_than_down():
    up = rotors([1.0] * 4, 0.012)
    assert up.speed[0] == pytest.approx(1100 * (1 - np.exp(-0.012 / 0.0125)), rel=1e-9)
    down = rotors([0.0] * 4, 0.012, start=1100.0)
    assert down.speed[0] == pytest.approx(1100 * np.exp(-0.012 / 0.025), rel=1e-9)


@given(st.floats(-5, 5), st.floats(-12, 12))
def test_servo_stays_within_the_torque_speed_line(effort, speed):
    numbers = NUMBERS["servos"] | {"command_latency_ticks": 0}
    servos, out = Servos(numbers, np.zeros(1)), np.zeros(1)
    receive(np.array([effort]), 0, servos.arrays)
    joint_step(servos.arrays, np.zeros(1), np.array([speed]), out)
    unit = NUMBERS["servos"]["torque_per_current"] * NUMBERS["servos"]["current_unit"]
    assert abs(out[0]) <= 3.0 + 1e-12
    if effort * speed > 0:  # driving: less torque the faster, none at no-load speed
        assert abs(out[0]) <= 3.0 * max(0.0, 1.0 - abs(speed) / 8.06) + 1e-9
    if abs(effort) < 1.0 and abs(speed) < 4.0:
        assert out[0] == pytest.approx(effort, abs=unit / 2 + 1e-12)


@given(st.floats(-2, 2), st.floats(-5, 5))
def test_encoder_reads_whole_counts(angle, velocity):
    units = encoder_units(NUMBERS["sensors"]["joints"])
    alpha, alpha_dot = np.zeros(1), np.zeros(1)
    quantised(np.array([angle]), np.array([velocity]), units, alpha, alpha_dot)
    count = 2 * np.pi / 4096
    assert abs(alpha[0] - angle) <= count / 2 + 1e-12
    assert alpha[0] / count == pytest.approx(round(alpha[0] / count), abs=1e-6)
    assert abs(alpha_dot[0] - velocity) <= 0.02398 / 2 + 1e-12


def test_mocap_keeps_its_rate_on_average():
    mocap, pose = Mocap(NUMBERS["sensors"]["mocap"], 1.0, generators(1, 2)), np.ones(7)
    exposures = 0
    for k in range(2500):
        mocap.draw(0.004)
        still = np.zeros(3), np.zeros(3)
        exposures += take_pose(mocap.arrays, k * 0.004, 0.004, pose[:3], pose[3:], *still, pose)
    assert exposures == pytest.approx(1200, abs=1)


def test_sensors_arrive_late_with_the_stamp_of_their_exposure():
    plant = MujocoPlant(VEHICLE, 0.2, seed=3)
    ages = {"imu": [], "joints": [], "mocap": []}
    for _ in range(100):
        samples = plant.sense()
        for name, age in ages.items():
            sample = getattr(samples, name)
            if sample is not None:
                age.append(plant.time - sample[0])
        plant.step(np.zeros(4), np.zeros(2), False)
    assert ages["imu"] == pytest.approx([0.004] * len(ages["imu"]))
    assert ages["joints"] == pytest.approx([0.004] * len(ages["joints"]))
    assert ages["mocap"] == pytest.approx([0.012] * len(ages["mocap"]))
    assert len(ages["imu"]) == 99 and 46 <= len(ages["mocap"]) <= 48


def test_same_seed_same_noise_other_seed_other_noise():
    def readings(seed):
        plant = MujocoPlant(VEHICLE, 0.2, seed=seed)
        return np.concatenate([np.concatenate(plant.sense().hil[1:]) for _ in range(50)])

    np.testing.assert_array_equal(readings(1), readings(1))
    assert not np.array_equal(readings(1), readings(2))


def test_noise_has_the_stated_size():
    plant = MujocoPlant(VEHICLE, 0.2, seed=5)
    gyro = np.array([plant.sense().hil[1] for _ in range(4000)])
    np.testing.assert_allclose(gyro.std(axis=0), NUMBERS["sensors"]["imu"]["gyro_noise"], rtol=0.06)


GAP = np.array([0.02, 0.0385, 0.001, 0.003])  # height, reach, thickness, gap_scale


@pytest.mark.parametrize(
    ("face", "expected"),
    [
        ((0, 0, 0.019), 1.0),  # pressed into the plate
        ((0, 0, 0.02), 1.0),
        ((0, 0, 0.023), 0.25),
        ((0, 0, 0.032), 0.04),
        ((0.0385, -0.0385, 0.02), 1.0),  # a corner of the face on a corner of the plate
        ((0.0385 + 0.003, 0, 0.02), 0.25),  # beside it
        ((0.03, 0, 0.007), 0.04),  # at the side of a payload that has toppled
    ],
)
def test_magnet_pull_falls_with_the_gap_to_the_plate(face, expected):
    upright = np.eye(3).ravel()
    assert pull_fraction(np.array(face), np.zeros(3), upright, GAP) == pytest.approx(expected)


def test_the_plate_is_where_the_model_has_it():
    np.testing.assert_allclose(magnet_constants(VEHICLE.compile(0.2), 0.003), GAP)


@pytest.mark.parametrize("speed", [0.0, 10.0])
def test_a_payload_that_moves_with_the_magnet_is_held_as_one_at_rest(speed):
    """Face and payload are compared at one instant: 2 ms at 10 m/s would be a gap of 20 mm."""
    plant = MujocoPlant(VEHICLE, 0.2, seed=1)
    model, data = plant.model, plant.data
    first, speeds = model.joint("payload").qposadr[0], model.joint("payload").dofadr[0]
    data.qpos[2] += 3.0
    mujoco.mj_forward(model, data)
    data.qpos[first : first + 3] = data.site("magnet_face").xpos - (0.0, 0.0, 0.0199)
    data.qvel[2] = data.qvel[speeds + 2] = speed
    mujoco.mj_forward(model, data)
    for _ in range(2):
        plant.step(np.full(4, 0.5), np.zeros(2), True)
    assert plant.truth().magnet_force > 0.9 * NUMBERS["magnet"]["holding_force"]


def test_the_magnet_stands_on_the_stand_but_does_not_hold_on_to_it():
    plant = MujocoPlant(VEHICLE, 0.0, seed=1)
    model, data = plant.model, plant.data
    face, top = (model.geom(name).id for name in ("magnet_face", "stand_top"))
    mujoco.mj_forward(model, data)
    data.qpos[0:3] += data.geom_xpos[top] - data.geom_xpos[face] + (0.0, 0.0, 0.0108)
    data.ctrl[6] = 1.0
    mujoco.mj_forward(model, data)
    met = {frozenset(pair) for pair in data.contact.geom.tolist()}
    case = model.geom("magnet_case").id
    assert frozenset((case, top)) in met and frozenset((face, top)) not in met
    assert not data.qfrc_actuator[0:6].any()


def test_drag_and_wind_push_the_vehicle():
    still = MujocoPlant(VEHICLE, 0.0, seed=1)
    windy = MujocoPlant(VEHICLE.changed({"air.wind": [3.0, 0.0, 0.0]}), 0.0, seed=1)
    for plant in (still, windy):
        plant.data.qpos[2] = 20.0
        for _ in range(100):
            plant.step(np.zeros(4), np.zeros(2), False)
    push = windy.truth().state[1, 0] - still.truth().state[1, 0]
    assert push == pytest.approx(0.15 * 3.0 / 2.2 * 0.4, rel=0.1)


def test_another_gripper_has_the_force_of_its_curve():
    """Full force up to 2 mm, none from 3 mm on, half of it between; the face above the plate."""
    curve = [[0.0, 1.0], [0.002, 1.0], [0.003, 0.0]]
    constants = magnet_constants(VEHICLE.compile(0.2), 0.003, curve)
    np.testing.assert_allclose(constants, [*GAP, 0.0, 1.0, 0.002, 1.0, 0.003, 0.0])
    upright = np.eye(3).ravel()
    for gap, expected in ((0.0, 1.0), (0.0015, 1.0), (0.0025, 0.5), (0.003, 0.0), (1.0, 0.0)):
        face = np.array([0.0, 0.0, 0.02 + gap])
        assert pull_fraction(face, np.zeros(3), upright, constants) == pytest.approx(expected)
