"""Goals of the end effector: ROS messages → HandPose, HandPoints and HandTwist."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped

from uam_control.arm.hand import LEAN, TOOL, elevation, heading, lean
from uam_control.coordinates import POSITION
from uam_control.maths.rotations import matrix_from_quaternion
from uam_control.maths.vectors import rows
from uam_control.mission.hand_goals import HandPoints, HandPose, HandTwist
from uam_control.mission.motion.flyer import Flyer
from uam_control.nodes.planner_messages import check_frame, is_given, read_body
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.serialized import deserialized

LEVEL = 1e-6  # of a quaternion's x and y: a turn about the vertical is a heading alone


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
    """Return the jog of a serialized TwistStamped; raises BadMessage.

    tool: frame of the end effector.
    """
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
