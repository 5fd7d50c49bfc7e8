"""The mission node's topics for planners, and nav_msgs of plan and estimate."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Transform, TwistStamped
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)
from vehicle_rig import Vehicle, take_off

from uam_lab.flights.operator import HAND_PLANNERS, PLANNERS
from uam_msgs_py.messages import topics


@pytest.fixture
def vehicle(start, probe):
    start("uam_control.nodes.mission", "--ros-args", "-p", "scenario:=hover")
    made = Vehicle(probe)
    made.planners = {topic: probe.publisher(topic) for topic in PLANNERS + HAND_PLANNERS}
    made.path = probe.collect(topics.PATH)
    publishers = made.planners.values()
    probe.until(lambda: all(p.get_subscription_count() for p in publishers), "subscriptions")
    probe.until(lambda: probe.has_writers(topics.PATH), "a path")
    made.fly(1)
    return made


def answer(vehicle, topic, message):
    """Send a message to the mission; return its answer after a tick."""
    before = vehicle.status.answers
    vehicle.planners[topic].publish(message)
    vehicle.probe.until(lambda: vehicle.status.answers > before, "an answer")
    assert vehicle.status.answers == before + 1
    name, _, text = vehicle.status.answer.partition(": ")
    assert name == topic.name
    return text


def goal(x, y, z, yaw=None, frame="world"):
    message = PoseStamped()
    message.header.frame_id = frame
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = x, y, z
    turn.w, turn.z = (0.0, 0.0) if yaw is None else (math.cos(yaw / 2), math.sin(yaw / 2))
    return message


def base_trajectory(*rows):
    """Return a trajectory of rows (time, x, y, z), without velocities."""
    message = MultiDOFJointTrajectory(joint_names=["base_link"])
    message.header.frame_id = "world"
    for time, x, y, z in rows:
        point, at = MultiDOFJointTrajectoryPoint(), Transform()
        at.translation.x, at.translation.y, at.translation.z = x, y, z
        point.transforms = [at]
        point.time_from_start.sec, rest = divmod(time, 1)
        point.time_from_start.nanosec = round(rest * 1e9)
        message.points.append(point)
    return message


def arm_trajectory(names, *rows, velocities=False):
    message = JointTrajectory(joint_names=list(names))
    for time, *angles in rows:
        point = JointTrajectoryPoint(positions=angles)
        point.velocities = [0.0] * len(angles) if velocities else []
        point.time_from_start.sec = time
        message.points.append(point)
    return message


def test_goals_and_trajectories_are_answered_and_flown(vehicle):
    far = answer(vehicle, topics.GOAL_POSE, goal(0.5, 0.0, 1.0))
    assert far == "refused: not while grounded"
    take_off(vehicle)
    here = vehicle.state[0].copy()

    text = answer(vehicle, topics.GOAL_POSE, goal(9.0, 0.0, 1.0))
    assert text.startswith("refused: x is 9.00 m after") and "allowed -5 to 5 m" in text
    assert "frame_id 'map'" in answer(vehicle, topics.GOAL_POSE, goal(0.0, 0.0, 1.0, 0.0, "map"))
    tilted = goal(0.0, 0.0, 1.0, 0.0)
    tilted.pose.orientation.w, tilted.pose.orientation.x = math.cos(0.3), math.sin(0.3)
    assert "tilted by 0.60 rad" in answer(vehicle, topics.GOAL_POSE, tilted)
    assert "not finite" in answer(vehicle, topics.GOAL_POSE, goal(math.nan, 0.0, 1.0))
    twice = arm_trajectory(["alpha_1", "alpha_1"], (1, 0.0, 0.0))
    assert "expected: " in answer(vehicle, topics.ARM_TRAJECTORY, twice)
    backwards = base_trajectory((2, *here[:3]), (1, *here[:3]))
    assert "must be at least" in answer(vehicle, topics.BASE_TRAJECTORY, backwards)
    vehicle.fly(2)
    assert vehicle.status.phase != "goal" and vehicle.status.state == "flying"

    text = answer(vehicle, topics.GOAL_POSE, goal(0.3, 0.0, 1.0, 0.4))
    assert text.startswith("accepted: at the end in ")
    vehicle.fly(2)
    vehicle.until(lambda status: status.phase == "goal")
    vehicle.until_state("holding")
    np.testing.assert_allclose(vehicle.state[0, [0, 1, 2, 5]], [0.3, 0.0, 1.0, 0.4], atol=1e-9)
    end = vehicle.path[-1].poses[-1].pose.position
    assert vehicle.path[-1].header.frame_id == "world"
    assert (end.x, end.y, end.z) == pytest.approx((0.3, 0.0, 1.0))

    # the same goal again changes nothing; a stream of it neither
    for _ in range(5):
        assert answer(vehicle, topics.GOAL_POSE, goal(0.3, 0.0, 1.0, 0.4)) == (
            "accepted: at the end in 0.0 s"
        )
        vehicle.fly(2)
    assert vehicle.status.state == "holding"

    # RViz's 2D tool sends z = 0
    assert answer(vehicle, topics.GOAL_POSE, goal(0.2, 0.0, 0.0)).startswith("accepted")
    vehicle.until_state("flying")
    vehicle.until_state("holding")
    np.testing.assert_allclose(vehicle.state[0, [0, 1, 2, 5]], [0.2, 0.0, 1.0, 0.4], atol=1e-9)

    names, angles = ["joint_2", "joint_1"], vehicle.state[0, 6:]
    text = answer(vehicle, topics.ARM_TRAJECTORY, arm_trajectory(names, (1, 0.0, 0.0)))
    names = text.partition("expected: ")[2].split(", ")
    arm = arm_trajectory(names[::-1], (0, angles[1], angles[0]), (2, 1.2, 0.2), velocities=True)
    line = base_trajectory((0, 0.2, 0.0, 1.0), (2, 0.5, 0.0, 1.1))
    assert answer(vehicle, topics.BASE_TRAJECTORY, line).startswith(
        "refused: the first point is 0.40 rad"
    )
    for point in line.points:
        turn = point.transforms[0].rotation
        turn.w, turn.z = math.cos(0.2), math.sin(0.2)
    assert answer(vehicle, topics.ARM_TRAJECTORY, arm).startswith("accepted")
    assert answer(vehicle, topics.BASE_TRAJECTORY, line).startswith("accepted")
    vehicle.until_state("flying")
    vehicle.until_state("holding")
    found = vehicle.state[0, [0, 1, 2, 5, 6, 7]]
    np.testing.assert_allclose(found, [0.5, 0.0, 1.1, 0.4, 0.2, 1.2], atol=1e-9)
    assert vehicle.ask("land")[0]
    vehicle.until_state("landing")
    assert answer(vehicle, topics.GOAL_POSE, goal(0.0, 0.0, 1.0)) == "refused: not while landing"


def test_a_stream_of_goals_arrives(vehicle):
    """20 Hz, each 2 mm farther; then the last one again and again."""
    take_off(vehicle)
    begun = vehicle.stamp
    for i in range(100):
        text = answer(vehicle, topics.GOAL_POSE, goal(min(0.4 + 0.002 * i, 0.5), 0.0, 1.0, 0.0))
        assert text.startswith("accepted"), text
        vehicle.fly(12)
        if vehicle.status.state == "holding":
            break
    vehicle.until_state("holding")
    np.testing.assert_allclose(vehicle.state[0, [0, 1, 2, 5]], [0.5, 0, 1, 0], atol=1e-9)
    assert vehicle.stamp - begun < 6.0e9


def twist(frame, x, turn=0.0):
    message = TwistStamped()
    message.header.frame_id = frame
    message.twist.linear.x, message.twist.angular.y = x, turn
    return message


def test_the_hand_is_commanded_by_pose_trajectory_and_twist(vehicle):
    """The S-500's hand is 0.14 m ahead of the base and 0.203 m below it while the arm is stowed."""
    take_off(vehicle)
    for topic, message, reason in (
        (topics.END_EFFECTOR_GOAL, goal(9.0, 0.0, 1.0), "out of reach: the base would be at x"),
        (topics.END_EFFECTOR_GOAL, goal(0.0, 0.0, -0.1), "out of reach: the hand's z is -0.10 m"),
        (topics.END_EFFECTOR_GOAL, goal(0.0, 0.0, 1.0, 0.0, "map"), "frame_id 'map'"),
        (topics.END_EFFECTOR_GOAL, goal(math.nan, 0.0, 1.0), "a coordinate of the goal is not"),
        (topics.END_EFFECTOR_TWIST, twist("base_link", 0.1), "frame_id 'base_link'"),
        (topics.END_EFFECTOR_TWIST, twist("", 0.0, 0.2), "out of reach: the arm cannot turn"),
        (topics.END_EFFECTOR_TWIST, twist("", math.nan), "a velocity is not finite"),
        (topics.END_EFFECTOR_TRAJECTORY, base_trajectory((0, 9.0, 0.0, 1.0)), "out of reach"),
        (topics.END_EFFECTOR_TRAJECTORY, base_trajectory((1, 0, 0, 1.0), (1, 0, 0, 1.0)), "must"),
    ):
        text = answer(vehicle, topic, message)
        assert text.startswith("refused: ") and reason in text, text

    text = answer(vehicle, topics.END_EFFECTOR_GOAL, goal(0.4, 0.0, 0.7, 0.3))
    assert text.startswith("accepted: at the end in "), text
    vehicle.fly(2)
    vehicle.until_state("holding")
    found, (c, s) = vehicle.state[0], (math.cos(0.3), math.sin(0.3))
    np.testing.assert_allclose(
        found[[0, 1, 2, 5, 6, 7]],
        [0.4 - 0.14 * c, -0.14 * s, 0.903, 0.3, 0.0, math.pi / 2],
        atol=1e-9,
    )

    for _ in range(30):  # 20 Hz
        text = answer(vehicle, topics.END_EFFECTOR_TWIST, twist("end_effector", 0.1))
        assert text.startswith("accepted: slowed down to 0.0175 m/s, 0 rad/s"), text
        vehicle.fly(12)
    assert vehicle.state[1, :2] == pytest.approx([0.0175 * c, 0.0175 * s], abs=5e-4)
    vehicle.fly(63)  # with the last 12 ticks 0.3 s
    assert np.hypot(*vehicle.state[1, :2]) < 5e-3
    vehicle.fly(40)
    assert not vehicle.state[1].any()

    x, y, z = vehicle.state[0, :3] + [0.14 * c, 0.14 * s, -0.203]
    line = base_trajectory((0, x, y, z), (3, x + 0.3, y, z))
    for point in line.points:
        point.transforms[0].rotation.z, point.transforms[0].rotation.w = (
            math.sin(0.15),
            math.cos(0.15),
        )
    assert answer(vehicle, topics.END_EFFECTOR_TRAJECTORY, line).startswith("accepted")
    vehicle.until_state("flying")
    vehicle.until_state("holding")
    np.testing.assert_allclose(vehicle.state[0, :2], [x + 0.3 - 0.14 * c, y - 0.14 * s], atol=1e-9)
