"""Array-wise decoding gives what ROS's own deserialization gives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_lab.records.recording import logged_topics

serialization = pytest.importorskip("rclpy.serialization")
serialize = serialization.serialize_message

NUMBERS = st.floats(allow_nan=False, width=64)


def header(k, frame="world"):
    from builtin_interfaces.msg import Time
    from std_msgs.msg import Header

    return Header(stamp=Time(sec=k, nanosec=k + 1), frame_id=frame)


def trajectory(k, names, rows, frame="world"):
    from builtin_interfaces.msg import Duration
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    if not rows:
        return JointTrajectory(header=header(k, frame), joint_names=names)
    positions, velocities, accelerations, effort = rows
    point = JointTrajectoryPoint(
        positions=positions,
        velocities=velocities,
        accelerations=accelerations,
        effort=effort,
        time_from_start=Duration(sec=-k, nanosec=k),
    )
    return JointTrajectory(header=header(k, frame), joint_names=names, points=[point])


@settings(max_examples=60, deadline=None)
@given(
    names=st.lists(st.text(st.characters(codec="ascii", exclude_characters="\0")), max_size=9),
    lengths=st.tuples(*[st.integers(0, 9)] * 4),
    frame=st.sampled_from(["", "w", "wo", "wor", "world"]),
    data=st.data(),
)
def test_any_trajectory_is_decoded(names, lengths, frame, data):
    rows = [data.draw(st.lists(NUMBERS, min_size=n, max_size=n)) for n in lengths]
    messages = [serialize(trajectory(k, names, rows, frame)) for k in range(3)]
    size = max(map(len, messages))  # the serializer may append bytes that mean nothing
    padded = [message.ljust(size, b"\xaa") for message in messages]
    (block,) = logged_topics.read_blocks("trajectory_msgs/msg/JointTrajectory", padded)
    assert block.names == names
    assert block.stamps.tolist() == [k * 10**9 + k + 1 for k in range(3)]
    assert block.fields["time_from_start"].tolist() == [-k * 10**9 + k for k in range(3)]
    for field, row in zip(
        ("positions", "velocities", "accelerations", "effort"), rows, strict=True
    ):
        if row:
            assert np.array_equal(block.fields[field], [row] * 3)
        else:
            assert field not in block.fields


def test_layouts_that_alternate_are_distinguished():
    arm = ["alpha_1", "alpha_2"]
    eight = ["x", "y", "z", "roll", "pitch", "yaw", *arm]
    messages = [
        trajectory(0, [], None),
        trajectory(1, arm, [[1.0, 2.0], [], [], []]),
        trajectory(2, eight, [[float(i) for i in range(8)], [], [], []]),
        trajectory(3, arm, [[3.0, 4.0], [], [], []]),
        trajectory(4, [], None),
    ]
    blocks = logged_topics.read_blocks(
        "trajectory_msgs/msg/JointTrajectory", [serialize(m) for m in messages]
    )
    by_names = {tuple(block.names): block for block in blocks}
    assert by_names[tuple(arm)].order.tolist() == [1, 3]
    assert by_names[tuple(arm)].fields["positions"].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert by_names[tuple(eight)].fields["positions"].tolist() == [list(range(8))]
    assert by_names[()].order.tolist() == [0, 4]
    assert by_names[()].fields == {}


def test_states_poses_and_twists():
    from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
    from sensor_msgs.msg import JointState

    state = JointState(
        header=header(1), name=["a", "bc"], position=[1.0, 2.0], velocity=[], effort=[3.0, 4.0]
    )
    (block,) = logged_topics.read_blocks("sensor_msgs/msg/JointState", [serialize(state)])
    assert block.names == ["a", "bc"] and set(block.fields) == {"position", "effort"}
    assert block.fields["effort"].tolist() == [[3.0, 4.0]]
    pose = PoseStamped(
        header=header(2, "odd"),
        pose=Pose(
            position=Point(x=1.0, y=2.0, z=3.0), orientation=Quaternion(x=0.1, y=0.2, z=0.3, w=0.4)
        ),
    )
    (block,) = logged_topics.read_blocks("geometry_msgs/msg/PoseStamped", [serialize(pose)])
    assert block.fields["position"].tolist() == [[1.0, 2.0, 3.0]]
    assert block.fields["orientation"].tolist() == [[0.1, 0.2, 0.3, 0.4]]
    twist = TwistStamped(
        header=header(3),
        twist=Twist(linear=Vector3(z=0.5), angular=Vector3(x=1.0, y=2.0, z=3.0)),
    )
    (block,) = logged_topics.read_blocks("geometry_msgs/msg/TwistStamped", [serialize(twist)])
    assert block.fields["linear"].tolist() == [[0.0, 0.0, 0.5]]
    assert block.fields["angular"].tolist() == [[1.0, 2.0, 3.0]]
    assert block.stamps.tolist() == [3_000_000_004]
