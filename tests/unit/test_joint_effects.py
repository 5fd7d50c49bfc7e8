"""The effects of a laboratory on the arm's joints: each by hand."""

import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from effects_rig import flown, plant, tick

from uam_sim_bridge.plant.effects.joint_effects import Gear, followed, gear_step, rigid_step
from uam_sim_bridge.plant.plant import PlantError

LEVEL = np.eye(3).ravel()
SENSING = ("propeller_vibration", "mocap_jitter", "mocap_dropouts", "arm_occlusion")
MOCAP = ("mocap_jitter", "mocap_dropouts", "arm_occlusion")


def gear(torque, alpha, angle, speed=0.0, friction=0.1, alpha_dot=0.0, load=0.0):
    """One step of a gear of 0.02 rad half play, 100 N m/rad; return contact, angle, speed."""
    constants = np.array([0.02, 100.0, 0.0, 1.5, 0.05, 0.0, 0.002])
    angles, speeds, output = np.array([angle]), np.array([speed]), np.zeros(1)
    friction = np.array([friction]), np.array([load])
    motors = Gear(np.array([0.01]), *friction, constants, np.ones(1), angles, speeds)
    gear_step(motors, np.array([torque]), np.array([alpha]), np.array([alpha_dot]), output)
    return output[0], angles[0], speeds[0]


def test_teeth_of_a_light_joint_are_as_soft_as_the_physics_step_needs():
    """Motor 0.5, link 1.0 g m^2: (150 h^2 + 2 0.3 h) 3000 = 5.4 with h = 2 ms: 3 / 5.4.

    A light pair that is let go comes to rest; with all of them it does not.
    """
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.002"/><worldbody><body><joint armature="1e-3"/>'
        '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-12 1e-12 1e-12"/>'
        "</body></worldbody></mujoco>"
    )
    bench = SimpleNamespace(model=model, data=mujoco.MjData(model), arm=slice(0, 1))
    (teeth,) = followed(bench, np.array([0.5e-3]), 150.0, 0.3)
    assert teeth == pytest.approx(3.0 / 5.4, rel=1e-6)
    assert followed(bench, np.array([0.5e-3]), 15.0, 0.03)[0] == 1.0

    def swing(part):
        constants = np.array([0.0, 150.0, 0.3, 1.0, 0.05, 0.0, 0.002])
        state = np.zeros(1), np.zeros(1)
        motors = Gear(
            np.array([0.5e-3]), np.zeros(1), np.zeros(1), constants, np.array([part]), *state
        )
        angle, speed, output = np.array([0.01]), np.zeros(1), np.zeros(1)
        for _ in range(200):
            gear_step(motors, np.zeros(1), angle, speed, output)
            speed += 0.002 * output / 1e-3
            angle += 0.002 * speed
        return abs(speed[0])

    assert swing(teeth) < 0.05 < 1.0 < swing(1.0)


def test_inside_the_play_no_torque_and_beyond_it_a_spring():
    assert gear(0.0, 0.0, 0.019)[0] == 0.0
    assert gear(0.0, 0.0, 0.03)[0] == pytest.approx(1.0)  # 100 N m/rad * 0.01 rad
    assert gear(0.0, 0.0, -0.03)[0] == pytest.approx(-1.0)


def test_stiction_holds_a_resting_motor_and_coulomb_brakes_a_moving_one():
    assert gear(0.149, 0.0, 0.0)[2] == 0.0  # below 1.5 * 0.1 N m
    assert gear(0.16, 0.0, 0.0)[2] == pytest.approx((0.16 - 0.15) * 0.002 / 0.01)
    # at 1 rad/s the Stribeck excess is gone: 0.1 N m brakes
    assert gear(0.0, 0.0, 0.0, speed=1.0)[2] == pytest.approx(1.0 - 0.1 * 0.002 / 0.01)


def test_friction_grows_with_the_torque_of_the_servo():
    # at 1 rad/s: 0.1 + 0.3 2.0 = 0.7 N m brakes, 2.0 N m drives
    turned = gear(2.0, 0.0, 0.0, speed=1.0, load=0.3)[2]
    assert turned == pytest.approx(1.0 + (2.0 - 0.7) * 0.002 / 0.01)


@pytest.mark.parametrize(
    ("speed", "torque"),
    [
        (1.0, 2.0 - 0.7),  # tanh(1 / 0.015) = 1: all of 0.1 + 0.3 2.0
        (0.0, 2.0),  # at rest no friction: smooth
        (0.015, 2.0 - 0.01 * 0.015 / 0.002),  # tanh(1) 0.7 would turn it back: its momentum only
        (-1.0, 2.0 + 0.7),
    ],
)
def test_a_rigid_gear_has_smooth_friction_that_never_turns_the_joint_back(speed, torque):
    constants = np.array([0.0, 0.0, 0.0, 1.0, 0.05, 0.015, 0.002])
    own = np.array([0.01]), np.array([0.1]), np.array([0.3])
    torques = np.array([2.0])
    rigid_step(
        Gear(*own, constants, np.ones(1), np.zeros(1), np.zeros(1)), torques, np.array([speed])
    )
    assert torques[0] == pytest.approx(torque)


def test_a_joint_with_play_swings_freely_within_it():
    one = plant("joint_gear:backlash_deg=2")
    for _ in range(250):
        one.sense()
        one.step(np.zeros(4), np.array([0.0, 0.0]), False)
    motors = one.effects.acting["joint_gear"].arrays[0]
    gap = np.abs(motors.angle - one.truth().state[0, 6:])
    assert np.all(gap <= math.radians(1.0) + 0.01)


def test_cables_pull_to_their_rest_angle():
    one = plant("cable_torque:stiffness=0.02,stiffness_spread=0,rest_spread_deg=0")
    bench = one.effects.bench
    bench.body.alpha[:] = [0.5, math.radians(90.0) - 0.25]
    tick(one, "cable_torque")
    assert one.data.qfrc_applied[bench.arm] == pytest.approx([-0.01, 0.005])


def test_the_current_loop_s_noise_has_its_size_and_bandwidth_at_every_joint():
    one = plant("servo_noise:torque=0.02/0.01,bandwidth=5")
    (_, _, noise, _), states = one.effects.acting["servo_noise"].arrays, []
    for _ in range(20000):
        tick(one, "servo_noise")
        states.append(noise.copy())
    states = np.array(states)
    assert states.std(axis=0) == pytest.approx([0.02, 0.01], rel=0.1)
    kept = [np.corrcoef(column[1:], column[:-1])[0, 1] for column in states.T]
    assert kept == pytest.approx([math.exp(-2.0 * math.pi * 5.0 * 0.004)] * 2, abs=0.01)


def test_a_number_for_each_joint_must_fit_the_vehicle():
    with pytest.raises(
        PlantError, match="3 numbers; allowed: one, or one for each of the 2 joints"
    ):
        plant("servo_noise:torque=0.1/0.1/0.1")


def test_speeds_are_reported_late_and_angles_at_once():
    late, calm = plant("joint_readings:delay=0.04"), plant()
    (found, _), (usual, _) = flown(late), flown(calm)
    for k in range(10, 60):
        assert np.array_equal(found[k].joints[2], usual[k - 10].joints[2] if k > 10 else [0, 0])
        assert np.array_equal(found[k].joints[1], usual[k].joints[1])
