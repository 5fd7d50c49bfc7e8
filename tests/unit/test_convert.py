"""Conversion between arrays and messages: round trips, order of quaternions, refusals."""

import math
import struct

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from uam_control.coordinates import arm_coordinates, coordinates
from uam_msgs_py.messages.control import (
    ATTITUDE_NAMES,
    PositionCommandWriter,
    ReferenceWriter,
    TorqueWriter,
    read_position_command,
    read_reference,
    read_state,
    read_torque,
)
from uam_msgs_py.messages.convert import (
    SWITCH,
    ImuWriter,
    JointCommandWriter,
    JointStateWriter,
    PoseWriter,
    SetpointWriter,
    TrajectoryWriter,
    read_imu,
    read_joint_command,
    read_joints,
    read_pose,
    read_switch,
)
from uam_msgs_py.messages.layouts import BadMessage, stamp_of
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.serialized import LAYOUTS

COORDINATES = coordinates(2)
JOINTS = arm_coordinates(2)

FINITE = st.floats(-1e100, 1e100)
STATES = arrays(float, (3, 8), elements=FINITE)
STAMPS = st.integers(0, 2**31 * 1_000_000_000 - 1)


STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize(
    "writer, type_name",
    [
        *((TrajectoryWriter(COORDINATES, rows), "trajectory_msgs/msg/JointTrajectory") for rows in (
            ("positions", "velocities", "accelerations"), ("effort",), ())),
        (TorqueWriter(JOINTS), "trajectory_msgs/msg/JointTrajectory"),
        (JointStateWriter(JOINTS), "sensor_msgs/msg/JointState"),
        (ImuWriter(), "sensor_msgs/msg/Imu"),
    ],
)  # fmt: skip
def test_a_message_ends_with_its_last_field(writer, type_name):
    """Strict readers, as those of bags, refuse undefined bytes after the last field."""
    data = writer.stamped(1)
    message = STORE.deserialize_cdr(data, type_name)
    assert len(STORE.serialize_cdr(message, type_name)) == len(data)  # padding is undefined


@given(STAMPS)
def test_stamps_keep_every_nanosecond(stamp):
    message = PoseStamped()
    set_stamp(message.header.stamp, stamp)
    assert stamp_of(serialize_message(message)) == stamp


@given(STATES, STAMPS)
def test_state_round_trip(state, stamp):
    data = TrajectoryWriter(COORDINATES).fill(stamp, state)
    message = deserialize_message(data, JointTrajectory)
    assert message.joint_names == list(COORDINATES)
    assert list(message.points[0].accelerations) == state[2].tolist()
    at, read = read_state(data)
    assert at == stamp
    np.testing.assert_array_equal(read, state)


def test_a_writer_is_reused():
    writer = TrajectoryWriter(COORDINATES)
    first = writer.fill(1, np.ones((3, 8)))
    second = writer.fill(2, np.full((3, 8), 2.0))
    assert read_state(first)[1].tolist() == np.ones((3, 8)).tolist(), "what was sent stays"
    assert list(deserialize_message(second, JointTrajectory).points[0].velocities) == [2.0] * 8


def test_quaternion_order_changes_at_the_edge():
    message = PoseWriter().fill(5, np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.1, -0.7, 0.5]))
    o = deserialize_message(message, PoseStamped).pose.orientation
    assert (o.x, o.y, o.z, o.w) == (0.1, -0.7, 0.5, 0.5)
    stamp, position, quaternion = read_pose(message)
    assert stamp == 5
    np.testing.assert_array_equal(position, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(quaternion, [0.5, 0.1, -0.7, 0.5])


@given(arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_unit_quaternions_pass_unchanged(raw):
    quaternion = raw / np.linalg.norm(raw)
    _, _, read = read_pose(PoseWriter().fill(0, np.zeros(3), quaternion))
    np.testing.assert_array_equal(read, quaternion)


@pytest.mark.parametrize(
    "quaternion", [(0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0)]
)
def test_a_quaternion_without_unit_norm_is_refused(quaternion):
    with pytest.raises(BadMessage, match="orientation has norm"):
        read_pose(PoseWriter().fill(0, np.zeros(3), np.array(quaternion)))


def test_another_frame_is_refused():
    message = PoseStamped()
    message.header.frame_id = "camera"
    with pytest.raises(BadMessage, match="frame 'camera', expected 'world'"):
        read_pose(serialize_message(message))


def test_imu_round_trip_has_no_orientation():
    gyro, force = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.5, 9.81])
    message = ImuWriter().fill(9, gyro, force)
    assert deserialize_message(message, Imu).orientation_covariance[0] == -1.0
    stamp, read_gyro, read_force = read_imu(message)
    assert stamp == 9
    np.testing.assert_array_equal(read_gyro, gyro)
    np.testing.assert_array_equal(read_force, force)


