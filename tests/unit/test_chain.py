"""The arm as a chain: against Pinocchio, MuJoCo and numbers by hand; of any axis and mount."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from random_chains import in_pinocchio, pin, random_chain, unit

from uam_control.arm.chain import ChainParameters, as_parameters, carrying
from uam_control.arm.kinematics import (
    DOWN,
    LINK,
    gravity_torque,
    hand_jacobian,
    hand_pose,
    mass_matrix,
    newton_euler,
    vehicle_centre,
)
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import VehicleError, chain_of, load_description
from uam_control.vehicle.chain_reader import ChainReader

STEP = 1e-6


def test_two_hundred_random_chains_against_pinocchio():
    random = np.random.default_rng(1)
    for _ in range(200):
        chain = random_chain(random)
        n, model = len(chain.masses), in_pinocchio(chain)
        motion, spin, turning, force = (random.normal(size=shape) for shape in ((3, n), 3, 3, 3))
        data, q = model.createData(), np.concatenate([[0, 0, 0, 0, 0, 0, 1], motion[0]])
        pin.framesForwardKinematics(model, data, q)
        place = data.oMf[model.getFrameId("hand")]
        position, rotation = hand_pose(chain, motion[0], DOWN)
        np.testing.assert_allclose(position, place.translation, atol=1e-10)
        np.testing.assert_allclose(rotation, place.rotation, atol=1e-10)
        kind = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        whole = pin.computeFrameJacobian(model, data, q, model.getFrameId("hand"), kind)
        jacobian = np.zeros((6, n))
        hand_jacobian(chain, motion[0], DOWN, jacobian)
        np.testing.assert_allclose(jacobian, whole[:, 6:], atol=1e-10)
        centre = pin.centerOfMass(model, data, q)
        np.testing.assert_allclose(vehicle_centre(chain, motion[0], DOWN), centre, atol=1e-10)
        # gravity as an acceleration of the base: force = a + g of the origin, which does not move
        model.gravity.linear = np.zeros(3)
        v = np.concatenate([np.zeros(3), spin, motion[1]])
        a = np.concatenate([force, turning, motion[2]])
        expected = pin.rnea(model, data, q, v, a)
        torques = np.zeros(n)
        base = tuple(force), tuple(spin), tuple(turning)
        push, moment = newton_euler(chain, motion, *base, torques, np.zeros((n, LINK, 3)))
        np.testing.assert_allclose(torques, expected[6:] + chain.armature * motion[2], atol=1e-10)
        own = pin.Inertia(chain.base_mass, chain.base_centre, chain.base_inertia)
        moves = pin.Motion(force, turning)
        base = own * moves + pin.Motion(np.zeros(3), spin).cross(own * pin.Motion(v[:3], spin))
        np.testing.assert_allclose(push, expected[:3] - base.linear, atol=1e-10)
        np.testing.assert_allclose(moment, expected[3:6] - base.angular, atol=1e-10)
        mass = np.zeros((n, n))
        mass_matrix(chain, motion[0], mass)
        expected = pin.crba(model, data, q)[6:, 6:] + np.diag(chain.armature)
        np.testing.assert_allclose(mass, expected, atol=1e-10)


TILTED = """
<mujoco>
  <compiler angle="degree"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="crate" pos="1 2 3"><geom size="0.1" mass="5"/></body>
    <body name="base" pos="0.3 -0.2 1.5" euler="10 20 30">
      <freejoint name="base"/>
      <inertial pos="0.01 0.02 -0.03" mass="2.5" diaginertia="0.02 0.025 0.03" euler="5 0 0"/>
      <body pos="0.05 0 0.02" euler="0 0 45">
        <geom type="box" size="0.03 0.02 0.01" mass="0.2"/>
      </body>
      <body name="yaw" pos="0.08 -0.03 -0.06" euler="15 -25 10">
        <joint name="a" axis="0 0 1" pos="0.01 0 0.02" armature="0.01" damping="0.02" ref="20"/>
        <geom type="capsule" fromto="0 0 0 0.02 0 -0.08" size="0.01" mass="0.15"/>
        <body name="roll" pos="0.02 0 -0.09" quat="0.9 0.1 -0.3 0.2">
          <joint name="b" axis="1 0.2 0" armature="0.02" frictionloss="0.05"/>
          <joint name="c" axis="0 -1 0.1" armature="0.005"/>
          <geom type="capsule" fromto="0 0 0 0 0.05 -0.12" size="0.012" mass="0.2"/>
          <body pos="0 0.05 -0.12" euler="40 0 0">
            <geom type="box" size="0.02 0.01 0.03" mass="0.06"/>
            <site name="claw" pos="0.01 0 -0.04" euler="0 30 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def tilted():
    model = mujoco.MjModel.from_xml_string(TILTED)
    return model, ChainReader(model, ("a", "b", "c")).chain("claw")


