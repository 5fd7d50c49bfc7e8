"""The arm's load that is fed forward: by hand, and against the torques of the feasibility check."""

import math
from dataclasses import replace

import numpy as np
import pytest

from uam_control.control.arm_load import ArmLoadParameters, arm_load
from uam_control.control.controllers import ArmController, AttitudeController
from uam_control.maths.rotations import matrix_from_euler
from uam_control.profiles.profile import load_profile
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import derived_parameters, load_description
from uam_control.vehicle.arm_model import ArmModel

PERIOD = 0.004


def parameters(vehicle="s500_arm", **changes):
    derived = derived_parameters(load_description(vehicle))["arm_controller"]
    return ArmLoadParameters.from_mapping(derived | changes)


def load(reference, **changes):
    torques = np.full(reference.shape[1] - 6, np.nan)
    moment = arm_load(parameters(**changes).load_record(), reference, torques)
    return torques, moment


def test_a_still_arm_that_points_forward():
    """Link 1: 0.177 kg at 74.5 mm; link 2: 0.09 kg at 75 mm and the magnet's 0.07 kg at 140 mm."""
    reference = np.zeros((3, 8))
    reference[0, 6] = math.pi / 2
    torques, moment = load(reference)
    second = 9.81 * (0.09 * 0.075 + 0.07 * 0.140)
    first = second + 9.81 * (0.177 * 0.0745 + 0.16 * 0.100)
    np.testing.assert_allclose(torques, [first, second], rtol=1e-3)
    # its weight turns the nose down, about +y
    assert moment == pytest.approx(-first, rel=1e-3)


def test_an_arm_that_hangs_needs_nothing_also_while_the_base_accelerates_along_its_thrust():
    reference = np.zeros((3, 8))
    reference[0, 4], reference[2, 0] = math.pi / 4, 9.81  # 45 degrees, the thrust along the arm
    torques, moment = load(reference)
    np.testing.assert_allclose([*torques, moment], 0.0, atol=1e-9)


def test_friction_acts_with_the_motion():
    reference = np.zeros((3, 8))
    reference[1, 7] = -1.0
    with_friction, _ = load(reference)
    without, _ = load(reference, joint_friction=0.0, joint_damping=0.0)
    np.testing.assert_allclose(with_friction - without, [0.0, -0.1], atol=1e-6)


@pytest.mark.parametrize("vehicle", ["s500_arm", "s500_arm3", "hexa_arm"])
def test_it_has_the_torques_of_the_feasibility_check(vehicle):
    """A swinging arm under a base that accelerates without turning."""
    description = load_description(vehicle)
    arm, joints = ArmModel.of(description), len(description.joints)
    times = np.arange(0.0, 1.0, 0.001)
    size = np.linspace(0.4, 1.0, joints)
    angles = np.sin(3.0 * times)[:, None] * size
    position = np.column_stack([np.sin(2.0 * times), 0.0 * times, 0.3 * np.cos(4.0 * times)])
    level = np.broadcast_to(np.eye(3), (len(times), 3, 3))
    smooth = replace(arm, friction=0.0)
    expected = smooth.torques(times, position, level, angles, 9.81, np.zeros(len(times)))
    changes = {"vehicle": vehicle, "joint_friction": 0.0}
    for k in (200, 500, 800):
        reference = np.zeros((3, 6 + joints))
        reference[2, 0] = -4.0 * math.sin(2.0 * times[k])
        reference[2, 2] = -4.8 * math.cos(4.0 * times[k])
        reference[0, 6:] = angles[k]
        reference[1, 6:] = 3.0 * math.cos(3.0 * times[k]) * size
        reference[2, 6:] = -9.0 * math.sin(3.0 * times[k]) * size
        torques, _ = load(reference, **changes)
        np.testing.assert_allclose(torques, expected[k], atol=2e-4)


def test_the_moment_is_that_of_the_forces_on_the_links():
    """One link of 1 kg at 1 m that begins to swing: r x m (a + g), in the tilted body."""
    values = {
        "link_masses": [1.0], "link_centres": [1.0], "link_lengths": [1.0], "arm_gravity": 9.81,
        "joint_friction": 0.0, "joint_damping": 0.0, "joint_armature": 0.0,
    }  # fmt: skip
    reference = np.zeros((3, 7))
    reference[0, 3:7] = 0.2, -0.3, 0.5, 0.7
    reference[2, 0:3], reference[2, 6] = (1.0, 2.0, 3.0), 4.0
    torques = np.zeros(1)
    record = ArmLoadParameters.from_mapping(values).load_record()
    moment = arm_load(record, reference, torques)
    force = matrix_from_euler(reference[0, 3:6]).T @ (1.0, 2.0, 3.0 + 9.81)
    arm = np.array([math.sin(0.7), 0.0, -math.cos(0.7)])
    swing = 4.0 * np.array([math.cos(0.7), 0.0, math.sin(0.7)])
    assert moment == pytest.approx(np.cross(arm, force + swing)[1])
    assert torques[0] == pytest.approx(-moment)  # the arm turns about -y


def test_the_moment_of_two_links_in_an_accelerated_level_base():
    """1 kg at 0.5 m of 1 m, then 2 kg at 1 m: r x m (a + g) with a = (3, 0, 0), at rest."""
    values = {
        "link_masses": [1.0, 2.0], "link_centres": [0.5, 1.0], "link_lengths": [1.0, 1.0],
        "arm_gravity": 10.0,
    }  # fmt: skip
    reference = np.zeros((3, 8))
    reference[0, 6:], reference[2, 0] = (0.3, 0.4), 3.0
    torques = np.zeros(2)
    moment = arm_load(ArmLoadParameters.from_mapping(values).load_record(), reference, torques)
    elbow = np.array([math.sin(0.3), 0.0, -math.cos(0.3)])
    tip = elbow + [math.sin(0.7), 0.0, -math.cos(0.7)]
    force = np.array([3.0, 0.0, 10.0])
    expected = np.cross(0.5 * elbow, force) + np.cross(tip, 2.0 * force)
    assert moment == pytest.approx(expected[1])
    np.testing.assert_allclose(torques, [-moment, -np.cross(tip - elbow, 2.0 * force)[1]])


def test_it_needs_the_links():
    with pytest.raises(ParameterError, match="needs link_masses"):
        ArmLoadParameters.from_mapping({"arm_feedforward": True})
    with pytest.raises(ParameterError, match="lists of one length"):
        ArmLoadParameters.from_mapping({"link_masses": [1.0], "link_centres": [0.1, 0.2]})
    with pytest.raises(ParameterError, match="lists of one length"):
        ArmLoadParameters.from_mapping(
            {"link_masses": [1.0], "link_centres": [0.1], "link_lengths": [0.1, 0.2]}
        )


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
    assert attitude[1] == pytest.approx(moment, rel=0.02)
    assert attitude[0] == attitude[2] == 0.0
