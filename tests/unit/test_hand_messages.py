"""Messages for the hand: what an orientation leaves open, and what is refused."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import PoseStamped, Transform, TwistStamped
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from uam_control.mission.motion.flatness import Flyer
from uam_control.nodes.planner_inputs import read_hand_goal, read_hand_trajectory, read_hand_twist
from uam_control.vehicle import load_description
from uam_msgs_py.messages.layouts import BadMessage

FLYER = Flyer.of(load_description("t650"))
HALF = math.sqrt(0.5)


def goal(*wxyz):
    message = PoseStamped()
    message.pose.position.x, message.pose.position.z = 1.0, 2.0
    turn = message.pose.orientation
    turn.w, turn.x, turn.y, turn.z = wxyz
    return serialize_message(message)


@pytest.mark.parametrize(
    ("wxyz", "angles"),
    [
        ((0.0, 0.0, 0.0, 0.0), (math.nan,) * 3),
        ((math.nan, 0.0, 0.0, 0.0), (math.nan,) * 3),
        ((HALF, 0.0, 0.0, HALF), (math.pi / 2, math.nan, math.nan)),
        ((HALF, 0.0, HALF, 0.0), (0.0, -math.pi / 2, 0.0)),  # x axis down
        ((math.cos(0.2), math.sin(0.2), 0.0, 0.0), (0.0, 0.0, 0.4)),  # y axis raised
    ],
)
def test_an_orientation_is_a_heading_or_that_of_the_tool(wxyz, angles):
    wanted = read_hand_goal(goal(*wxyz), FLYER).wanted
    np.testing.assert_allclose(wanted, [1.0, 0.0, 2.0, *angles], atol=1e-12)


def test_a_vehicle_without_end_effector_has_no_hand():
    for read, message in (
        (read_hand_goal, goal(1.0, 0.0, 0.0, 0.0)),
        (read_hand_trajectory, serialize_message(MultiDOFJointTrajectory())),
        (lambda data, flyer: read_hand_twist(data, flyer, ""), serialize_message(TwistStamped())),
    ):
        with pytest.raises(BadMessage, match="no hand: the vehicle has no end effector"):
            read(message, None)


def test_a_twist_is_in_the_world_or_in_its_own_tool():
    message = TwistStamped()
    message.twist.linear.y, message.twist.angular.z = 0.1, 0.2
    for frame, of_tool in (("", False), ("world", False), ("uav1/end_effector", True)):
        message.header.frame_id = frame
        found = read_hand_twist(serialize_message(message), FLYER, "uav1/end_effector")
        assert found.of_tool is of_tool
        np.testing.assert_array_equal([*found.linear, *found.angular], [0, 0.1, 0, 0, 0, 0.2])
    message.header.frame_id = "end_effector"
    with pytest.raises(BadMessage, match="frame_id 'end_effector', 'world' expected"):
        read_hand_twist(serialize_message(message), FLYER, "uav1/end_effector")


def test_the_points_of_a_trajectory_all_have_an_elevation_or_none():
    message = MultiDOFJointTrajectory(joint_names=["hand"])
    for k in range(2):
        place = Transform()
        place.rotation.w, place.rotation.y = (1.0, 0.0) if k else (HALF, HALF)
        point = MultiDOFJointTrajectoryPoint(transforms=[place])
        point.time_from_start.sec = k
        message.points.append(point)
    with pytest.raises(BadMessage, match="some points have an elevation"):
        read_hand_trajectory(serialize_message(message), FLYER)
    message.points.pop()
    found = read_hand_trajectory(serialize_message(message), FLYER)
    np.testing.assert_allclose(found.wanted, [[0, 0, 0, 0, -math.pi / 2, 0]], atol=1e-12)
    assert np.isnan(found.rates).all() and found.times.tolist() == [0.0]
