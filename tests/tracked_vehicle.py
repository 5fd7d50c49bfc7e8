"""Poses that a tracker records of a vehicle on the floor, for the tests of the calibration."""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
)
from uam_sim_bridge.devices.mocap.frame import BodyPose
from uam_sim_bridge.devices.mocap.measurement import TimedPose

RATE = 120.0
STANDING = 0.28  # [m] base_link above the floor
# ENU → the tracker's axes, rows: Y up has x, up, and -north
AXES = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
}
_TURNS = {"y": np.array([0.5**0.5, -(0.5**0.5), 0.0, 0.0]), "z": np.array([1.0, 0.0, 0.0, 0.0])}


@dataclass
class TrackedBody:
    """A body of the server.

    up: the tracker's upward axis; made_at (4,) [w x y z]: attitude FLU → ENU of the vehicle when
    the rigid body was made, along whose axes at that time it lies; pivot (3,) [m, FLU]: its pivot,
    from base_link.
    """

    name: str
    up: str = "y"
    made_at: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    pivot: tuple[float, ...] = (0.0, 0.0, 0.0)

    def seen(
        self, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return position x y z [m] and rotation x y z w in the tracker's axes.

        position (3,) [m, ENU] and quaternion (4,) [w x y z], FLU → ENU, of base_link. The rotation
        is that since the body was made, in the tracker's axes.
        """
        marked = position + matrix_from_quaternion(quaternion) @ np.array(self.pivot)
        turn = _TURNS[self.up]
        since = quaternion_multiply(quaternion, _inverse(np.array(self.made_at)))
        turned = quaternion_multiply(quaternion_multiply(turn, since), _inverse(turn))
        return tuple(AXES[self.up] @ marked), (*turned[1:], turned[0])


def _inverse(quaternion: np.ndarray) -> np.ndarray:
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])


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
