"""The arm's load that is fed forward: by hand, and as MuJoCo's inverse dynamics."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from planar_arm import planar_arm

from uam_control.control.arm_load import ArmLoadParameters, arm_load
from uam_control.control.controllers import ArmController, AttitudeController
from uam_control.coordinates import ALPHA, CHI
from uam_control.maths.rotations import matrix_from_euler
from uam_control.profiles.profile import load_profile
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import derived_parameters, load_description

PERIOD = 0.004


def load(reference, vehicle="s500_arm", **changes):
    derived = derived_parameters(load_description(vehicle))["arm_controller"]
    return loaded(reference, derived | changes)


def loaded(reference, values, turning=False):
    one = ArmLoadParameters.from_mapping(values).load()
    moment = arm_load(one, reference, reference[CHI, ALPHA:], turning)
    return one.torques, np.array(moment)


def test_a_still_arm_that_points_forward():
    """Link 1: 0.177 kg at 74.5 mm; link 2: 0.09 kg at 75 mm and the magnet's 0.07 kg at 140 mm."""
    reference = np.zeros((3, 8))
    reference[0, 6] = math.pi / 2
    torques, moment = load(reference)
    second = 9.81 * (0.09 * 0.075 + 0.07 * 0.140)
    first = second + 9.81 * (0.177 * 0.0745 + 0.16 * 0.100)
    np.testing.assert_allclose(torques, [first, second], rtol=1e-3)
    # its weight turns the nose down, about +y
    np.testing.assert_allclose(moment, [0.0, -first, 0.0], rtol=1e-3, atol=1e-9)


def test_an_arm_that_hangs_needs_nothing_also_while_the_base_accelerates_along_its_thrust():
    reference = np.zeros((3, 8))
    reference[0, 4], reference[2, 0] = math.pi / 4, 9.81  # 45 degrees, the thrust along the arm
    torques, moment = load(reference)
    np.testing.assert_allclose([*torques, *moment], 0.0, atol=1e-9)


def test_friction_acts_with_the_motion():
    reference = np.zeros((3, 8))
    reference[1, 7] = -1.0
    with_friction, _ = load(reference)
    without, _ = load(reference, joint_friction=[0.0, 0.0], joint_damping=[0.0, 0.0])
    np.testing.assert_allclose(with_friction - without, [0.0, -0.1], atol=1e-6)


def test_a_gear_under_load_takes_a_share_of_it():
    reference = np.zeros((3, 8))
    reference[0, 6], reference[1, 6:] = math.pi / 2, (2.0, -2.0)  # still: 9.81 N/kg alone bends it
    free, _ = load(reference)
    weight, _ = load(np.where(reference == 2.0, 0.0, np.where(reference == -2.0, 0.0, reference)))
    taken, _ = load(reference, joint_load_friction=[0.5, 0.25])
    expected = [0.5 * abs(weight[0]), -0.25 * abs(weight[1])]
    np.testing.assert_allclose(taken - free, expected, rtol=0.1)


def test_shares_of_friction_are_one_for_each_joint():
    with pytest.raises(ParameterError, match="joint_load_friction: 1 numbers, 2 expected"):
        load(np.zeros((3, 8)), joint_load_friction=[0.1])


def test_the_moment_is_that_of_the_forces_on_the_links():
    """One link of 1 kg at 1 m that begins to swing: r x m (a + g), in the tilted body."""
    reference = np.zeros((3, 7))
    reference[0, 3:7] = 0.2, -0.3, 0.5, 0.7
    reference[2, 0:3], reference[2, 6] = (1.0, 2.0, 3.0), 4.0
    arm = planar_arm([1.0], [1.0], [1.0]) | {"arm_gravity": 9.81, "base_mass": 3.0}
    torques, moment = loaded(reference, arm)
    force = matrix_from_euler(reference[0, 3:6]).T @ (1.0, 2.0, 3.0 + 9.81)
    arm = np.array([math.sin(0.7), 0.0, -math.cos(0.7)])
    swing = 4.0 * np.array([math.cos(0.7), 0.0, math.sin(0.7)])
    turns = np.cross(arm, force + swing)
    assert torques[0] == pytest.approx(-turns[1])  # the arm turns about -y
    # nothing holds 3 kg against the swing: 4 kg give way, their centre of mass at a quarter
    np.testing.assert_allclose(moment, turns - np.cross(arm / 4.0, swing), atol=1e-12)