def test_a_tilted_offset_mount_against_mujoco(tilted):
    """Pose, centre of mass and inverse dynamics; two hinges on one body, a joint with `ref`."""
    model, chain = tilted
    assert chain.masses[1] == 0.0  # of joint b: joint c turns the whole body
    random, data = np.random.default_rng(2), mujoco.MjData(model)
    for _ in range(20):
        data.qpos[:3], data.qpos[3:7] = random.normal(size=3), unit(random.normal(size=4))
        data.qpos[7:] = random.normal(size=3)
        data.qvel[:], data.qacc[:] = random.normal(size=(2, 9))
        mujoco.mj_forward(model, data)
        data.qacc[:] = random.normal(size=9)
        accelerations = data.qacc.copy()
        mujoco.mj_inverse(model, data)
        base = model.body("base").id
        turn = data.xmat[base].reshape(3, 3).T
        q = data.qpos[7:].copy()
        below = tuple(turn @ (0.0, 0.0, -1.0))
        position, rotation = hand_pose(chain, q, below)
        site = data.site("claw")
        np.testing.assert_allclose(position, turn @ (site.xpos - data.qpos[:3]), atol=1e-12)
        np.testing.assert_allclose(rotation, turn @ site.xmat.reshape(3, 3), atol=1e-12)
        whole = turn @ (data.subtree_com[base] - data.qpos[:3])
        np.testing.assert_allclose(vehicle_centre(chain, q, below), whole, atol=1e-12)
        motion = np.stack([q, data.qvel[6:], accelerations[6:]])
        force = turn @ (accelerations[:3] + (0.0, 0.0, 9.81))
        torques, spin = np.zeros(3), data.qvel[3:6]
        base = tuple(force), tuple(spin), tuple(accelerations[3:6])
        push, moment = newton_euler(chain, motion, *base, torques, np.zeros((3, LINK, 3)))
        damping = chain.damping * motion[1]
        friction = data.qfrc_inverse[6:] - torques - damping
        np.testing.assert_allclose(friction[[0, 2]], 0.0, atol=1e-10)
        assert abs(friction[1]) <= 0.05 + 1e-9  # dry friction of joint b, which MuJoCo softens
        c, turning = chain.base_centre, accelerations[3:6]
        own = chain.base_mass * (force + np.cross(turning, c) + np.cross(spin, np.cross(spin, c)))
        np.testing.assert_allclose(turn @ data.qfrc_inverse[:3], push + own, atol=1e-10)
        gyration = chain.base_inertia @ turning + np.cross(spin, chain.base_inertia @ spin)
        expected = moment + np.cross(c, own) + gyration
        np.testing.assert_allclose(data.qfrc_inverse[3:6], expected, atol=1e-10)


