"""Poses of an odometry without its jumps.

The frame of an odometry drifts, and jumps when it recognises a place (loop closure). A pose that is
not where the last ones lead has jumped. The jump is taken out of the poses at once: the vehicle
does not move. What was taken out is then given back slowly, RETURN and TURN_BACK at most, so that
the vehicle flies smoothly into the frame that the odometry believes in. Roll and pitch are those of
gravity and do not jump.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.ages import BRIDGED
from uam_control.estimation.pose_clock import repeated
from uam_control.maths.compiled import jit, prepared
from uam_control.maths.memory import Number, record
from uam_control.maths.rotations import (
    euler_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)
from uam_control.settings.parameter_set import ParameterSet, choice

MOCAP, ODOMETRY = "mocap", "odometry"  # where the poses come from
RETURN, TURN_BACK = 0.1, 0.1  # m/s, rad/s
# m, rad: a pose that is farther than this, and what an acceleration (m/s^2, rad/s^2) makes in the
# time since the last one, from where those lead has jumped. A smaller jump is left to the estimate
JUMP, TURN_JUMP = 0.03, 0.03
AGILE, SPIN = 5.0, 10.0
SMOOTH = 0.05  # s, time constant of the velocity at which the poses go on
YAW, PLACE = 3, 4  # a place: x, y, z [m], yaw [rad]
POSE = 7  # position and quaternion


@dataclass(frozen=True)
class PoseSourceParameters(ParameterSet):
    """Source of the poses, of all nodes that read them; fixed once the node runs."""

    pose_source: str = choice(
        MOCAP,
        "poses of a motion capture, or of an odometry (odometry/in), whose jumps are taken out",
        (MOCAP, ODOMETRY),
    )


class AnchorArrays(NamedTuple):
    """State of a `PoseAnchor`."""

    newest: np.ndarray  # (4,) place of the odometry
    rates: np.ndarray  # (4,) of that [m/s, rad/s]
    offset: np.ndarray  # (4,) from its frame to that of the poses given
    raw: np.ndarray  # (7,) newest pose before
    given: np.ndarray  # (7,) and after
    numbers: np.ndarray  # (1,) WHOLE, REAL


# jumps: how many were taken out; stamp [s]: of the newest pose, NaN before the first; distance [m]
# and turn [rad] of the newest jump
WHOLE, REAL = "jumps", "stamp distance turn"


class PoseAnchor:
    """Takes the jumps out of the poses of an odometry; see WHOLE, REAL; `arrays`: the state."""

    jumps, distance, turn = Number(), Number(), Number()

    def __init__(self) -> None:
        self.memory = record(WHOLE, REAL)
        self.memory["stamp"] = math.nan
        places, poses = np.zeros((3, PLACE)), np.full((2, POSE), math.nan)
        self.arrays = AnchorArrays(*places, *poses, self.memory)
        self._anchor = prepared(anchor, self.arrays, 0.0, np.zeros(POSE))

    def __call__(
        self, stamp: float, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return position (3,) [m] and quaternion (4,) [w x y z] of `stamp` [s] without jumps."""
        pose = np.concatenate((position, quaternion))
        self._anchor(self.arrays, stamp, pose)
        return pose[:3], pose[3:]


@jit
def anchor(a: AnchorArrays, stamp: float, pose: np.ndarray) -> None:
    """Take the jumps out of pose (7,), of `stamp` [s], in place. The poses come in their order.

    One that repeats the last exactly stays a repetition: the odometry is frozen.
    """
    m = a.numbers[0]
    if repeated(pose[:3], pose[3:], a.raw):
        pose[:] = a.given
        return
    dt = stamp - m.stamp
    place = np.empty(PLACE)
    place[:YAW] = pose[:YAW]
    place[YAW] = euler_from_quaternion(pose[3:])[2]
    if dt > 0.0:
        follow(a, dt, place)
        creep(a.offset, place, dt)
    if not -BRIDGED < dt <= 0.0:  # the first, a next one, or one of a new simulation
        m.stamp = stamp
        a.newest[:] = place
    pose[:YAW] = moved(a.offset, place)[:YAW]
    turn = quaternion_from_rotation_vector(np.array([0.0, 0.0, a.offset[YAW]]))
    pose[3:] = quaternion_multiply(turn, pose[3:])
    a.given[:] = pose


@jit
def follow(a: AnchorArrays, dt: float, place: np.ndarray) -> None:
    """Compare a place (4,) with where the last ones lead after dt [s]; change the offset if it has
    jumped, and the rates, by no more than the largest way that is none."""
    m = a.numbers[0]
    led = a.newest + dt * a.rates
    off = place - led
    off[YAW] = wrapped(off[YAW])
    distance = math.sqrt(off[0] ** 2 + off[1] ** 2 + off[2] ** 2)
    reach, turn = JUMP + 0.5 * AGILE * dt * dt, TURN_JUMP + 0.5 * SPIN * dt * dt
    if distance > reach or abs(off[YAW]) > turn:
        m.jumps, m.distance, m.turn = m.jumps + 1, distance, off[YAW]
        before = moved(a.offset, led)
        a.offset[YAW] = wrapped(a.offset[YAW] - off[YAW])
        a.offset[:YAW] = 0.0
        a.offset[:YAW] = before[:YAW] - moved(a.offset, place)[:YAW]
    off[:YAW] *= min(1.0, reach / max(distance, JUMP))
    off[YAW] = max(-turn, min(turn, off[YAW]))
    share = (1.0 - math.exp(-dt / SMOOTH)) / dt
    for i in range(PLACE):
        a.rates[i] += share * off[i]


@jit
def creep(offset: np.ndarray, place: np.ndarray, dt: float) -> None:
    """Let the offset (4,) fade for dt [s], seen at a place (4,) of the odometry."""
    apart = moved(offset, place) - place
    distance = math.sqrt(apart[0] ** 2 + apart[1] ** 2 + apart[2] ** 2)
    left = max(0.0, 1.0 - RETURN * dt / distance) if distance > 0.0 else 0.0
    yaw = offset[YAW]
    offset[:YAW] = 0.0
    offset[YAW] = math.copysign(max(0.0, abs(yaw) - TURN_BACK * dt), yaw)
    offset[:YAW] = (place + left * apart - moved(offset, place))[:YAW]


@jit
def moved(offset: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return a place (4,), turned by the yaw of the offset (4,) about the origin, then shifted."""
    cosine, sine = math.cos(offset[YAW]), math.sin(offset[YAW])
    found = offset + place
    found[0] = offset[0] + cosine * place[0] - sine * place[1]
    found[1] = offset[1] + sine * place[0] + cosine * place[1]
    return found


@jit
def wrapped(angle: float) -> float:
    """Return the angle [rad] between -pi and pi."""
    return angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi))
