"""The person of a rehearsal: does the steps of the guided checklist with the plant.

Steps and the motions that pass them: docs/preflight.md. The person waits a second, moves slowly,
holds, and goes back. Steps without a motion are confirmed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DOT, POSITION
from uam_control.maths.rotations import matrix_from_quaternion, quaternion_from_euler

# of the whole vehicle, 2.2 kg and 0.02 kg m^2: about 2 Hz, well damped
STIFFNESS, DAMPING = 400.0, 50.0  # [N/m], [N s/m]
TURN_STIFFNESS, TURN_DAMPING = 6.0, 0.6  # [N m/rad], [N m s/rad]
JOINT_STIFFNESS, JOINT_DAMPING = 4.0, 0.3  # [N m/rad], [N m s/rad]
JOINT_LIMIT = 2.0  # [N m]
X, Y, Z, ROLL, PITCH, YAW = range(6)
WAIT = 1.2  # [s] before a motion: the checklist takes the pose at rest as the reference
HOLD = 1.4  # [s] at each end of a motion
LIFTED = 0.6  # [m] above the start, in which the vehicle is carried
AGAIN = 4.0  # [s] after a step whose motions have not passed
# step → offsets from the pose at its begin, one after the other: axis and value [m, rad]
MOTIONS: dict[str, tuple[tuple[int, float], ...]] = {
    "tilt_roll": ((ROLL, 0.30), (ROLL, -0.30)),
    "tilt_pitch": ((PITCH, 0.30), (PITCH, -0.30)),
    "yaw_turn": ((YAW, 0.50),),
    "move_forward": ((X, 0.40),),
    "lift": ((Z, 0.30),),
}
JOINT, JOINT_MOTION = "joint:", 0.30  # [rad]
PUT_DOWN = "clear"
TURN_SPEED, SPEED = 0.35, 0.30  # [rad/s], [m/s] mean of a motion
BACK_TIME = 1.2  # [s] back into the pose in the hands
CARRY_TIME = 2.5  # [s] from the floor into the hands and back
LET_GO = 1.5  # [s] on the floor before the hands are off, and after


@dataclass
class Grip:
    """Where the hands want the vehicle."""

    pose: np.ndarray | None = None  # (6,) x y z roll pitch yaw [m, rad, ENU]; None: hands off
    joints: np.ndarray | None = None  # (n,) [rad]; None: hands off the arm


def wrench(grip: Grip, state: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """Return force (3,) [N, ENU] and torque (3,) [N m, FLU] on the base; zeros without a grip.

    state (3, 6 + n): true chi, see `coordinates`; weight [N] of the vehicle, which the hands carry.
    """
    if grip.pose is None:
        return np.zeros(3), np.zeros(3)
    chi, rates = state[CHI], state[CHI_DOT]
    force = STIFFNESS * (grip.pose[:3] - chi[POSITION]) - DAMPING * rates[POSITION]
    force[2] += weight
    desired = matrix_from_quaternion(quaternion_from_euler(grip.pose[3:]))
    present = matrix_from_quaternion(quaternion_from_euler(chi[ATTITUDE].copy()))
    skew = present.T @ desired - desired.T @ present
    error = 0.5 * np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    return force, TURN_STIFFNESS * error - TURN_DAMPING * rates[ATTITUDE]


def joint_torque(grip: Grip, state: np.ndarray) -> np.ndarray:
    """Return the torque (n,) [N m] of the hands on the joints; state: see `wrench`."""
    alpha, alpha_dot = state[CHI, ALPHA:], state[CHI_DOT, ALPHA:]
    if grip.joints is None:
        return np.zeros(len(alpha))
    torque = JOINT_STIFFNESS * (grip.joints - alpha) - JOINT_DAMPING * alpha_dot
    return np.clip(torque, -JOINT_LIMIT, JOINT_LIMIT)


def eased(share: float) -> float:
    """Return the share of the way at a share of the time, 0..1: at rest at both ends."""
    s = min(1.0, max(0.0, share))
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass
class Leg:
    """A motion of the grip, which is then held."""

    duration: float  # [s]
    hold: float  # [s]
    pose: np.ndarray | None = None  # as in `Grip`; None: as before
    joints: np.ndarray | None = None  # (n,) [rad]; None: as before
    off: bool = False  # the hands let go


class Person:
    """Follows the steps."""

    def __init__(self, joint_names: tuple[str, ...], folded: Sequence[float]) -> None:
        """joint_names: of the vehicle, base to tip; folded (n,) [rad]: the arm on the ground."""
        self._names, self._folded = joint_names, np.array(folded, dtype=float)
        self.grip = Grip()  # the hands now
        self.wishes_to_confirm = False  # the step's motion is over
        self.done: list[str] = []  # steps done so far, for the record
        self._step = ""
        self._start: np.ndarray | None = None  # (6,) pose on the floor
        self._home: np.ndarray | None = None  # (6,) pose in the hands
        self._legs: list[Leg] = []  # to do; the first one is under way
        self._begun = 0.0  # [s] of the first one
        self._from = Grip()  # at its begin
        self._over: float | None = None  # [s] end of the last one

    def update(self, time: float, step: str, chi: np.ndarray) -> Grip:
        """Return the grip at `time` [s]; step: of the checklist; chi (6 + n,): true coordinates."""
        again = self._over is not None and time > self._over + AGAIN and bool(step)
        if step != self._step or again:
            self._step, self.wishes_to_confirm, self._over = step, False, None
            self._legs = self._planned(step, chi)
            self._begin_leg(time)
        self._follow(time)
        return self.grip

    def _planned(self, step: str, chi: np.ndarray) -> list[Leg]:
        """Return the legs of a step; "", the list is over or left: put the vehicle down."""
        if self._start is None:
            self._start = chi[:6].copy()
        if step in ("", PUT_DOWN):
            if self.grip.pose is None:
                return [Leg(WAIT, 0.0)] if step else []
            self.grip.joints = chi[6:].copy()  # fold the arm as it was: it may have no torque
            folded = self._folded.copy()
            down = Leg(CARRY_TIME, LET_GO, pose=self._start.copy(), joints=folded)
            return [Leg(WAIT, 0.0), down, Leg(0.0, LET_GO, off=True)]
        if self.grip.pose is None:
            self.grip.pose = chi[:6].copy()
            self._home = self._start.copy()
            self._home[Z] += LIFTED
            self._home[ROLL] = self._home[PITCH] = 0.0
            legs = [Leg(CARRY_TIME, HOLD + WAIT, pose=self._home.copy())]
        else:  # the step before may have passed in the middle of its motion
            legs = [Leg(BACK_TIME, WAIT, pose=self._home.copy())]
        for axis, value in MOTIONS.get(step, ()):
            legs += [_moved(self._home, axis, value), Leg(_time(axis, value), HOLD, self._home)]
        name = step.removeprefix(JOINT)
        if name != step and name in self._names:
            moved = self._folded.copy()
            moved[self._names.index(name)] += JOINT_MOTION
            self.grip.joints = chi[6:].copy()  # now in the hands: it may have no torque
            legs[-1].joints = rest = self._folded.copy()
            time = JOINT_MOTION / TURN_SPEED
            legs += [Leg(time, HOLD, joints=moved), Leg(time, HOLD, joints=rest)]
        else:
            self.grip.joints = None
        return legs

    def _begin_leg(self, time: float) -> None:
        self._begun, self._from = time, Grip(self.grip.pose, self.grip.joints)

    def _follow(self, time: float) -> None:
        """Move the grip to its place at `time` [s]."""
        while self._legs:
            leg, since = self._legs[0], time - self._begun
            share = eased(since / leg.duration) if leg.duration > 0.0 else 1.0
            if leg.off:
                self.grip = Grip()
            if leg.pose is not None:
                self.grip.pose = _between(self._from.pose, leg.pose, share)
            if leg.joints is not None:
                self.grip.joints = _between(self._from.joints, leg.joints, share)
            if since < leg.duration + leg.hold:
                return
            self._legs.pop(0)
            self._begin_leg(self._begun + leg.duration + leg.hold)
            if not self._legs:
                self._over = time
                self.wishes_to_confirm = bool(self._step)
                self.done += [self._step] if self._step else []


def _between(begin: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    return begin + share * (end - begin)


def _moved(home: np.ndarray, axis: int, value: float) -> Leg:
    """Return the leg to an offset along an axis of the body that stands level at `home`."""
    return Leg(_time(axis, value), HOLD, pose=home + _offset(home, axis, value))


def _time(axis: int, value: float) -> float:
    return abs(value) / (SPEED if axis <= Z else TURN_SPEED)


def _offset(home: np.ndarray, axis: int, value: float) -> np.ndarray:
    offset = np.zeros(6)
    if axis == X:  # along the nose
        offset[X], offset[Y] = value * np.cos(home[YAW]), value * np.sin(home[YAW])
    else:
        offset[axis] = value
    return offset