def test_one_and_two_links_by_hand():
    """1 kg at 0.5 m of a link of 1 m, 2 kg at the end of the next: forward, at 10 m/s^2."""
    values = {
        "joint_offsets": [0, 0, -0.1, 0, 0, -1.0], "joint_axes": [0, -1, 0, 0, -1, 0],
        "link_masses": [1.0, 2.0], "link_centres": [0, 0, -0.5, 0, 0, -1.0],
        "link_inertias": [0.0] * 12, "hand_place": [0, 0, -1.0],
        **dict.fromkeys(("joint_armature", "joint_damping", "joint_friction"), [0.0, 0.0]),
    }  # fmt: skip
    chain = ChainParameters.from_mapping(values).chain()
    q, torques = np.array([math.pi / 2, 0.0]), np.zeros(2)
    push, moment = gravity_torque(chain, q, (0.0, 0.0, 10.0), torques)
    # 2 kg at 2 m and 1 kg at 0.5 m; 2 kg at 1 m of the elbow
    np.testing.assert_allclose(torques, [20 * 2 + 10 * 0.5, 20 * 1], atol=1e-12)
    np.testing.assert_allclose([*push, *moment], [0, 0, 30, 0, -45, 0], atol=1e-12)
    position, _ = hand_pose(chain, q, DOWN)
    np.testing.assert_allclose(position, [2.0, 0.0, -0.1], atol=1e-12)
    mass = np.zeros((2, 2))
    mass_matrix(chain, q, mass)
    np.testing.assert_allclose(mass, [[1 * 0.25 + 2 * 4, 2 * 2], [2 * 2, 2 * 1]], atol=1e-12)
    gravity_torque(carrying(chain, 3.0), q, (0.0, 0.0, 10.0), torques)
    np.testing.assert_allclose(torques, [45 + 30 * 2, 20 + 30], atol=1e-12)
    # the elbow swings: centrifugal force of 2 kg at 1 m and 3 rad/s pulls at the shoulder's side
    motion = np.array([[0.0, math.pi / 2], [0.0, 3.0], [0.0, 0.0]])
    none = [(0.0, 0.0, 0.0)] * 3
    newton_euler(chain, motion, *none, torques, np.zeros((2, LINK, 3)))
    np.testing.assert_allclose(torques, [-2 * 9 * 1.0, 0.0], atol=1e-12)


def test_the_magnet_hangs():
    """Pivot 0.1 m and 0.14 m from the shoulder, 73 mm below the base; the face 30 mm below it."""
    chain = chain_of(load_description())
    q = np.radians([45.0, 45.0])
    position, rotation = hand_pose(chain, q, DOWN)
    expected = [0.1 * math.sin(q[0]) + 0.14, 0.0, -0.073 - 0.1 * math.cos(q[0]) - 0.030]
    np.testing.assert_allclose(position, expected, atol=1e-12)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    # in a base that pitches by 0.2 rad it hangs along the vertical still
    below = (math.sin(0.2), 0.0, -math.cos(0.2))
    position, _ = hand_pose(chain, q, below)
    expected += 0.030 * (np.array(below) - DOWN)
    np.testing.assert_allclose(position, expected, atol=1e-12)