def test_the_moment_of_two_links_in_an_accelerated_level_base():
    """1 kg at 0.5 m of 1 m, then 2 kg at 1 m: r x m (a + g) with a = (3, 0, 0), at rest."""
    reference = np.zeros((3, 8))
    reference[0, 6:], reference[2, 0] = (0.3, 0.4), 3.0
    arm = planar_arm([1.0, 2.0], [0.5, 1.0], [1.0, 1.0]) | {"arm_gravity": 10.0}
    torques, moment = loaded(reference, arm)
    elbow = np.array([math.sin(0.3), 0.0, -math.cos(0.3)])
    tip = elbow + [math.sin(0.7), 0.0, -math.cos(0.7)]
    force = np.array([3.0, 0.0, 10.0])
    expected = np.cross(0.5 * elbow, force) + np.cross(tip, 2.0 * force)
    np.testing.assert_allclose(moment, expected, atol=1e-12)
    np.testing.assert_allclose(torques, [-moment[1], -np.cross(tip - elbow, 2.0 * force)[1]])


def test_a_base_whose_mass_is_beside_its_origin_turns_about_it():
    """2 kg 0.1 m to the left: 20 N there turn it by -2 N m ... about x, so +2 N m are needed."""
    arm = planar_arm([1.0], [1.0], [1.0]) | {"base_mass": 2.0, "base_centre": [0.0, 0.1, 0.0]}
    _, moment = loaded(np.zeros((3, 7)), arm | {"arm_gravity": 10.0})
    np.testing.assert_allclose(moment, [2.0, 0.0, 0.0], atol=1e-12)


def test_turning_is_the_reaction_of_the_links_to_the_bases_angular_acceleration():
    """1 kg at 1 m below; 3 rad/s^2 about y moves it by -3 m/s^2 along x: 3 N m about -y."""
    reference = np.zeros((3, 7))
    reference[2, 4] = 3.0
    arm = planar_arm([1.0], [1.0], [1.0]) | {"arm_gravity": 0.0}
    for turning, torque in ((False, 0.0), (True, -3.0)):
        torques, _ = loaded(reference, arm, turning)
        np.testing.assert_allclose(torques, [torque], atol=1e-12)


@pytest.mark.parametrize("name", ["s500_arm", "s500_arm3", "hexa_arm"])
def test_a_moving_reference_has_the_torques_of_mujoco(name):
    vehicle = load_description(name)
    joints, random = len(vehicle.joints), np.random.default_rng(3)
    model = mujoco.MjModel.from_xml_path(str(vehicle.model))
    magnet = model.body("magnet").id
    model.body_ipos[magnet] = 0.0  # what swings freely acts as a point at its pivot
    model.body_inertia[magnet] = 0.0
    dofs = [model.joint(one).dofadr[0] for one in vehicle.joint_names]
    model.dof_frictionloss[:] = 0.0
    base, data = model.joint("base").dofadr[0], mujoco.MjData(model)
    values = derived_parameters(vehicle)["arm_controller"]
    values |= {"joint_friction": [0.0] * joints}
    for _ in range(5):
        reference = random.normal(size=(3, 6 + joints)) * 0.7
        place = model.joint("base").qposadr[0]
        data.qpos[place : place + 3] = 0.0, 0.0, 5.0
        turn = matrix_from_euler(reference[0, 3:6])
        mujoco.mju_mat2Quat(data.qpos[place + 3 : place + 7], turn.ravel())
        data.qvel[:] = data.qacc[:] = 0.0
        data.qvel[base + 3 : base + 6] = reference[1, 3:6]
        data.qacc[base : base + 6] = reference[2, :6]
        for i, dof in enumerate(dofs):
            data.qpos[model.joint(vehicle.joint_names[i]).qposadr[0]] = reference[0, 6 + i]
            data.qvel[dof], data.qacc[dof] = reference[1, 6 + i], reference[2, 6 + i]
        mujoco.mj_inverse(model, data)
        torques, _ = loaded(reference, values, turning=True)
        np.testing.assert_allclose(torques, data.qfrc_inverse[dofs], atol=1e-9)


def test_it_needs_the_links():
    with pytest.raises(ParameterError, match="needs link_masses"):
        ArmLoadParameters.from_mapping({"arm_feedforward": True})


def commands(profile, **changes):
    """The torques of attitude and arm for a still reference with the arm forward, at no error."""
    state = np.zeros((3, 8))
    state[0, 6] = 1.0
    found = []
    for node, kind in (("attitude", AttitudeController), ("arm", ArmController)):
        values = load_profile(profile).sets[f"{node}_controller"]
        controller = kind(replace(values, **changes))
        found.append(controller.update(state, state, np.zeros((3, 3)), True, PERIOD).copy())
    return found


def test_the_feedforward_reaches_the_commands_and_is_off_as_printed():
    for torques in commands("paper_table1"):
        np.testing.assert_array_equal(torques, 0.0)
    attitude, arm = commands("s500")
    reference = np.zeros((3, 8))
    reference[0, 6] = 1.0
    torques, moment = load(reference)
    np.testing.assert_allclose(arm, torques)
    # the autopilot integrates its part within the tick already
    assert attitude[1] == pytest.approx(moment[1], rel=0.02)
    assert attitude[0] == attitude[2] == 0.0
