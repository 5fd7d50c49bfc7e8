"""Poses that a tracker records of a vehicle on the floor, for the tests of the calibration."""

import math

import numpy as np

from uam_control.maths.rotations import quaternion_from_euler, quaternion_multiply
from uam_sim_bridge.devices.mocap.frame import BodyPose
from uam_sim_bridge.devices.mocap.measurement import TimedPose

RATE = 120.0
STANDING = 0.28  # [m] base_link above the floor


def standing(at, heading, tilt=(0.0, 0.0)):
    """Position and quaternion of a vehicle on the floor; at (2,) [m], angles [rad]."""
    quaternion = quaternion_from_euler(np.array([*tilt, heading]))
    return np.array([*at, STANDING]), quaternion


def ahead(at, heading, distance):
    """The place [m] after a straight move nose first."""
    return at[0] + distance * math.cos(heading), at[1] + distance * math.sin(heading)


def recorded(body, place, count=240, begun=0.0, noise=(0.0, 0.0), drift=(0.0, 0.0, 0.0), seed=0):
    """TimedPoses of `body` at a place; noise: [m], [rad]; drift (3,): [m/s], ENU."""
    position, quaternion = place
    random, found = np.random.default_rng(seed), []
    for k in range(count):
        turn = quaternion_from_euler(noise[1] * random.standard_normal(3))
        moved = position + np.array(drift) * k / RATE + noise[0] * random.standard_normal(3)
        at, turned = body.seen(moved, quaternion_multiply(quaternion, turn))
        pose = BodyPose(np.array(at), np.roll(np.array(turned), 1))
        found.append(TimedPose(begun + k / RATE, pose))
    return found


def moving(body, begin, end, heading, count=120, begun=0.0):
    """TimedPoses on the way from one place [m] to another."""
    found = []
    for k in range(count):
        part = (k + 1) / (count + 1)
        at = [a + part * (b - a) for a, b in zip(begin, end, strict=True)]
        found += recorded(body, standing(at, heading), 1, begun + k / RATE)
    return found