@pytest.mark.parametrize("roll", [0.0, 0.4])
def test_the_jacobian_of_what_hangs_is_the_derivative_of_its_pose(roll):
    """By central differences; a tilted hinge, too."""
    chain = chain_of(load_description("s500_arm3"))
    axis = unit(np.array([0.3, -1.0, 0.2]))
    chain = chain._replace(swing_axis=axis, axes=np.array([axis, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    q, below = np.array([0.3, -0.5, 0.4]), (0.1, math.sin(roll), -math.cos(roll))
    jacobian = np.zeros((6, 3))
    hand_jacobian(chain, q, below, jacobian)
    for i, step in enumerate(STEP * np.eye(3)):
        (after, ahead), (before, behind) = (hand_pose(chain, q + s * step, below) for s in (1, -1))
        slope = (np.array(after) - before) / (2 * STEP)
        np.testing.assert_allclose(jacobian[:3, i], slope, atol=1e-8)
        turning = (np.array(ahead) - behind) / (2 * STEP) @ np.array(ahead).T
        spin = turning[[2, 0, 1], [1, 2, 0]]
        np.testing.assert_allclose(jacobian[3:, i], spin, atol=1e-6)


# The arm of a public vehicle (T650 with an OpenMANIPULATOR-X; FSC-Lab, fsc_trajectory_planner,
# test/data/python_kinematics_t650.txt), joint 1 at the body's origin; x forward, joints at zero.
T650 = {
    "joint_offsets": [
        *(0.0, 0.0, 0.0), *(0.00007, 0.019, -0.0405), *(0.024, -0.000089, -0.128),
        *(0.128927, -0.019976, -0.02175),
    ],
    "joint_axes": [0, 0, 1, 0, -1, 0, 0, -1, 0, 0, 0, 1],
    "link_masses": [0.1048326, 0.1423463, 0.13992727, 0.2495176],
    "link_centres": [
        *(-0.00048, -0.00046, -0.031027), *(0.010093, -0.01932, -0.097295),
        *(0.083164, -0.019391, -0.000866), *(-0.005467, 0.001698, -0.039619),
    ],
    "link_inertias": [0.0] * 24, "hand_place": [0.0, 0.0, -0.108],
    **dict.fromkeys(("joint_armature", "joint_damping", "joint_friction"), [0.0] * 4),
    "base_mass": 3.10955, "base_centre": [0.0, 0.0, 0.0],
}  # fmt: skip
OFFSET = np.array([0.002, -0.0005, -0.042])  # of joint 1


@pytest.mark.parametrize(
    ("q", "hand"),  # theirs is y forward: (x, y, z) here is (y, -x, z) there
    [
        ([0.0, 0.6981317007977318, 0.6981317007977318, 0.0],
         [0.2528986252301309, -0.001565, -0.06068932796643191]),
        ([0.15283288441491982, 0.6394505150062966, 0.5203127551800792, -1.1510494295978706],
         [0.2652817330041327, 0.0392789651570241, -0.10454211384605785]),
        ([0.38647975157887937, -0.5353269568766927, 0.8392822405894937, 0.37695632176425287],
         [0.11106044573195802, 0.0435059573438962, -0.29005085481954507]),
    ],
)  # fmt: skip
def test_the_published_kinematics_of_the_t650(q, hand):
    """1e-6 m with their joint 1, which turns about the body's origin; 1.5 mm with the asset's."""
    q = np.array(q)
    for first, tolerance in ((np.zeros(3), 1e-6), (OFFSET, 1.5e-3)):
        values = T650 | {"joint_offsets": [*first, *T650["joint_offsets"][3:]]}
        second = np.array(values["joint_offsets"][3:6]) + OFFSET - first
        values["joint_offsets"][3:6] = second.tolist()
        position, _ = hand_pose(ChainParameters.from_mapping(values).chain(), q, DOWN)
        np.testing.assert_allclose(position, hand, atol=tolerance)


def test_parameters_are_the_chain():
    chain = chain_of(load_description())
    again = ChainParameters.from_mapping(as_parameters(chain)).chain()
    for name, value in chain._asdict().items():
        np.testing.assert_allclose(getattr(again, name), value, atol=1e-12, err_msg=name)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"link_masses": [1.0]}, "joint_offsets: 6 numbers, 3 expected for 1 link_masses"),
        ({"joint_axes": [0, -1, 0, 0, -2, 0]}, r"joint_axes: .* outside -1 to 1"),
        ({"joint_axes": [0, -1, 0, 0, 0.5, 0]}, "each x y z must have the length 1"),
        ({"hand_place": [0.0, 1.0]}, "hand_place: a list of 3 numbers expected"),
        ({"link_masses": [1.0] * 8}, "8 links; at most 7"),
    ],
)
def test_parameters_that_contradict_are_refused(change, text):
    values = as_parameters(chain_of(load_description())) | change
    with pytest.raises(ParameterError, match=text):
        ChainParameters.from_mapping(values)


@pytest.mark.parametrize(
    ("joints", "site", "text"),
    [
        (("a", "c"), "claw", "joint 'b' is not among: a, c"),
        (("a", "b", "c", "d"), "claw", "no joint 'd'"),
        (("a", "b"), "claw", "joint 'c' is not among: a, b"),
        (("a", "b", "c"), "jaw", "no site 'jaw'; there are: claw"),
        (("base",), "", "joint 'base' is no hinge"),
        (("b", "a"), "", "joint 'a' is not next"),
        ((), "", "0 joints; an arm has 1 to 7"),
    ],
)
def test_what_is_no_chain_is_refused(tilted, joints, site, text):
    with pytest.raises(ValueError, match=text):
        ChainReader(tilted[0], joints).chain(site)


def test_a_file_that_is_no_model_is_refused_in_one_line(tmp_path):
    file = tmp_path / "other.xml"
    vehicle = replace(load_description(), model=file)
    for text, reason in (
        ("<mujoco><worldbody><body name='base'/></worldbody></mujoco>", "no joint 'alpha_1'"),
        ("<mujoco>", "XML"),
    ):
        file.write_text(text)
        with pytest.raises(VehicleError, match=f"other.xml: .*{reason}") as caught:
            chain_of(vehicle)
        assert "\n" not in str(caught.value)
