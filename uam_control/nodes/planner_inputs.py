"""Ways into the mission node for planners: goal pose and trajectories, each with an answer.

The topics: docs/scenarios.md, Planners; docs/end_effector.md, Commands; types: docs/interfaces.md.

The answer is a line in the log (at most one accepted and one refused per second and topic), an
entry in /diagnostics, and `answers` (how many goals and trajectories were answered) with `answer`
(the newest) in the mission status.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped

from uam_control.arm.hand import LEAN, TOOL, elevation, heading, lean
from uam_control.coordinates import POSITION
from uam_control.maths.rotations import matrix_from_quaternion
from uam_control.maths.vectors import rows
from uam_control.mission import Mission
from uam_control.mission.hand_goals import HandPoints, HandPose, HandTwist
from uam_control.mission.motion.flatness import Flyer
from uam_control.mission.plans import Goal
from uam_control.nodes.planner_messages import (
    check_frame,
    is_given,
    read_arm_trajectory,
    read_base_trajectory,
    read_body,
    read_goal,
)
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.serialized import deserialized
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.namespace import frame

LEVEL = 1e-6  # of a quaternion's x and y: a turn about the vertical is a heading alone
LOG_PERIOD = 1_000_000_000  # [ns] from one line of a topic's answers to the next


def read_hand_goal(data: bytes, flyer: Flyer | None) -> HandPose:
    """Return the goal of a serialized PoseStamped; raises BadMessage, also without a hand.

    An orientation of zeros or NaN keeps the heading. A turn about the vertical is a heading; any
    other orientation is that of the tool.
    """
    message = deserialized(data, PoseStamped)
    check_frame(message.header.frame_id)
    p, q = message.pose.position, message.pose.orientation
    angles = _angles(q.x, q.y, q.z, q.w)
    return HandPose(_with_hand(flyer), np.array([p.x, p.y, p.z, *angles]))


def read_hand_trajectory(data: bytes, flyer: Flyer | None) -> HandPoints:
    """Return the points of a serialized MultiDOFJointTrajectory of the hand; raises BadMessage.

    Orientations: see `read_hand_goal`; velocities and accelerations as of the base.
    """
    body = read_body(data, "the end effector")
    wanted = np.empty((len(body.times), len(TOOL)))
    wanted[:, POSITION] = body.positions
    for i, quaternion in enumerate(body.rotations):
        if not is_given(*quaternion):
            raise BadMessage(f"point {i}: the rotation is no quaternion")
        wanted[i, 3:] = _angles(*quaternion)
    free = np.isnan(wanted[:, LEAN])
    if free.any() and not free.all():
        raise BadMessage("some points have an elevation and some have none: all or none expected")
    return HandPoints(_with_hand(flyer), body.times, wanted, body.rates)


def read_hand_twist(data: bytes, flyer: Flyer | None, tool: str) -> HandTwist:
    """Return the jog of a serialized TwistStamped; raises BadMessage. tool: the hand's frame."""
    message = deserialized(data, TwistStamped)
    frame = message.header.frame_id
    if frame != tool:
        check_frame(frame)
    velocities = message.twist.linear, message.twist.angular
    linear, angular = (np.array([one.x, one.y, one.z]) for one in velocities)
    return HandTwist(_with_hand(flyer), linear, angular, frame == tool)


def _with_hand(flyer: Flyer | None) -> Flyer:
    if flyer is None:
        raise BadMessage("no hand: the vehicle has no end effector")
    return flyer


def _angles(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return heading, elevation and lean [rad] of an orientation, NaN where it leaves them open."""
    if not is_given(x, y, z, w):
        return math.nan, math.nan, math.nan
    quaternion = np.array([w, x, y, z])
    turn = rows(matrix_from_quaternion(quaternion / np.linalg.norm(quaternion)))
    if math.hypot(x, y) < LEVEL:
        return heading(turn), math.nan, math.nan
    return heading(turn), elevation(turn), lean(turn)


class PlannerInputs:
    """Subscriptions for planners; `answers`, `answer`: for the mission status."""

    def __init__(
        self,
        node: UamNode,
        mission: Mission,
        joints: Sequence[str],
        flyer: Flyer | None,
        publish: Callable[[], None],
    ):
        """joints: their names; flyer: of the end effector, None without one; publish: publishes
        the mission status."""
        self._node, self._mission, self._publish = node, mission, publish
        self.answers, self.answer = 0, ""
        self._take(topics.GOAL_POSE, read_goal)
        self._take(topics.BASE_TRAJECTORY, read_base_trajectory)
        self._take(topics.ARM_TRAJECTORY, lambda data: read_arm_trajectory(data, joints))
        tool = frame(node, topics.TOOL)
        self._take(topics.END_EFFECTOR_GOAL, partial(read_hand_goal, flyer=flyer))
        self._take(topics.END_EFFECTOR_TRAJECTORY, partial(read_hand_trajectory, flyer=flyer))
        self._take(topics.END_EFFECTOR_TWIST, partial(read_hand_twist, flyer=flyer, tool=tool))

    def _take(self, topic: topics.Topic, read: Callable[[bytes], Goal]) -> None:
        logged: dict[bool, int] = {}  # accepted → stamp of the newest line

        def handle(data: bytes) -> None:
            try:
                accepted, text = self._mission.plan(read(data))
            except BadMessage as error:
                accepted, text = False, f"refused: {error}"
            self.answers, self.answer = self.answers + 1, f"{topic.name}: {text}"
            self._publish()
            now = self._node.stamp
            if accepted in logged and 0 <= now - logged[accepted] < LOG_PERIOD:
                return  # a stream of goals
            logged[accepted] = now
            self._node.note(self.answer, not accepted)

        self._node.listen(topic, handle, required=False, qos=topic.qos, raw=True)