def test_imu_with_infinity_is_refused():
    message = ImuWriter().fill(0, np.array([0.0, math.inf, 0.0]), np.zeros(3))
    with pytest.raises(BadMessage, match="angular_velocity of y is inf, not finite"):
        read_imu(message)


def test_joints_are_found_by_name_among_others():
    message = JointState(
        name=["rotor", "alpha_2", "alpha_1"], position=[9.0, 2.0, 1.0], velocity=[8.0, 0.2, 0.1]
    )
    _, position, velocity = read_joints(serialize_message(message), list(JOINTS))
    np.testing.assert_array_equal(position, [1.0, 2.0])
    np.testing.assert_array_equal(velocity, [0.1, 0.2])


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (
            JointState(name=["alpha_1"], position=[1.0], velocity=[1.0]),
            "joint names alpha_1; expected alpha_1, alpha_2",
        ),
        (JointState(name=["alpha_1", "alpha_2"], position=[1.0, 1.0]), "0 velocities for 2 joints"),
        (
            JointState(name=["alpha_1", "alpha_2"], position=[1.0, math.nan], velocity=[0.0, 0.0]),
            "positions of alpha_2 is nan, not finite",
        ),
    ],
)
def test_bad_joint_states_are_refused(message, complaint):
    with pytest.raises(BadMessage, match=complaint):
        read_joints(serialize_message(message), list(JOINTS))


def test_joint_state_writer():
    writer = JointStateWriter(JOINTS)
    writer.position[:], writer.velocity[:], writer.effort[:] = (1.0, 2.0), (0.1, 0.2), (3.0, 4.0)
    message = writer.stamped(7)
    assert list(deserialize_message(message, JointState).effort) == [3.0, 4.0]
    stamp, position, velocity = read_joints(message, list(JOINTS))
    assert stamp == 7 and list(position) == [1.0, 2.0] and list(velocity) == [0.1, 0.2]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda m: m.joint_names.__setitem__(0, "u"), "joint names u, y"),
        (lambda m: m.points.clear(), "0 points, 1 expected"),
        (lambda m: setattr(m.points[0], "velocities", [1.0]), "1 velocities, 8 expected"),
        (
            lambda m: m.points[0].accelerations.__setitem__(3, math.nan),
            "accelerations of roll is nan, not finite",
        ),
    ],
)
def test_bad_states_are_refused(change, complaint):
    good = TrajectoryWriter(COORDINATES).fill(0, np.zeros((3, 8)))
    read_state(good)
    message = deserialize_message(good, JointTrajectory)
    change(message)
    with pytest.raises(BadMessage, match=complaint):
        read_state(serialize_message(message))


@given(STATES, st.booleans())
def test_reference_contains_only_controlled_coordinates(values, flying):
    data = ReferenceWriter(2).fill(4, values, flying, 1_500_000_000)
    message = deserialize_message(data, JointTrajectory)
    assert message.joint_names == list(COORDINATES if flying else JOINTS)
    assert message.points[0].time_from_start.sec == 1
    stamp, reference = read_reference(data)
    assert stamp == 4 and reference.flying == flying
    np.testing.assert_array_equal(reference.values[:, 6:], values[:, 6:])
    np.testing.assert_array_equal(reference.values[:, :6], values[:, :6] if flying else 0.0)


@pytest.mark.parametrize("joints", [1, 3])
def test_a_message_for_another_number_of_joints_is_refused(joints):
    state = np.zeros((3, 6 + joints))
    good = TrajectoryWriter(coordinates(joints)).fill(4, state)
    assert read_state(good, joints)[1].shape == state.shape
    with pytest.raises(BadMessage, match="expected x, .*alpha_2"):
        read_state(good, 2)
    for flying in (False, True):
        with pytest.raises(BadMessage, match="expected .*alpha_2"):
            read_reference(ReferenceWriter(joints).fill(4, state, flying, 0), 2)


def test_position_command_round_trip():
    reference = np.arange(24.0).reshape(3, 8)
    attitude, tau = -np.arange(9.0).reshape(3, 3), np.array([1.0, 2.0, 22.0])
    writer = PositionCommandWriter()
    data = writer.fill(8, reference, attitude, tau)
    (point,) = deserialize_message(data, JointTrajectory).points
    assert list(point.positions[:3]) == [0.0, 1.0, 2.0]
    assert list(point.effort) == [1.0, 2.0, 22.0, 0.0, 0.0, 0.0]
    stamp, command = read_position_command(data)
    assert stamp == 8 and command.flying
    np.testing.assert_array_equal(command.attitude, attitude)
    np.testing.assert_array_equal(command.tau, tau)


def test_idle_commands_are_empty_but_stamped():
    stamp, command = read_position_command(PositionCommandWriter().idle(12))
    assert stamp == 12 and not command.flying and not command.tau.any()
    assert read_torque(TorqueWriter(ATTITUDE_NAMES).idle(12)) == (12, None)


def test_torque_round_trip_and_refusal():
    message = TorqueWriter(ATTITUDE_NAMES).fill(3, np.array([0.5, -0.25, 0.125]))
    stamp, torque = read_torque(message)
    assert stamp == 3 and list(torque) == [0.5, -0.25, 0.125]
    with pytest.raises(BadMessage, match="expected roll, pitch, yaw"):
        read_torque(TorqueWriter(list(JOINTS)).fill(3, np.array([0.5, -0.25])))


def test_effort_and_setpoint():
    data = JointCommandWriter(2).fill(np.array([0.5, -0.5]))
    assert list(deserialize_message(data, Float64MultiArray).data) == [0.5, -0.5]
    assert list(read_joint_command(data, JOINTS)) == [0.5, -0.5]
    with pytest.raises(BadMessage, match="3 joint commands, 2 expected"):
        read_joint_command(serialize_message(Float64MultiArray(data=[1.0, 2.0, 3.0])), JOINTS)
    data = SetpointWriter().fill(6, np.array([0.1, 0.2, 0.3]), 0.6)
    setpoint = deserialize_message(data, TwistStamped)
    rates = setpoint.twist.angular
    assert setpoint.header.stamp.nanosec == 6 and (rates.x, rates.y, rates.z) == (0.1, 0.2, 0.3)
    assert setpoint.twist.linear.z == 0.6


def test_a_switch():
    for on in (False, True):
        assert deserialize_message(SWITCH[on], Bool).data is on
        assert read_switch(SWITCH[on]) is on
    with pytest.raises(BadMessage, match="4 bytes, too short"):
        read_switch(SWITCH[True][:4])


@given(st.integers(0, 400), st.data())
def test_a_truncated_or_corrupted_message_is_read_or_refused(length, data):
    good = TrajectoryWriter(COORDINATES).fill(5, np.ones((3, 8)))
    read_state(good)  # stores the layout
    end = LAYOUTS[JointTrajectory].of(good).duration.stop  # padding may follow
    cut = good[: min(length, end - 1)]
    with pytest.raises(BadMessage):
        read_state(cut)
    at = data.draw(st.integers(0, len(good) - 1))
    garbled = good[:at] + bytes([data.draw(st.integers(0, 255))]) + good[at + 1 :]
    try:
        _, state = read_state(garbled)
    except BadMessage:
        return
    assert np.isfinite(state).all()


def test_rows_of_other_lengths_but_the_same_total_size_are_refused():
    good = deserialize_message(
        TrajectoryWriter(COORDINATES).fill(0, np.ones((3, 8))), JointTrajectory
    )
    read_state(serialize_message(good))
    good.points[0].effort, good.points[0].accelerations = good.points[0].accelerations, []
    with pytest.raises(BadMessage, match="0 accelerations, 8 expected"):
        read_state(serialize_message(good))


def test_the_other_byte_order_is_read():
    little = serialize_message(PoseStamped())
    values = [0.5, -1.5, 2.5, 0.0, 0.0, 0.0, 1.0]
    big = b"\0\0\0\0" + struct.pack(">iI", 7, 9) + struct.pack(">I6s", 6, b"world\0")
    big += bytes(-(len(big) - 4) % 8) + struct.pack(">7d", *values)
    assert little[:4] == b"\0\1\0\0"
    stamp, position, quaternion = read_pose(big)
    assert stamp == stamp_of(big) == 7_000_000_009
    assert position.tolist() == values[:3] and quaternion.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_new_names_use_bounded_memory():
    for number in range(100):
        message = JointState(name=[f"joint_{number}"], position=[0.0], velocity=[0.0])
        with pytest.raises(BadMessage, match=f"joint_{number};"):
            read_joints(serialize_message(message), list(JOINTS))
    assert sum(map(len, LAYOUTS[JointState]._known.values())) <= 32
